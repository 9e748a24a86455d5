"""Costates for a sequence of arcs: multipliers of its conditions with which its switching function has its zeros.

Between its jumps costate i is a polynomial, w_i' = -w_(i-1), w_0 = 1; that of the top derivative is zero at a switch,
and on a plateau all above the limited derivative are. Where chattering was cut off not all of that can be had: then
it is had as nearly as possible, as a value of the switching function, so that the smallest arcs weigh least.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import factorial

import numpy as np

from trajopt.switching.chain import NAMES
from trajopt.switching.stationary import Condition, Vector

_HARD = 1e4  # weight: what would be missed on a plateau costs at once, what is missed at a switch only its square


def multipliers(
    order: int, active: Sequence[str], durations: Sequence[float], conditions: Sequence[Condition]
) -> tuple[float, ...]:
    """(M,) prices of the conditions, that of the position at the end being one; ``active``: (K,) limits of the arcs."""
    times = np.concatenate([[0.0], np.cumsum(durations)])
    goal = next(row for row, c in enumerate(conditions) if c.derivative == 0 and c.arcs == len(active))
    rows = [
        (_HARD if hard else 1.0) * _costate(i, border, times, conditions, left)
        for border, left, i, hard in _zeros(order, active)
    ]
    matrix = np.array(rows).reshape(-1, len(conditions))
    others = np.arange(len(conditions)) != goal
    sizes = np.max(np.abs(matrix), axis=0, initial=1e-300)[others]
    prices = np.ones(len(conditions))
    prices[others] = np.linalg.lstsq(matrix[:, others] / sizes, -matrix[:, goal], rcond=None)[0] / sizes
    return tuple(map(float, prices))


def _zeros(order: int, active: Sequence[str]) -> Iterator[tuple[int, bool, int, bool]]:
    """(border, whether left of it, costate, whether beside a plateau)."""
    kinds = [NAMES.index(name.partition(".")[0]) for name in active]
    for border, (before, after) in enumerate(zip(kinds, kinds[1:], strict=False), start=1):
        if before == after == order:
            if active[border - 1] != active[border]:
                yield border, True, order - 1, False
            continue
        for kind, left in ((before, False), (after, True)):
            if kind < order:
                yield from ((border, left, i, True) for i in range(min(kind + 1, order - 1), order))


def _costate(i: int, border: int, times: Vector, conditions: Sequence[Condition], left: bool) -> Vector:
    """(M,) what each price adds to costate i beside a border."""
    out = np.zeros(len(conditions))
    for row, c in enumerate(conditions):
        power = i - c.derivative
        if power >= 0 and (c.arcs > border or (left and c.arcs == border)):
            out[row] = (times[c.arcs] - times[border]) ** power / factorial(power)
    return out
