"""The checker's own quintic splines: a load over position, from the rows of its table.

By the recursion of Cox and de Boor and a banded system, then as a polynomial on each stretch between two knots. The
knots are those of a spline without knots at the second and third row from either end.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from trajopt.checker.case import Array
from trajopt.checker.polynomials import product

DEGREE: Final = 5


@dataclass(frozen=True)
class Spline:
    """Quintic through ``value`` (n,) at ``position`` (n,), n >= 6."""

    position: Array
    value: Array

    @cached_property
    def breaks(self) -> Array:
        """Where one polynomial ends and the next one starts, both ends included."""
        inner = self.position[3:-3] if len(self.position) > 6 else self.position[:0]
        return np.concatenate([self.position[:1], inner, self.position[-1:]])

    @cached_property
    def stretches(self) -> Array:
        """(stretches, 6) coefficients of powers of u, 0 <= u <= 1 between two breaks."""
        knots = np.concatenate([np.repeat(self.breaks[0], DEGREE), self.breaks, np.repeat(self.breaks[-1], DEGREE)])
        weights = self._weights(knots)
        u = (1 - np.cos(np.linspace(0.0, np.pi, DEGREE + 1))) / 2
        which = np.arange(len(self.breaks) - 1)
        places = self.breaks[which, None] + np.diff(self.breaks)[:, None] * u
        index = np.repeat(which, DEGREE + 1)
        basis = _basis(knots, index, places.ravel())
        columns = index[:, None] + np.arange(DEGREE + 1)
        values = np.sum(basis * weights[columns], axis=1).reshape(-1, DEGREE + 1)
        return np.linalg.solve(np.vander(u, increasing=True), values.T).T

    def _weights(self, knots: Array) -> Array:
        """The weight of each basis function, from the rows of the table."""
        count = len(self.position)
        index = self.stretch(self.position)
        rows = np.zeros((count, 2 * DEGREE + 1))
        first = index - np.arange(count) + DEGREE  # where the six columns of each row start, the diagonal at DEGREE
        rows[np.arange(count)[:, None], first[:, None] + np.arange(DEGREE + 1)] = _basis(knots, index, self.position)
        return _solved(rows, self.value.copy())

    def stretch(self, position: Array) -> NDArray[np.intp]:
        """The stretch in which each position lies; beyond the table the nearest."""
        found = np.searchsorted(self.breaks, position, side="right") - 1
        return np.clip(found, 0, len(self.breaks) - 2)

    def at(self, position: Array, derivative: int = 0) -> Array:
        """The value or the slope at positions of any shape."""
        k = self.stretch(position)
        width = self.breaks[k + 1] - self.breaks[k]
        u = (position - self.breaks[k]) / width
        rows, found = self.stretches[k], np.zeros_like(u)
        for power in range(DEGREE, derivative - 1, -1):
            found = found * u + (rows[..., power] * power / width if derivative else rows[..., power])
        return found

    def along(self, positions: Array, derivative: int = 0) -> Array:
        """Coefficients of the value or the slope as polynomials of s, where the positions (pieces, n) are polynomials
        of s that stay within one stretch each."""
        middle = positions @ (0.5 ** np.arange(positions.shape[1]))
        k = self.stretch(middle)
        width = self.breaks[k + 1] - self.breaks[k]
        u = positions / width[:, None]
        u[:, 0] -= self.breaks[k] / width
        found = np.zeros((len(k), 1))
        for power in range(DEGREE, derivative - 1, -1):
            column = self.stretches[k, power] * (power / width if derivative else 1.0)
            found = product(found, u)
            found[:, 0] += column
        return found


def _solved(rows: Array, found: Array) -> Array:
    """The solution of a banded system, without pivots, which a totally positive matrix does not need; the diagonal is
    column DEGREE of ``rows``. Changes both."""
    count = len(found)
    for k in range(count):
        for i in range(k + 1, min(k + DEGREE + 1, count)):
            share = rows[i, DEGREE - (i - k)] / rows[k, DEGREE]
            if share:
                rows[i, DEGREE - (i - k) : 2 * DEGREE + 1 - (i - k)] -= share * rows[k, DEGREE:]
                found[i] -= share * found[k]
    for k in range(count - 1, -1, -1):
        reach = min(DEGREE, count - 1 - k)
        known = rows[k, DEGREE + 1 : DEGREE + 1 + reach] @ found[k + 1 : k + 1 + reach]
        found[k] = (found[k] - known) / rows[k, DEGREE]
    return found


def _basis(knots: Array, index: NDArray[np.intp], x: Array) -> Array:
    """(len(x), 6) the basis functions that are not zero in the stretch ``index``, lowest first (Cox and de Boor)."""
    left = index + DEGREE
    found = np.zeros((len(x), DEGREE + 1))
    found[:, 0] = 1.0
    for degree in range(1, DEGREE + 1):
        saved = np.zeros(len(x))
        for j in range(degree):
            after, before = knots[left + j + 1], knots[left + j + 1 - degree]
            share = found[:, j] / (after - before)
            found[:, j] = saved + (after - x) * share
            saved = (x - before) * share
        found[:, degree] = saved
    return found
