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


def shortest_sequence(
    start: State, tops: Sequence[float], conditions: Sequence[Condition], guess: Sequence[float], local: bool = True
) -> tuple[float, ...] | None:
    """The stationary durations near a guess, or None if Newton's method leaves positive durations or does not settle.

    ``local``: see the system; which of the two converges from farther away depends on the sequence. With as many
    conditions as arcs this is the plain root. All numbers are expected of order one.
    """
    system = _System(np.array(start), np.array(tops), conditions, local)
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
            return tuple(map(float, np.diff(times, prepend=0.0)))
    return None


def prices_of(
    start: State, tops: Sequence[float], conditions: Sequence[Condition], durations: Sequence[float]
) -> tuple[float, ...]:
    """The multipliers that come nearest to making given durations stationary: duration per unit of each condition's
    value, with the sign of an increase."""
    system, times = _System(np.array(start), np.array(tops), conditions, True), np.cumsum(durations)
    prices = _prices(system, times)
    # a condition computed from another border counts there too
    borders = np.concatenate([[0.0], times])
    known = {(c.arcs, c.derivative): row for row, c in enumerate(conditions)}
    total = prices.copy()
    for row, c in enumerate(conditions):
        base = int(system.base[row])
        for power in range(len(start) - c.derivative if base else 0):
            since = borders[c.arcs] - borders[base]
            total[known[base, c.derivative + power]] -= prices[row] * since**power / _FACTORIALS[power]
    return tuple(map(float, total))


def _prices(system: _System, times: Vector) -> Vector:
    _, slope, _ = system.evaluate(times, np.zeros(len(system.border)))
    # conditions and borders differ by powers of the shortest arc: both are scaled to one
    of_condition = _inverse(np.max(np.abs(slope), axis=1))
    of_border = _inverse(np.max(np.abs(slope * of_condition[:, None]), axis=0))
    matrix = (slope * of_condition[:, None] * of_border).T
    solution = np.linalg.lstsq(matrix, system.duration * of_border, rcond=None)[0]
    return np.asarray(solution * of_condition, dtype=np.float64)


def _inverse(sizes: Vector) -> Vector:
    return 1 / np.where(sizes > 0, sizes, 1.0)


class _System:
    """The conditions as functions of the border times, border 0 being the start.

    A condition is computed from the nearest border where its derivative and all above are known, be it the start of
    the move, that of a plateau before it, or that of the next plateau, backwards; ``local`` false: always from the
    start of the move. Seen from there the top derivative is a sum of jumps at the borders between.
    """

    def __init__(self, start: Vector, tops: Vector, conditions: Sequence[Condition], local: bool) -> None:
        order, self.arcs, rows = len(start), len(tops), len(conditions)
        self.duration = np.zeros(self.arcs)
        self.duration[-1] = 1.0
        self.border = np.array([c.arcs for c in conditions])
        self.powers = np.array([order - c.derivative for c in conditions])
        self.values = np.array([c.value for c in conditions])
        known = _known(start, conditions) if local else {0: start}
        self.base = np.array([_base(known, c) for c in conditions])
        self.jumps = np.zeros((rows, self.arcs + 1))
        # what the known state alone gives, and its first two derivatives: rows of Taylor coefficients
        self.free = np.zeros((3, rows, order))
        for row, c in enumerate(conditions):
            base = int(self.base[row])
            ahead = base < c.arcs
            between = slice(base, c.arcs) if ahead else slice(c.arcs, base)
            jumps = np.diff(tops[between], prepend=0.0) if ahead else -np.diff(tops[between], append=0.0)
            self.jumps[row, (base if ahead else c.arcs + 1) :][: len(jumps)] = jumps
            for shift in range(3):
                taylor = known[base][c.derivative + shift :]
                self.free[shift, row, : len(taylor)] = taylor / _FACTORIALS[: len(taylor)]

    def evaluate(self, times: Vector, prices: Vector) -> tuple[Vector, Vector, Vector]:
        """Conditions (M,), their gradients (M, K) by border times, and the (K, K) Hessian of prices @ conditions."""
        rows, borders = np.arange(len(self.border)), np.concatenate([[0.0], times])
        since = borders[self.border][:, None] - borders
        table = np.zeros((6, *since.shape))  # jumps * since**k / k!, k = -1 .. 4, zero for k = -1
        table[1] = self.jumps
        for k in range(1, 5):
            table[k + 1] = table[k] * since / k
        now, first, second = (table[self.powers + shift, rows] for shift in (1, 0, -1))
        second[self.powers < 2] = 0.0
        free = np.sum(self.free * since[rows, self.base][:, None] ** np.arange(self.free.shape[2]), axis=2)
        for part, known in zip((now, first, second), free, strict=True):
            part[rows, self.base] += known
        slope = -first
        slope[rows, self.border] += first.sum(axis=1)
        curved = prices[:, None] * second
        cross = np.zeros((self.arcs + 1, self.arcs + 1))
        np.add.at(cross, self.border, curved)
        bend = np.diag(curved.sum(axis=0)) - cross - cross.T
        np.add.at(bend, (self.border, self.border), curved.sum(axis=1))
        return now.sum(axis=1) - self.values, slope[:, 1:], bend[1:, 1:]


def _known(start: Vector, conditions: Sequence[Condition]) -> dict[int, Vector]:
    """States by the number of arcs before them, not a number where a derivative is not prescribed there."""
    known = {0: start}
    for c in conditions:
        known.setdefault(c.arcs, np.full(len(start), np.nan))[c.derivative] = c.value
    return known


def _base(known: dict[int, Vector], condition: Condition) -> int:
    """The border from which a condition is computed: the last one where enough is known, or for a border where the
    whole state is not, the next one if that is fewer arcs away."""
    enough = [b for b, state in known.items() if not np.isnan(state[condition.derivative :]).any()]
    before = max(b for b in enough if b < condition.arcs)
    after = min((b for b in enough if b > condition.arcs), default=np.inf)
    return int(after) if condition.arcs not in enough and after - condition.arcs < condition.arcs - before else before
