"""Switching times of least duration for a given sequence of arcs: Newton's method on the first-order conditions.

A sequence of arcs with constant top derivative meets conditions "derivative m at border i is b". Among all border times
that do, those of least duration are stationary: the gradient of the duration is a combination of the conditions'. All
derivatives are closed form, since a state is a sum of powers of the time since each change of the top derivative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trajopt.switching.chain import State

Vector = npt.NDArray[np.float64]

_STEPS = 60
_FAR = 1e3  # times the duration guessed: no sequence near it
_SETTLED, _NOISE = 1e-13, 1e-9  # relative: steps of the times
_FACTORIALS = np.array([1.0, 1.0, 2.0, 6.0, 24.0])


@dataclass(frozen=True)
class Condition:
    """Derivative ``derivative`` has ``value`` after ``arcs`` arcs."""

    arcs: int
    derivative: int
    value: float


@dataclass(frozen=True)
class Stationary:
    """``durations``: (K,) of the arcs; ``prices``: (M,) multipliers: duration per unit of each condition's value, with
    the sign of an increase."""

    durations: tuple[float, ...]
    prices: tuple[float, ...]


def shortest_sequence(
    start: State, tops: Sequence[float], conditions: Sequence[Condition], guess: Sequence[float]
) -> Stationary | None:
    """The stationary durations near a guess, or None if Newton's method leaves positive durations or does not settle.

    With as many conditions as arcs this is the plain root. All numbers are expected of order one.
    """
    system = _System(np.array(start), np.array(tops), conditions)
    times = np.cumsum(guess)
    prices = -_prices(system, times)
    size = len(times)
    matrix = np.zeros((size + len(prices), size + len(prices)))
    moved = np.inf
    for _ in range(_STEPS):
        value, slope, bend = system.evaluate(times, prices)
        gradient: Vector = system.duration + slope.T @ prices
        matrix[:size, :size], matrix[:size, size:], matrix[size:, :size] = bend, slope.T, slope
        try:
            step = np.linalg.solve(matrix, -np.concatenate([gradient, value]))
        except np.linalg.LinAlgError:
            return None
        change = np.diff(step[:size], prepend=0.0)
        durations = np.diff(times, prepend=0.0)
        shrinking = change < 0
        share = min(1.0, 0.8 * float(np.min(durations[shrinking] / -change[shrinking], initial=np.inf)))
        if not share >= 1e-8:
            return None
        times = times + share * step[:size]
        prices = prices + share * step[size:]
        if not times[-1] < _FAR * sum(guess):
            return None
        before, moved = moved, float(np.max(np.abs(step[:size]))) / times[-1]
        # where rounding sets in, steps stop shrinking
        if share == 1.0 and (moved < _SETTLED or (moved < _NOISE and moved > before / 2)):
            return Stationary(tuple(map(float, np.diff(times, prepend=0.0))), tuple(map(float, -prices)))
    return None


def prices_of(
    start: State, tops: Sequence[float], conditions: Sequence[Condition], durations: Sequence[float]
) -> tuple[float, ...]:
    """The multipliers that come nearest to making given durations stationary."""
    system = _System(np.array(start), np.array(tops), conditions)
    return tuple(map(float, _prices(system, np.cumsum(durations))))


def _prices(system: _System, times: Vector) -> Vector:
    _, slope, _ = system.evaluate(times, np.zeros(len(system.last)))
    return np.asarray(np.linalg.lstsq(slope.T, system.duration, rcond=None)[0], dtype=np.float64)


class _System:
    def __init__(self, start: Vector, tops: Vector, conditions: Sequence[Condition]) -> None:
        self.jumps = np.diff(tops, prepend=0.0)
        self.arcs = len(tops)
        self.duration = np.zeros(self.arcs)
        self.duration[-1] = 1.0
        self.last = np.array([c.arcs - 1 for c in conditions])
        self.before = np.arange(self.arcs) <= self.last[:, None]
        self.inner = np.arange(self.arcs) < self.last[:, None]
        order = len(start)
        self.powers = np.array([order - c.derivative for c in conditions])
        self.values = np.array([c.value for c in conditions])
        # what the start state alone gives, and its first two derivatives: rows of Taylor coefficients
        self.free = np.zeros((3, len(conditions), order))
        for row, c in enumerate(conditions):
            for shift in range(3):
                taylor = start[c.derivative + shift :]
                self.free[shift, row, : len(taylor)] = taylor / _FACTORIALS[: len(taylor)]

    def evaluate(self, times: Vector, prices: Vector) -> tuple[Vector, Vector, Vector]:
        """Conditions (M,), their gradients (M, K) by border times, and the (K, K) Hessian of prices @ conditions."""
        rows, here = np.arange(len(self.last)), times[self.last]
        since = np.where(self.before, here[:, None] - np.concatenate([[0.0], times[:-1]]), 0.0)
        table = np.empty((6, *since.shape))  # jumps * since**k / k!, k = -1 .. 4, zero for k = -1
        table[0] = 0.0
        table[1] = np.where(self.before, self.jumps, 0.0)
        for k in range(1, 5):
            table[k + 1] = table[k] * since / k
        now, first, second = (table[self.powers + shift, rows] for shift in (1, 0, -1))
        free = np.sum(self.free * here[:, None] ** np.arange(self.free.shape[2]), axis=2)
        value = now.sum(axis=1) + free[0] - self.values
        slope = np.zeros_like(since)
        # border i is the start of arc i + 1
        slope[:, :-1] = -first[:, 1:] * self.inner[:, :-1]
        slope[rows, self.last] += first.sum(axis=1) + free[1]
        second = np.where(self.powers[:, None] >= 2, second, 0.0)
        curved = prices[:, None] * second[:, 1:] * self.inner[:, :-1]
        bend = np.zeros((self.arcs, self.arcs))
        span = np.arange(self.arcs - 1)
        bend[span, span] = curved.sum(axis=0)
        cross = np.zeros_like(bend)
        np.add.at(cross, self.last, np.pad(curved, ((0, 0), (0, 1))))
        bend -= cross + cross.T
        np.add.at(bend, (self.last, self.last), prices * (second.sum(axis=1) + free[2]))
        return value, slope, bend
