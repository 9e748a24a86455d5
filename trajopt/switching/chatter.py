"""Chattering at a velocity limit of a fourth-order chain: the self-similar approach, computed from its equations.

Near the limit V write y3 = V - v, y2 = -a, y1 = -j, all divided by the upward snap, so that y1' lies in
[-1, ratio] with ratio = downward / upward snap. From a touch (y1, y2, y3) = (1, 0, 0) the approach of least ∫ y3 dt
touches again at (alpha, 0, 0), (alpha², 0, 0), ... (Wang, Hu et al., "Chattering Phenomena in Time-Optimal Control for
High-Order Chain-of-Integrator Systems with Full State Constraints", theorem 4 and equation 16, there for ratio 1).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import ceil, log

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Chattering:
    """The self-similar approach for one ratio of downward to upward snap.

    ``alpha``: ratio of jerks at successive touches. ``switches``: b1, b2 and the third costate root b3, as shares of
    the time between two touches. ``period``: the first of these times from (1, 0, 0). ``cost``: ∫ y3 dt from there.
    ``greedy``: (3,) durations from (1, 0, 0) to rest at the limit with fewest switches; ``greedy_cost``: their ∫ y3 dt.
    """

    ratio: float
    alpha: float
    switches: tuple[float, float, float]
    period: float
    cost: float
    greedy: tuple[float, float, float]
    greedy_cost: float

    @property
    def arcs(self) -> tuple[float, float, float]:
        """Durations from the touch (1, 0, 0) to the next, snap upwards, downwards, upwards."""
        b1, b2, _ = self.switches
        return b1 * self.period, (b2 - b1) * self.period, (1 - b2) * self.period

    @property
    def limit_time(self) -> float:
        """From (1, 0, 0) until the limit is reached for good."""
        return self.period / (1 - self.alpha)


@dataclass(frozen=True)
class FirstArc:
    """The approach from (0, 0, 1), a rest one unit below the limit: (3,) durations to the first touch, y1 there, and
    the time and ∫ y3 dt of the whole."""

    durations: tuple[float, float, float]
    touch: float
    limit_time: float
    cost: float


@lru_cache(maxsize=64)
def chattering(ratio: float = 1.0) -> Chattering:
    """The constants by Newton's method, from those of ratio 1 by continuation.

    Raises ArithmeticError if Newton's method does not converge, which does not happen for ratios in [1e-3, 1e3].
    """
    x = newton(lambda x: _period_residual(x, 1.0), np.array([0.235, 0.47, 0.87, 1.03, 0.17]))
    steps = ceil(abs(log(ratio)) / 0.25)
    for i in range(1, steps + 1):
        here = ratio ** (i / steps)
        x = newton(lambda x, r=here: _period_residual(x, r), x)  # type: ignore[misc]
    a, b1, b2, b3, alpha = map(float, x)
    arcs = np.array([b1, b2 - b1, 1 - b2]) / a
    one = _cost(arcs, 1.0, ratio)
    greedy = newton(lambda d: _end(d, (1.0, 0.0, 0.0), ratio), arcs)
    return Chattering(
        ratio, alpha, (b1, b2, b3), 1 / a, one / (1 - alpha**4), _three(greedy), _cost(greedy, 1.0, ratio)
    )


@lru_cache(maxsize=64)
def first_arc(ratio: float = 1.0) -> FirstArc:
    """The approach from (0, 0, 1) by Newton's method: three arcs to the first touch, whose costate is the cubic that
    joins the self-similar one with continuous value and slope. Raises ArithmeticError for ratios below about 0.05."""
    own = chattering(ratio)
    b1, b2, b3 = own.switches
    value, slope = (c * own.period**k for c, k in ((-b1 * b2 * b3, 3), (b1 * b2 + b1 * b3 + b2 * b3, 2)))

    def residual(x: Vector) -> Vector:
        *d, y, curve = x
        states = _end(np.array(d), (0.0, 0.0, 1.0), ratio)
        cubics = [t**3 + curve * t**2 + slope * y**2 * t + value * y**3 for t in (-d[2], -d[2] - d[1])]
        return np.array([states[0] - y, states[1], states[2], *cubics])

    guess = np.array([0.8 * ratio**0.2, 1.6 / ratio**0.6, 0.63, 0.18, 2.8])
    *d, y, _ = newton(residual, guess)
    durations = _three(np.array(d))
    cost = _cost(np.array(d), 0.0, ratio, 1.0) + own.cost * y**4
    return FirstArc(durations, float(y), sum(durations) + own.limit_time * float(y), float(cost))


def newton(function: Callable[[Vector], Vector], x: Vector) -> Vector:
    """Root of a smooth square system by Newton's method with complex-step derivatives."""
    size = len(x)
    for _ in range(60):
        value = function(x)
        slope = np.array([function(x + 1e-30j * e).imag / 1e-30 for e in np.eye(size)]).T
        step = np.linalg.solve(slope, value)
        x = x - step * min(1.0, 0.3 / max(float(np.max(np.abs(step / x))), 1e-300))
        if np.max(np.abs(step / x)) < 1e-15:
            return x
    if np.max(np.abs(step / x)) < 1e-12:
        return x
    raise ArithmeticError("Newton's method for the chattering constants did not converge")


def _period_residual(x: Vector, ratio: float) -> Vector:
    a, b1, b2, b3, alpha = x
    states = _end(np.array([b1, b2 - b1, 1 - b2]), (a, 0 * a, 0 * a), ratio)
    start, end = -b1 * b2 * b3, (1 - b1) * (1 - b2) * (1 - b3)
    slopes = b1 * b2 + b1 * b3 + b2 * b3, (1 - b1) * (1 - b2) + (1 - b1) * (1 - b3) + (1 - b2) * (1 - b3)
    # alpha = 1 and -1 are roots too: the guess and the limited steps keep away from them
    return np.array(
        [states[0] - alpha * a, states[1], states[2], end - alpha**3 * start, slopes[1] - alpha**2 * slopes[0]]
    )


def _end(durations: Vector, start: tuple[float, float, float], ratio: float) -> Vector:
    """(y1, y2, y3) after three arcs with y1' = -1, ratio, -1."""
    y1, y2, y3 = start
    for rate, d in zip((-1.0, ratio, -1.0), durations, strict=True):
        y1, y2, y3 = (
            y1 + rate * d,
            y2 + y1 * d + rate * d**2 / 2,
            y3 + y2 * d + y1 * d**2 / 2 + rate * d**3 / 6,
        )
    return np.array([y1, y2, y3])


def _cost(durations: Vector, y1: float, ratio: float, y3: float = 0.0) -> float:
    """∫ y3 dt over three arcs from (y1, 0, y3)."""
    t1, t2, t3 = durations
    total = t1 + t2 + t3
    jumps = (1 + ratio) * ((t2 + t3) ** 4 - t3**4) / 24
    return float(y3 * total + y1 * total**3 / 6 - total**4 / 24 + jumps)


def _three(values: Vector) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
