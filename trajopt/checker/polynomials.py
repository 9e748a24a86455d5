"""Polynomials on 0 <= s <= 1 in powers and in Bernstein form: rows of floats, or whole numbers over a denominator."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from operator import mul
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from trajopt.checker.case import Array
from trajopt.checker.report import to_float

_DIVISION = 800  # what changes its sign and back within a tenth of such a part is nothing
_PARTS = 8  # into which a piece is split at a time, where it must be
_ROUNDS = 20  # of splitting: no part is longer than 2^-60 then
Integers: TypeAlias = NDArray[np.intp]
Poly: TypeAlias = tuple[list[int], int]  # coefficients of powers (or Bernstein polynomials) of s, over one denominator


@cache
def _to_bernstein(degree: int) -> tuple[list[list[int]], int]:
    """Integer rows and a divisor that turn coefficients of powers of s into Bernstein coefficients on 0 <= s <= 1."""
    divisor = math.lcm(*(math.comb(degree, i) for i in range(degree + 1)))
    rows = [[math.comb(k, i) * divisor // math.comb(degree, i) for i in range(k + 1)] for k in range(degree + 1)]
    return rows, divisor


# in floats, a row for each polynomial


def product(a: Array, b: Array) -> Array:
    found = np.zeros((len(a), a.shape[1] + b.shape[1] - 1))
    for i in range(a.shape[1]):
        found[:, i : i + b.shape[1]] += a[:, i : i + 1] * b
    return found


def bernstein(rows: Array) -> Array:
    """Bernstein coefficients: the first and last are values at the ends, all values lie between the extremes."""
    return rows @ _bernstein_matrix(rows.shape[1] - 1) if rows.shape[1] > 1 else rows


@cache
def _bernstein_matrix(degree: int) -> Array:
    table, divisor = _to_bernstein(degree)
    return np.array([row + [0] * (len(table) - len(row)) for row in table], dtype=np.float64).T / divisor


def _parts(rows: Array) -> Array:
    """Bernstein coefficients on each of ``_PARTS`` parts of the pieces, part by part of the first, then of the next."""
    return (rows @ _to_parts(rows.shape[1] - 1)).reshape(-1, rows.shape[1])


@cache
def _to_parts(degree: int) -> Array:
    """By de Casteljau's halves of halves: sums of powers of two, exact."""
    parts = [np.eye(degree + 1)]
    while len(parts) < _PARTS:
        parts = [half for part in parts for half in _halves(part)]
    return np.concatenate(parts, axis=1)


def _halves(rows: Array) -> tuple[Array, Array]:
    left, right = np.empty_like(rows), np.empty_like(rows)
    for i in range(rows.shape[1]):
        left[:, i], right[:, -1 - i] = rows[:, 0], rows[:, -1]
        rows = (rows[:, 1:] + rows[:, :-1]) / 2
    return left, right


def highest(rows: Array, slack: float, relative: float) -> tuple[float, int, float]:
    """The highest value of polynomials in Bernstein form, to ``slack`` and ``relative``; 0 if that is higher.

    Returns the value, the index of the polynomial and s. NaN when it cannot be told, for rounding.
    """
    best, where, crowd = 0.0, (0, 0.0), 2 * _PARTS * len(rows) + 1000
    index, start, width = np.arange(len(rows)), np.zeros(len(rows)), 1.0
    for _ in range(_ROUNDS):
        ends = np.maximum(rows[:, 0], rows[:, -1])
        k = int(np.argmax(ends))
        if ends[k] > best:
            best, where = float(ends[k]), (int(index[k]), float(start[k] + (0.0 if rows[k, 0] == ends[k] else width)))
        bounds = _greatest(rows)
        still_open = ~(bounds <= best + slack + relative * best)
        if not still_open.any():
            return best, *where
        if np.count_nonzero(still_open) > crowd or not math.isfinite(float(bounds.max())):
            break
        rows, width = _parts(rows[still_open]), width / _PARTS
        index = np.repeat(index[still_open], _PARTS)
        start = np.add.outer(start[still_open], width * np.arange(_PARTS)).ravel()
    return math.nan, *where


def _greatest(rows: Array) -> Array:
    """The greatest of every row: for short ones, and many, quicker than numpy's."""
    found = rows[:, 0]
    for column in rows.T[1:]:
        found = np.maximum(found, column)
    return found


def absolute_integral(rows: Array, length: Array, relative: float) -> float:
    """The integral of |p| over all pieces, split where p changes its sign until its chord does for it; to so much of
    the integral of the largest |coefficient|."""
    sizes = _greatest(np.abs(rows))
    total, slack, enough = 0.0, 1e-13 * sizes.max(), relative * float(sizes @ length)
    if not math.isfinite(enough):  # no splitting would end it
        return math.nan
    share, mean = np.linspace(0.0, 1.0, rows.shape[1]), np.full(rows.shape[1], 1 / rows.shape[1])
    for _ in range(_ROUNDS):
        whole = (_greatest(-rows) <= slack) | (_greatest(rows) <= slack)
        total += float((np.abs(rows @ mean) * whole) @ length)
        if whole.all():
            return total
        rows, length = rows[~whole], length[~whole]
        apart = rows - np.outer(rows[:, 0], 1 - share) - np.outer(rows[:, -1], share)
        if _greatest(np.abs(apart)) @ length <= enough:  # the integrals differ by no more
            break
        rows, length = _parts(rows), np.repeat(length / _PARTS, _PARTS)
    first, last = rows[:, 0], rows[:, -1]
    crossing = first * last < 0
    straight = np.abs(first + last) / 2
    straight[crossing] = ((first**2 + last**2)[crossing] / np.abs(last - first)[crossing]) / 2
    return total + float(straight @ length)


def both_signs(function: Callable[[Integers, Array], Array], length: Array) -> tuple[float, float]:
    """The integrals of max(0, f) and max(0, -f) over pieces; ``function`` gives f on pieces (n,) at s (n, points).

    By Gauss points on a fine division, and on halves of halves where those do not yet agree: a corner costs a halving
    for each bit.
    """
    points, shares = np.polynomial.legendre.leggauss(10)
    points, shares = (points + 1) / 2, shares / 2

    def means(index: Integers, start: Array, width: Array) -> Array:
        values = function(index, start[:, None] + width[:, None] * points)
        return np.stack([np.maximum(values, 0.0) @ shares, np.maximum(-values, 0.0) @ shares], axis=1)

    each = -(-_DIVISION // len(length))
    index, width = np.repeat(np.arange(len(length)), each), np.full(each * len(length), 1.0 / each)
    start = np.tile(np.arange(each) / each, len(length))
    coarse, total = means(index, start, width), np.zeros(2)
    enough = 1e-13 * float(np.sum(coarse * (length[index] * width)[:, None])) / len(index)
    for _ in range(60):
        half = width / 2
        fine = np.stack([means(index, start, half), means(index, start + half, half)])
        span = (length[index] * half)[:, None]
        sums = fine.sum(axis=0) * span
        still_open = np.any(np.abs(sums - 2 * span * coarse) > enough, axis=1)
        total += sums[~still_open].sum(axis=0)
        if not still_open.any():
            break
        index, width = np.tile(index[still_open], 2), np.tile(half[still_open], 2)
        start = np.concatenate([start[still_open], start[still_open] + half[still_open]])
        coarse = fine[:, still_open].reshape(-1, 2)
    return float(total[0]), float(total[1])


def values_at(rows: Array, index: Integers, s: Array) -> Array:
    """Polynomials (in powers) of the pieces ``index`` (n,) at s (n, points)."""
    found = np.zeros_like(s)
    for column in rows[index].T[::-1]:
        found = found * s + column[:, None]
    return found


def square_integral(rows: Array, length: Array) -> float:
    """The integral of p squared over all pieces, from their coefficients."""
    return float(np.sum((rows.T * length) @ rows * _mean_products(rows.shape[1])))


@cache
def _mean_products(count: int) -> Array:
    """The means of products of powers of s."""
    powers = np.arange(count)
    return np.asarray(1.0 / (np.add.outer(powers, powers) + 1))


# in whole numbers


def constant(x: Fraction) -> Poly:
    return [x.numerator], x.denominator


def plus(p: Poly, q: Poly) -> Poly:
    unit = math.lcm(p[1], q[1])
    a, b = unit // p[1], unit // q[1]
    found = [a * x for x in p[0]] + [0] * (len(q[0]) - len(p[0]))
    for i, x in enumerate(q[0]):
        found[i] += b * x
    return found, unit


def times(p: Poly, q: Poly) -> Poly:
    found = [0] * (len(p[0]) + len(q[0]) - 1)
    for i, x in enumerate(p[0]):
        for j, y in enumerate(q[0]):
            found[i + j] += x * y
    return found, p[1] * q[1]


def bernstein_exactly(poly: Poly) -> Poly:
    values, unit = poly
    table, divisor = _to_bernstein(len(values) - 1)
    return [sum(map(mul, row, values)) for row in table], unit * divisor


def _halves_exactly(row: Poly) -> tuple[Poly, Poly]:
    """Bernstein coefficients on both halves (de Casteljau)."""
    values, unit = row
    degree = len(values) - 1
    left, right = [values[0] << degree], [values[-1] << degree]
    for rest in reversed(range(degree)):
        values = [a + b for a, b in zip(values, values[1:], strict=False)]
        left.append(values[0] << rest)
        right.append(values[-1] << rest)
    return (left, unit << degree), (right[::-1], unit << degree)


def highest_exactly(rows: list[Poly], slack: Fraction, relative: Fraction) -> tuple[Fraction, int, Fraction]:
    """A bound the polynomials never exceed, to ``slack`` and ``relative`` of their highest value; 0 if that is higher.

    Returns the bound, the index of the polynomial and s. Rows are in Bernstein form.
    """
    best, where = Fraction(0), (0, Fraction(0))
    for k, (values, unit) in enumerate(rows):
        end = max(values[0], values[-1])
        if end * best.denominator > best.numerator * unit:
            best, where = Fraction(end, unit), (k, Fraction(int(values[0] != end)))
    cut = best + slack + relative * best
    stack = [
        (row, k, Fraction(0), Fraction(1))
        for k, row in enumerate(rows)
        if max(row[0]) * cut.denominator > cut.numerator * row[1]
    ]
    while stack:
        row, k, start, width = stack.pop()
        bound = Fraction(max(row[0]), row[1])
        if bound <= cut:
            continue
        left, right = _halves_exactly(row)
        width /= 2
        middle = Fraction(right[0][0], right[1])
        if middle > best:
            best, where = middle, (k, start + width)
            cut = best + slack + relative * best
        if width.denominator >= 2**64:  # only where no slack was given: take the bound as reached
            best = cut = bound
            continue
        stack += [(left, k, start, width), (right, k, start + width, width)]
    return (cut if best else best), *where


def absolute_integral_exactly(rows: list[Poly], lengths: list[Fraction]) -> Fraction:
    """The integral of |p| over all pieces, split where p changes its sign, to 1e-12 of the total."""
    total = Fraction(0)
    stack = list(zip(rows, lengths, strict=True))
    bounds = (to_float(Fraction(max(map(abs, values)), unit) * length) for (values, unit), length in stack)
    enough = Fraction(to_float(1e-13 * sum(bounds) / len(rows)))
    while stack:
        (values, unit), length = stack.pop()
        if min(values) >= 0 or max(values) <= 0:
            total += Fraction(abs(sum(values)), unit * len(values)) * length
        elif Fraction(max(map(abs, values)), unit) * length > enough:
            stack += [(half, length / 2) for half in _halves_exactly((values, unit))]
    return total


def split_at_sign(
    rows: list[tuple[Poly, Poly, Poly]], lengths: list[Fraction]
) -> tuple[list[Poly], list[Fraction]]:
    """From (p, f, g) in Bernstein form f where p is positive and g where it is negative, to 1e-13 of p's integral."""
    found: list[Poly] = []
    spans: list[Fraction] = []
    stack = list(zip(rows, lengths, strict=True))
    bounds = (to_float(Fraction(max(map(abs, p[0])), p[1]) * length) for (p, _, _), length in stack)
    enough = Fraction(to_float(1e-13 * sum(bounds) / len(rows)))
    while stack:
        (p, f, g), length = stack.pop()
        mixed = min(p[0]) < 0 < max(p[0])
        if mixed and Fraction(max(map(abs, p[0])), p[1]) * length > enough:
            halves = zip(*(_halves_exactly(row) for row in (p, f, g)), strict=True)
            stack += [(half, length / 2) for half in halves]
            continue
        found.append(f if sum(p[0]) >= 0 else g)
        spans.append(length)
    return found, spans


def integral_exactly(rows: list[Poly], lengths: list[Fraction]) -> Fraction:
    """The integral of polynomials in Bernstein form."""
    parts = zip(rows, lengths, strict=True)
    return sum((Fraction(sum(values), unit * len(values)) * length for (values, unit), length in parts), Fraction(0))


def square_integral_exactly(polys: list[Poly], lengths: list[Fraction]) -> Fraction:
    sums: dict[int, int] = {}  # by denominator: most pieces share one, and a gcd for each would take most of the time
    for poly, length in zip(polys, lengths, strict=True):
        values, unit = times(poly, poly)
        divisor = math.lcm(*range(1, len(values) + 1))
        unit *= divisor * length.denominator
        sums[unit] = sums.get(unit, 0) + length.numerator * sum(x * (divisor // (i + 1)) for i, x in enumerate(values))
    return sum((Fraction(total, unit) for unit, total in sums.items()), Fraction(0))
