"""Switching times to rounding: Newton's method on the constraint equations, with those of the costate where needed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.optimize import linprog

from trajopt.plant.basis import Basis
from trajopt.plant.coarse import Move
from trajopt.plant.exponentials import Floats
from trajopt.plant.sigma import lowest, roots, samples, share

_STEPS: Final = 60
_DROPS: Final = 8  # arcs that may vanish one after the other
_EXACT: Final = 1e-12  # of the equations, relative to their terms
_NO_ARC: Final = 1e-13  # of the duration
_SIGN: Final = 1e-9  # how far sigma may go astray, relative to the sum of its terms


@dataclass(frozen=True)
class Structure:
    """The sign of the first arc (+1 at the upper limit) and backward times h (m + 1,): duration, then switches,
    falling; in units of the horizon of the basis."""

    sign: float
    h: Floats

    def amplitudes(self, move: Move) -> Floats:
        """(m + 2,) the jumps of the input at h and at last at 0."""
        up = self.sign * (-1.0) ** np.arange(len(self.h)) > 0
        levels = np.where(up, move.high, move.low)
        return np.diff(np.concatenate([[0.0], levels, [move.u_ss]]))


def residuals(move: Move, basis: Basis, structure: Structure) -> Floats:
    """(n,) the errors of the constraint equations."""
    values = basis.tables(np.append(structure.h, 0.0))[0]
    result: Floats = values @ structure.amplitudes(move) - basis.targets()
    return result


def settle(move: Move, basis: Basis, structure: Structure, costate: Floats) -> Structure | None:
    """The structure with the equations solved, its arcs fewer or more where they must be; None if none was found."""
    n = len(costate)
    if len(structure.h) < n:
        tries = [structure, *split(structure, n)]
        return next((x for x, exact in (polish(move, basis, tried, costate) for tried in tries) if exact), None)
    for _ in range(_DROPS):
        reached, exact = polish(move, basis, structure, costate)
        if exact:
            return reached
        if len(reached.h) <= n:
            break
        structure = without_shortest(structure, reached)
    return None


def polish(move: Move, basis: Basis, structure: Structure, costate: Floats) -> tuple[Structure, bool]:
    """Where Newton's method leads the structure, and whether the equations hold there. If not, there is no solution
    near by, or an arc vanished on the way.

    With more than n - 1 switches their times are free in the constraint equations; then sigma(h_i) = 0 and |c| = 1
    join, with the costate c unknown too.
    """
    n, count = len(costate), len(structure.h)
    extended = count > n
    x = np.concatenate([structure.h, costate]) if extended else structure.h.copy()
    value, slope = _equations(move, basis, structure.sign, x, count)
    for _ in range(_STEPS):
        step = np.linalg.lstsq(slope, -value, rcond=1e-14)[0]
        part = _allowed(x[:count], step[:count])
        size = np.linalg.norm(value)
        while part > 1e-6:
            tried = _equations(move, basis, structure.sign, x + part * step, count)
            if np.linalg.norm(tried[0]) < size:
                break
            part /= 2
        else:
            break
        x, (value, slope) = x + part * step, tried
    found = Structure(structure.sign, x[:count])
    gaps = -np.diff(np.append(found.h, 0.0))
    exact = np.max(np.abs(value)) <= _EXACT * max(1.0, float(count))
    return found, bool(exact and np.all(gaps > 0))


def _equations(move: Move, basis: Basis, sign: float, x: Floats, count: int) -> tuple[Floats, Floats]:
    """The errors of all equations at the unknowns and their Jacobian."""
    h, c = x[:count], x[count:]
    structure = Structure(sign, h)
    value, slope, curve = basis.tables(np.append(h, 0.0))
    amplitudes = structure.amplitudes(move)
    errors = value @ amplitudes - basis.targets()
    jacobian = slope[:, :-1] * amplitudes[:-1]
    if not len(c):
        return errors, jacobian
    terms = np.sum(np.abs(c[:, None] * slope[:, 1:-1]), axis=0)
    sigma = c @ slope[:, 1:-1] / terms
    below = np.zeros((count, count + len(c)))
    below[:-1, 1:count] = np.diag(c @ curve[:, 1:-1] / terms)
    below[:-1, count:] = (slope[:, 1:-1] / terms).T
    below[-1, count:] = 2 * c
    jacobian = np.vstack([np.hstack([jacobian, np.zeros((len(c), len(c)))]), below])
    return np.concatenate([errors, sigma, [c @ c - 1]]), jacobian


def _allowed(h: Floats, step: Any) -> float:
    """The share of a step, at most one, that keeps every arc at a fifth of its length or more."""
    gaps, changes = -np.diff(np.append(h, 0.0)), -np.diff(np.append(step, 0.0))
    shrinking = changes < 0
    return float(min(1.0, np.min(0.8 * gaps[shrinking] / -changes[shrinking], initial=1.0)))


def costate_of(basis: Basis, structure: Structure) -> Floats:
    """(n,) c with |c| = 1 and sigma zero at every switch, signed as the arcs ask.

    With fewer than n - 1 switches many costates vanish there; the one is chosen whose sigma keeps its sign best.
    """
    slope = basis.tables(structure.h[1:])[1]
    n, count = slope.shape
    rows = (slope / np.linalg.norm(slope, axis=0)).T if count else np.zeros((1, n))
    kernel = np.linalg.svd(rows)[2][min(count, n - 1) :].T
    h, wanted = inner_points(structure)
    table = basis.tables(h)[1]
    if kernel.shape[1] == 1:
        only: Floats = kernel[:, 0]
        return only if np.sum(np.sign(only @ table) * wanted) >= 0 else -only
    gains = (kernel.T @ (table / np.linalg.norm(table, axis=0) * wanted)).T
    size = kernel.shape[1]
    bounds = [(-1.0, 1.0)] * size + [(None, 1.0)]
    cost, rows = np.append(np.zeros(size), -1.0), np.column_stack([-gains, np.ones(len(h))])
    best = linprog(cost, rows, np.zeros(len(h)), bounds=bounds, method="highs").x
    c: Floats = kernel[:, 0] if best is None or not np.any(best[:-1]) else kernel @ best[:-1]
    return c / float(np.linalg.norm(c))


def inner_points(structure: Structure, points: int = 40) -> tuple[Floats, Floats]:
    """Backward times inside every arc and the sign of the arc at each."""
    ends = np.append(structure.h, 0.0)
    shares = (np.arange(points) + 0.5) / points
    h = (ends[1:, None] + (ends[:-1] - ends[1:])[:, None] * shares).ravel()
    signs = structure.sign * (-1.0) ** np.arange(len(structure.h))
    return h, np.repeat(signs, points)


def sign_margin(basis: Basis, structure: Structure, costate: Floats) -> float:
    """The least of sigma, times the sign of its arc, over the whole move, relative to the sum of its terms: zero but
    for rounding (it vanishes at the switches) if the command is optimal, clearly negative if it is not.

    Between the samples sigma is judged at the roots that they bracket and at its lowest samples, sampled anew.
    """
    worst = 0.0
    ends = np.append(structure.h, 0.0)
    for i, (high, low) in enumerate(zip(ends[:-1], ends[1:], strict=True)):
        sign = structure.sign * (-1.0) ** i
        h = samples(basis, low, high)
        for _ in range(2):
            value = share(basis, costate, h) * sign
            worst = min(worst, float(np.min(value)))
            h = lowest(h, value)
            if not len(h):
                break
    return worst


def settled_sign(margin: float) -> bool:
    """Whether a margin of sigma proves the command optimal."""
    return margin >= -_SIGN


def without_shortest(structure: Structure, reached: Structure) -> Structure:
    """The structure without the arc that shrank most on the way to ``reached``."""
    before, after = (-np.diff(np.append(x.h, 0.0)) for x in (structure, reached))
    arc = int(np.argmin(after / before))
    if arc == 0:
        return Structure(-structure.sign, np.delete(structure.h, 1))
    return Structure(structure.sign, np.delete(structure.h, [arc, arc + 1][: len(structure.h) - arc]))


def without_rounding(structure: Structure) -> Structure:
    """The structure without arcs so short that they are rounding: where sigma touches zero two switches meet."""
    h, sign = structure.h, structure.sign
    while len(h) > 1:
        gaps = -np.diff(np.append(h, 0.0))
        arc = int(np.argmin(gaps))
        if gaps[arc] > _NO_ARC * h[0]:
            break
        if arc == 0:
            h, sign = np.delete(h, 1), -sign
        else:
            h = np.delete(h, [arc, arc + 1][: len(h) - arc])
    return Structure(sign, h)


def split(structure: Structure, n: int) -> Iterator[Structure]:
    """Structures with two more switches, where there are fewer than n - 1: arcs too short for a mesh lie about a
    switch, or one at either end of the move."""
    if len(structure.h) + 2 > n:
        return
    h = structure.h
    for width in (1e-3, 1e-2):
        for i in range(1, len(h)):
            yield Structure(structure.sign, np.sort(np.concatenate([h, h[i] + [-width, width]]))[::-1])
        yield Structure(-structure.sign, np.sort(np.concatenate([h, [h[0] * (1 - width), h[0] * width]]))[::-1])


def renewed(basis: Basis, structure: Structure, costate: Floats) -> Structure:
    """The structure that sigma of a costate asks for on the duration of another."""
    top = float(structure.h[0])
    sign, switches = roots(basis, costate, top)
    return Structure(sign, np.append(top, switches))
