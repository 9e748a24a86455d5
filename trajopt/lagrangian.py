"""The Lagrangian of a program that has been solved, on floats: a model like others, whose variables have their values
and whose rows their multipliers. Its slope in a parameter of the program is the price of that parameter."""

from __future__ import annotations

from typing import Any

import numpy as np

from trajopt.model import Floats, Pair
from trajopt.signals import OnFloats, Smoothed


class Lagrangian(Smoothed, OnFloats):
    """``value`` is complete when a transcription has asked for the same variables and rows as the one that was solved,
    in the same order. Bounds of variables do not count: they hang on nothing but the limits."""

    def __init__(self, pair: Pair, convex: bool) -> None:
        self.convex, self.value = convex, 0.0
        self._primal, self._dual = _Tape(pair.primal), _Tape(pair.dual)

    def vector(
        self, count: int, size: float, lower: Floats, upper: Floats, name: str = "", at: Any = None, origin: float = 0.0
    ) -> Any:
        return size * self.variable(count)

    def variable(self, count: int) -> Floats:
        return self._primal.take(count)

    def zero(self, residual: Any, size: float = 1.0) -> None:
        rows = np.atleast_1d(residual)
        self.value += float(self._dual.take(len(rows)) @ rows) / size

    def nonpositive(self, residual: Any, size: float = 1.0, name: str = "", at: Any = None, own: Any = None) -> None:
        self.zero(residual, size)

    def magnitude(self, x: Any) -> Any:
        bound = self.variable(len(x))
        self.nonpositive(x - bound)
        self.nonpositive(-x - bound)
        return bound

    def total(self, weights: Floats, x: Any) -> Any:
        return weights @ np.broadcast_to(x, len(weights))

    def at_least_length(self, bound: Any, x: Any, weights: Floats) -> None:
        if not self.convex:  # it has squares in the place of a cone
            self.nonpositive(-bound)
            self.nonpositive(self.total(np.square(weights), np.square(x)) - bound**2)
            return
        self.zero(-np.concatenate([np.atleast_1d(bound), x * weights]))

    def minimize(self, value: Any) -> None:
        self.value += float(np.sum(value))


class _Tape:
    """Floats that are taken one after another."""

    def __init__(self, values: Floats) -> None:
        self._values, self._next = values, 0

    def take(self, count: int) -> Floats:
        self._next += count
        return self._values[self._next - count : self._next]
