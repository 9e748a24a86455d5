"""A mass moved from rest to rest under a jerk limit, over speed: y(v) = a²/2 has |dy/dv| = |j|.

Between rest and the peak speed y starts and ends at zero, rises and falls by at most J per unit of speed, and lies
below A²/2 and, for a power limit P, below P²/(2 m² v²). The largest such y, at every speed, makes each ramp as short
and as long-reaching as it can be; whatever a move does, its ramps lie below it. That proves the minima of ``power``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from math import inf, isfinite, sqrt
from typing import Any, Final

import numpy as np

from trajopt.velocity_domain.motor import Floats

_NODES: Final = 48
_STEPS: Final = 64  # of a piece of a ramp over time


@dataclass(frozen=True)
class Axis:
    """A mass (kg), its stroke (m, > 0) and the duration (s), with limits of speed, acceleration, deceleration (None: as
    the acceleration) and jerk, SI. Speed is never negative; the acceleration is zero at both ends under a jerk limit.

    Raises ValueError for values that are not positive.
    """

    mass: float
    distance: float
    duration: float
    velocity: float = inf
    acceleration: float = inf
    deceleration: float | None = None
    jerk: float = inf

    def __post_init__(self) -> None:
        for name in ("mass", "distance", "duration"):
            if not (isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"the {name} must be positive and finite: one-way moves forwards, from rest to rest")
        for name in ("velocity", "acceleration", "deceleration", "jerk"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise ValueError(f"the limit of {name} must be positive, not {value:g}")

    @property
    def ramps(self) -> tuple[float, float]:
        """The limits of acceleration on the way up and on the way down."""
        return self.acceleration, self.acceleration if self.deceleration is None else self.deceleration

    def quickest(self, peak: float, power: float = inf) -> tuple[float, float]:
        """(time, ∫(peak - v) dt) of the shortest way up to a peak speed and down again within a power limit."""
        if peak == 0:
            return 0.0, 0.0
        first, last = self.shortest(peak, power)
        (time, lag), (more, further) = first.extent, last.extent
        return time + more, lag + further

    def shortest(self, peak: float, power: float = inf) -> tuple[Ramp, Ramp]:
        """That way up, and that way down."""
        up, down = self.ramps
        first = self._ramp(peak, power, up)
        return first, first if down == up else self._ramp(peak, power, down)

    def _ramp(self, peak: float, power: float, acceleration: float) -> Ramp:
        steep, cap = self.jerk, (power / self.mass) ** 2 / 2
        tangent = (2 * cap / steep) ** (1 / 3) if isfinite(cap) and isfinite(steep) else 0.0

        def height(v: Floats, below: Floats) -> Floats:
            """y: the cap is left along its tangent of slope -J, where it is steeper."""
            capped = np.where(v < tangent, steep * (1.5 * tangent - v), cap / v**2) if isfinite(cap) else inf
            sides = np.minimum(v, below) * steep if isfinite(steep) else inf
            return np.minimum(np.minimum(capped, sides), acceleration**2 / 2) + 0 * v

        return Ramp(height, self._edges(peak, cap, tangent, acceleration), peak)

    def _edges(self, peak: float, cap: float, tangent: float, acceleration: float) -> list[float]:
        """Every speed at which one bound of y may take over from another."""
        found = [peak / 2, tangent, 0.75 * tangent]
        if isfinite(acceleration):
            rise = acceleration**2 / (2 * self.jerk)
            found += [rise, peak - rise, 1.5 * tangent - rise, sqrt(2 * cap) / acceleration]
        if isfinite(cap) and isfinite(self.jerk):
            roots = np.roots([-self.jerk, self.jerk * peak, 0.0, -cap])
            found += [float(r.real) for r in roots if abs(r.imag) < 1e-9 * peak]
        return [0.0, *sorted(v for v in found if 0 < v < peak), peak]


@dataclass(frozen=True)
class Ramp:
    """From rest to a peak speed (m/s), or back: y = ``height``(v, peak - v), m²/s⁴, over the speed v, smooth between
    ``edges`` (m/s)."""

    height: Callable[[Floats, Floats], Floats]
    edges: list[float]
    peak: float

    @cached_property
    def extent(self) -> tuple[float, float]:
        """(time, ∫(peak - v) dt), s and m."""
        v, below, weight = between(*pieces(self.edges), self.peak)
        pace = weight / np.sqrt(2 * self.height(v, below))
        return float(pace.sum()), float(np.sum(pace * below))

    def over_time(self) -> tuple[Floats, Floats, Floats]:
        """(n,) times since rest (s), speeds (m/s) and accelerations (m/s²), so close that lines join them."""
        low, high = pieces(self.edges)
        middle = (np.arange(_STEPS) + 0.5) / _STEPS
        share = middle**2 * (3 - 2 * middle)
        v, below = low + (high - low) * share, (self.peak - high) + (high - low) * (1 - share)
        a = np.sqrt(2 * self.height(v, below)).ravel()
        pace = ((high - low) * 6 * middle * (1 - middle) / _STEPS).ravel() / a
        return np.cumsum(pace) - pace / 2, v.ravel(), a


def over_time(ramps: tuple[Ramp, Ramp], duration: float, times: Floats) -> tuple[Floats, Floats]:
    """(n,) speeds (m/s) and accelerations (m/s²), at ``times`` (n,) within the duration (s), of the move up the first
    ramp and, after a stay at the peak speed, down the second one: interpolated, to 1e-3 or so."""
    (up, v, a), (down, w, b) = (ramp.over_time() for ramp in ramps)
    first = ramps[0].extent[0]
    last = max(duration - ramps[1].extent[0], first)
    time = np.concatenate([[0.0], up, [first, last], duration - down[::-1], [duration]])
    peak = [ramps[0].peak] * 2
    speed = np.interp(times, time, np.concatenate([[0.0], v, peak, w[::-1], [0.0]]))
    return speed, np.interp(times, time, np.concatenate([a[:1], a, [0.0, 0.0], -b[::-1], -b[:1]]))


def pieces(edges: list[float]) -> tuple[Floats, Floats]:
    """(k, 1) lower and upper ends of what lies between edges."""
    ends = np.array(edges)[:, None]
    return ends[:-1], ends[1:]


def between(low: Any, high: Any, peak: float) -> tuple[Floats, Floats, Floats]:
    """(n,) speeds, peak - speed, and weights of a quadrature that tolerates square roots at both ends; (k, n) of (k, 1)
    ends."""
    share, weight = _rule()
    return low + (high - low) * share, (peak - high) + (high - low) * share[::-1], (high - low) * weight


@cache
def _rule() -> tuple[Floats, Floats]:
    x, w = np.polynomial.legendre.leggauss(_NODES)
    s = (1 + x) / 2
    return s**2 * (3 - 2 * s), 3 * s * (1 - s) * w
