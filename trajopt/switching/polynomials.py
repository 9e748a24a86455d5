"""Arcs of constant top derivative as exact polynomials: states, extremes, and the verdict on a list of arcs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite, sqrt

import numpy as np

from trajopt.switching.chain import NAMES, Chain, State

TOLERANCE = 1e-9  # relative: residual at the end, and excess over a limit


@dataclass(frozen=True)
class Audit:
    """``residual``: the largest relative error at the end. ``excess``: the largest relative excess over a limit, and
    ``worst`` the limit concerned. Relative to the largest value of the derivative on the way, and the limit."""

    residual: float
    excess: float
    worst: str

    @property
    def accepted(self) -> bool:
        return self.residual < TOLERANCE and self.excess < TOLERANCE


def value(state: State, top: float, time: float, derivative: int) -> float:
    """A derivative after a time of an arc."""
    n, found = len(state), top
    for k in range(n - 1, derivative - 1, -1):
        found = state[k] + found * time / (k + 1 - derivative)
    return found


def advance(state: State, top: float, duration: float) -> State:
    """The state after an arc."""
    return tuple(value(state, top, duration, i) for i in range(len(state)))


def states(start: State, tops: Sequence[float], durations: Sequence[float]) -> list[State]:
    """(K+1) states at the borders of the arcs."""
    out = [start]
    for top, duration in zip(tops, durations, strict=True):
        out.append(advance(out[-1], top, duration))
    return out


def instants(state: State, top: float, duration: float, derivative: int) -> list[float]:
    """Times inside an arc where a derivative is zero, that is where the one below has its extremes."""
    coefficients = (*state, top)[derivative:]
    if len(coefficients) == 1:
        return []
    found = real_roots(coefficients)
    return [t for t in found if 0 < t < duration]


def extremes(state: State, top: float, duration: float, derivative: int) -> tuple[float, float]:
    """(least, greatest) value of a derivative over an arc."""
    times = [duration, *instants(state, top, duration, derivative + 1)]
    values = [state[derivative], *(value(state, top, t, derivative) for t in times)]
    return min(values), max(values)


def audit(chain: Chain, tops: Sequence[float], durations: Sequence[float]) -> Audit:
    """Re-evaluate the polynomials of a list of arcs: the end, and the limits everywhere between."""
    if any(not d >= 0 for d in durations) or not all(map(isfinite, (*durations, *tops))):
        return Audit(inf, inf, "duration")
    start = (0.0, *chain.start[1:])
    borders = states(start, tops, durations)
    goal = (chain.distance, *chain.end[1:])
    origin = chain.start[0]
    limits = [(low - origin, high - origin) if i == 0 else (low, high) for i, (low, high) in enumerate(chain.limits)]
    residual, excess, worst = 0.0, 0.0, ""
    for i in range(chain.order):
        low, high = limits[i]
        seen = (
            [extremes(x, u, d, i) for x, u, d in zip(borders[:-1], tops, durations, strict=True)]
            if i or isfinite(low) or isfinite(high)
            else []
        )
        seen.append((min(start[i], goal[i]), max(start[i], goal[i])))
        least, greatest = min(a for a, _ in seen), max(b for _, b in seen)
        size = max(abs(least), abs(greatest), *(abs(x[i]) for x in borders))
        error = abs(borders[-1][i] - goal[i])
        residual = max(residual, error / size if error else 0.0)
        for over, limit, side in ((greatest - high, high, "max"), (low - least, low, "min")):
            if over > 0 and over / max(size, abs(limit)) > excess:
                excess, worst = over / max(size, abs(limit)), f"{NAMES[i]}.{side}"
    low, high = chain.top
    for u in tops:
        over = max(u - high, low - u) / max(high, -low)
        if over > excess:
            excess, worst = over, NAMES[chain.order]
    return Audit(residual, excess, worst)


def real_roots(c: Sequence[float]) -> list[float]:
    """Real roots of sum c_k t^k / k!, up to the fourth degree."""
    if len(c) == 2:
        return [-c[0] / c[1]] if c[1] else []
    if len(c) == 3:
        return _quadratic(c[2] / 2, c[1], c[0])
    scaled = [x / f for x, f in zip(c, (1.0, 1.0, 2.0, 6.0, 24.0), strict=False)]
    found = np.roots(np.trim_zeros(scaled[::-1], "f")) if any(scaled[1:]) else np.array([])
    # a real double root may come out as a complex pair: its real part is where the extreme lies
    return [float(z.real) for z in found if abs(z.imag) <= 1e-6 * abs(z)]


def _quadratic(a: float, b: float, c: float) -> list[float]:
    """Real roots of a t² + b t + c without cancellation."""
    if a == 0:
        return [-c / b] if b else []
    under = b * b - 4 * a * c
    if under < 0:
        return []
    q = -(b + (sqrt(under) if b >= 0 else -sqrt(under))) / 2
    return [q / a, *([c / q] if q else [])]
