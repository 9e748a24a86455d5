"""Expressions of convex programs: vectors that are affine in one stacked variable, and squares of such.

They are held as (row, column, value) triplets, so that a transcription of any length takes a fixed number of array
operations, and what they amount to is the solver's matrix without further passes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
from scipy import sparse

from trajopt.model import Floats, Integers

_CONCAVE: Final = "the square is bounded above, or its negative minimised: no convex program"
NONE: Final = np.empty(0, dtype=np.intp)


@lru_cache(maxsize=32)
def _each(count: int) -> Integers:
    return np.arange(count)


@dataclass(eq=False, slots=True)  # a program takes a hundred: frozen ones are made three times as slowly
class Affine:
    """(n,) expressions A x + constant, with A as triplets that may repeat. A single one stands for as many as needed.

    ``squares``: (rows, weights, of): the squares of the expressions ``of``, times their weights, added to these rows.
    """

    rows: Integers
    columns: Integers
    values: Floats
    constant: Floats
    squares: tuple[tuple[Integers, Floats, Affine], ...] = ()

    __array_ufunc__ = None  # arrays leave sums and products with an expression to it

    @classmethod
    def of(cls, x: Any) -> Affine:
        """An expression as it is, floats as a constant one."""
        return x if isinstance(x, Affine) else cls(NONE, NONE, np.empty(0), np.array(x, dtype=float).reshape(-1))

    @classmethod
    def variables(cls, first: int, count: int) -> Affine:
        """``count`` elements of the stacked variable, from the ``first``."""
        return cls.each(first + _each(count), 1.0, np.zeros(count))

    @classmethod
    def each(cls, columns: Integers, factor: float, constant: Floats) -> Affine:
        """(n,) elements of the stacked variable, times a factor, plus constants."""
        return cls(_each(len(columns)), columns, np.full(len(columns), factor), constant)

    def __len__(self) -> int:
        return len(self.constant)

    @property
    def _plain(self) -> bool:
        """Whether, to be seen at once, every row has one entry, in their order."""
        return self.rows is _each(len(self))

    def __getitem__(self, key: Any) -> Affine:
        if self._plain and not self.squares:
            if not isinstance(key, slice):
                key = np.atleast_1d(np.arange(len(self))[key])
            columns, values, constant = self.columns[key], self.values[key], self.constant[key]
            return Affine(_each(len(columns)), columns, values, constant)
        if isinstance(key, slice) and key.step is None and not self.squares:
            start, stop, _ = key.indices(len(self))
            if stop - start == len(self):
                return self
            kept = (self.rows >= start) & (self.rows < stop)
            return Affine(self.rows[kept] - start, self.columns[kept], self.values[kept], self.constant[key])
        picked = np.atleast_1d(np.arange(len(self))[key])
        place = np.full(len(self), -1)
        place[picked] = np.arange(len(picked))
        return self._placed(place, self.constant[picked])

    def _placed(self, place: Integers, constant: Floats) -> Affine:
        """The rows moved to their places, or dropped where that is negative; the constant is the new one."""
        rows = place[self.rows]
        kept = rows >= 0
        squares = []
        for at, weights, of in self.squares:
            to = place[at]
            some = np.flatnonzero(to >= 0)
            squares.append((to[some], weights[some], of[some]))
        return Affine(rows[kept], self.columns[kept], self.values[kept], constant, tuple(squares))

    def __neg__(self) -> Affine:
        return self * -1.0

    def __mul__(self, factor: Any) -> Affine:
        if isinstance(factor, float) or np.ndim(factor) == 0:
            squares = tuple((rows, weights * factor, of) for rows, weights, of in self.squares)
            return Affine(self.rows, self.columns, self.values * factor, self.constant * factor, squares)
        x = self.broadcast(len(factor))
        squares = tuple((rows, weights * factor[rows], of) for rows, weights, of in x.squares)
        values = x.values * (factor if x._plain else factor[x.rows])
        return Affine(x.rows, x.columns, values, x.constant * factor, squares)

    __rmul__ = __mul__

    def __truediv__(self, divisor: Any) -> Affine:
        return self.__mul__(1 / divisor)

    def __add__(self, other: Any) -> Affine:
        if isinstance(other, Affine):
            return _sum(self, other)
        constant = self.constant + other
        x = self.broadcast(len(constant))
        return Affine(x.rows, x.columns, x.values, constant, x.squares)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Affine:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> Affine:
        return (-self).__add__(other)

    def broadcast(self, count: int) -> Affine:
        """The expression, ``count`` times if it is a single one. Raises ValueError where lengths disagree."""
        if len(self) == count:
            return self
        if len(self) != 1 or self.squares:
            raise ValueError(f"{len(self)} expressions where {count} are needed")
        rows = np.repeat(np.arange(count), len(self.rows))
        columns, values = np.tile(self.columns, count), np.tile(self.values, count)
        return Affine(rows, columns, values, np.repeat(self.constant, count))

    def total(self, weights: Floats) -> Affine:
        """The single expression Σ weights·x."""
        x = self.broadcast(len(weights))
        constant = np.array([weights @ x.constant])
        squares = tuple((np.zeros_like(rows), w * weights[rows], of) for rows, w, of in x.squares)
        return Affine(np.zeros_like(x.rows), x.columns, x.values * weights[x.rows], constant, squares)

    def squared(self) -> Affine:
        """The square of every expression. Raises ValueError for what is no longer affine."""
        if self.squares:
            raise ValueError("the square of a square is no quadratic program")
        squares = ((np.arange(len(self)), np.ones(len(self)), self),)
        return Affine(NONE, NONE, np.empty(0), np.zeros(len(self)), squares)

    @property
    def affine(self) -> Affine:
        """What is left without the squares."""
        return Affine(self.rows, self.columns, self.values, self.constant)

    @property
    def convex(self) -> Affine:
        """The squares alone."""
        return Affine(NONE, NONE, np.empty(0), np.zeros(len(self)), self.squares)

    def quadratic(self, columns: int) -> tuple[sparse.csc_array, Floats, float]:
        """P, q and the constant of a single expression ½x'Px + q'x + constant. Raises ValueError where it is concave in
        a square."""
        diagonal, mixed = np.zeros(columns), []
        q: Any = np.bincount(self.columns, self.values, minlength=columns)
        constant = float(self.constant[0])
        for _, weights, of in self.squares:
            if np.any(weights < 0):
                raise ValueError(_CONCAVE)
            twice = 2 * weights
            of_rows = twice[of.rows] * of.values
            q = q + np.bincount(of.columns, of_rows * of.constant[of.rows], minlength=columns)
            constant += float(weights @ np.square(of.constant))
            if of._plain or len(np.unique(of.rows)) == len(of.rows):  # squares of single variables
                diagonal += np.bincount(of.columns, of_rows * of.values, minlength=columns)
            else:
                A = of.matrix(columns)
                mixed.append(A.T @ (sparse.diags_array(twice) @ A))
        at = np.flatnonzero(diagonal)
        P: Any = sparse.csc_array((diagonal[at], at, np.searchsorted(at, np.arange(columns + 1))), (columns, columns))
        return sparse.csc_array(sum(mixed, P)) if mixed else P, q, constant

    def matrix(self, columns: int) -> sparse.csr_array:
        """A, for a stacked variable of that length."""
        return sparse.csr_array((self.values, (self.rows, self.columns)), shape=(len(self), columns))

    def at(self, x: Floats) -> Floats:
        """(n,) values at the stacked variable."""
        values = self.constant + np.bincount(self.rows, self.values * x[self.columns], minlength=len(self))
        for rows, weights, of in self.squares:
            values += np.bincount(rows, weights * np.square(of.at(x)), minlength=len(self))
        return values


def _sum(a: Affine, b: Affine) -> Affine:
    if len(a) != len(b):
        count = max(len(a), len(b))
        a, b = a.broadcast(count), b.broadcast(count)
    return Affine(
        np.concatenate([a.rows, b.rows]),
        np.concatenate([a.columns, b.columns]),
        np.concatenate([a.values, b.values]),
        a.constant + b.constant,
        a.squares + b.squares,
    )


def stacked(parts: Sequence[Affine]) -> Affine:
    """One vector of several."""
    first = np.cumsum([0, *(len(part) for part in parts)])
    placed = list(zip(first, parts, strict=False))
    squares = [(at + rows, weights, of) for at, part in placed for rows, weights, of in part.squares]
    return Affine(
        np.concatenate([NONE, *(at + part.rows for at, part in placed)]),
        np.concatenate([NONE, *(part.columns for part in parts)]),
        np.concatenate([np.empty(0), *(part.values for part in parts)]),
        np.concatenate([np.empty(0), *(part.constant for part in parts)]),
        tuple(squares),
    )


def in_cones(x: Affine) -> tuple[Affine, list[int]]:
    """x <= 0, for sums of squares and what is affine, as vectors in second-order cones one after another, of these
    sizes: Σ w y² <= r is |(2 √w y, 1 - r)| <= 1 + r. Raises ValueError where a weight is negative."""
    rows = np.concatenate([at for at, _, _ in x.squares])
    weights = np.concatenate([w for _, w, _ in x.squares])
    if np.any(weights < 0):
        raise ValueError(_CONCAVE)
    sizes = np.bincount(rows, minlength=len(x)) + 2
    first = np.cumsum(sizes) - sizes
    order = np.argsort(rows, kind="stable")
    within = np.arange(len(rows)) - np.searchsorted(rows[order], rows[order])
    place = np.empty(len(rows), dtype=np.intp)
    place[order] = first[rows[order]] + 1 + within
    total, tails = int(sizes.sum()), stacked([of for _, _, of in x.squares]) * (2 * np.sqrt(weights))
    found = [
        part._placed(at, _scattered(part.constant, at, total))
        for part, at in ((1.0 - x.affine, first), (1.0 + x.affine, first + sizes - 1), (tails, place))
    ]
    return _sum(_sum(found[0], found[1]), found[2]), sizes.tolist()


def _scattered(values: Floats, at: Integers, count: int) -> Floats:
    whole = np.zeros(count)
    whole[at] = values
    return whole
