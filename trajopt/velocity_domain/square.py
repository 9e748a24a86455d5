"""Least ∫P² dt of a mass moved from rest to rest, P = m a v, under limits of speed, acceleration and jerk.

Over speed the cost of a ramp is ∫m² v² sqrt(2y) dv. With κ the price of distance and none for time at the peak speed V,
its integrand with prices is least at y0 = κ (V - v)/(2 m² v²). The ramp follows y0 as far as |dy/dv| <= J and y <= A²/2
let it; before, it rises with slope J and falls with slope -J. Where the fall begins follows from Pontryagin's
principle: over it the derivative of the integrand by y has integral zero.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from math import acos, asinh, cos, exp, inf, isfinite, log, sinh, sqrt

import numpy as np
from scipy.optimize import brentq

from trajopt.velocity_domain.axis import Axis, Ramp, between, pieces
from trajopt.velocity_domain.motor import Floats
from trajopt.velocity_domain.power import least_peak, rising_root
from trajopt.velocity_domain.roots import common_root


@dataclass(frozen=True)
class SquareOptimum:
    """The least ∫P² dt, W² s, with the peak speed (m/s), the energy (J) and the ramps of the move that has it."""

    value: float
    peak: float
    energy: float
    ramps: tuple[Ramp, Ramp] = field(repr=False, compare=False)


def least_square_power(axis: Axis) -> SquareOptimum:
    """The least ∫(m a v)² dt. Raises ValueError for a duration below the least, which it names."""
    low = least_peak(axis)

    def surplus(peak: float) -> float:
        return sum(ramp.shape.extent[0] for ramp in _priced(axis, peak)) - axis.duration

    ramps = _at_once(axis, low) or _priced(axis, rising_root(surplus, low * (1 + 1e-9), axis.velocity))
    peak, (up, down) = ramps[0].peak, ramps
    return SquareOptimum(up.cost() + down.cost(), peak, axis.mass * peak**2, (up.shape, down.shape))


def _at_once(axis: Axis, low: float) -> list[_Ramp]:
    """The two ramps without a stay, by peak speed and price at once; empty where that finds nothing."""
    mean = axis.distance / axis.duration
    natural = axis.mass**2 * mean**3 / axis.duration**2

    def misses(x: float, z: float) -> tuple[float, float]:
        if not (low < x * mean < axis.velocity and abs(z) < 60):
            return inf, inf
        times, lags = zip(*(ramp.shape.extent for ramp in _ramps(axis, x * mean, natural * exp(z))), strict=True)
        return sum(times) / axis.duration - 1, sum(lags) / (axis.distance * (x - 1)) - 1

    found = common_root(misses, (1.4, 3.0))
    return [] if found is None else _ramps(axis, float(found[0]) * mean, natural * exp(found[1]))


def _ramps(axis: Axis, peak: float, price: float) -> list[_Ramp]:
    up, down = axis.ramps
    first = _Ramp(axis.mass, axis.jerk, up, peak, price)
    return [first, first if down == up else replace(first, acceleration=down)]


def _priced(axis: Axis, peak: float) -> list[_Ramp]:
    """The two ramps to a peak speed with which, and with a stay there, the end is reached in time."""
    target = peak * axis.duration - axis.distance

    def excess(z: float) -> float:
        return log(sum(ramp.shape.extent[1] for ramp in _ramps(axis, peak, exp(z))) / target)

    low = high = log(axis.mass**2 * peak**3 / axis.duration**2)
    while excess(high) > 0 and high < low + 60:
        high += 2
    while excess(low) < 0:
        low -= 2
    z = high if excess(high) > 0 else float(brentq(excess, low, high, xtol=1e-14, rtol=1e-14))
    return _ramps(axis, peak, exp(z))


def _cubic_root(c: float, r: float) -> float:
    """The one root of v³ + c v = r, for positive c and r."""
    size = sqrt(c / 3)
    v = 2 * size * sinh(asinh(r / (2 * size**3)) / 3)
    return v - (v**3 + c * v - r) / (3 * v**2 + c)


def _largest_root(t: float, c: float, r: float, low: float) -> float:
    """The largest root of v³ - t v² - c v + r, between ``low`` and t, polished where it is nearly double."""
    p, q = t**2 / 3 + c, r - t * c / 3 - 2 * t**3 / 27
    v = t / 3 + 2 * sqrt(p / 3) * cos(acos(min(max(-1.5 * q / p * sqrt(3 / p), -1.0), 1.0)) / 3)
    for _ in range(3):
        slope = (3 * v - 2 * t) * v - c
        v -= (((v - t) * v - c) * v + r) / slope if slope > 0 else 0.0
    return min(max(v, low), t)


@dataclass(frozen=True)
class _Ramp:
    """A ramp under a price of distance."""

    mass: float
    jerk: float
    acceleration: float
    peak: float
    price: float

    @cached_property
    def shape(self) -> Ramp:
        """y over speed."""
        turn, join = self._fall
        return Ramp(lambda v, below: self._height(v, below, turn, join), self._edges(turn, join), self.peak)

    def cost(self) -> float:
        """∫P² dt, W² s."""
        v, below, weight = between(*pieces(self.shape.edges), self.peak)
        return float(np.sum(weight * (self.mass**2 * v**2 * np.sqrt(2 * self.shape.height(v, below)))))

    @property
    def _share(self) -> float:
        """c = κ/(2 m² J)."""
        return self.price / (2 * self.mass**2 * self.jerk)

    def _free(self, v: float) -> float:
        """y0."""
        return self.price * (self.peak - v) / (2 * self.mass**2 * v**2)

    def _height(self, v: Floats, below: Floats, turn: float, join: float) -> Floats:
        free = self.price * below / (2 * self.mass**2 * v**2)
        if not isfinite(self.jerk):
            return np.minimum(free, self.acceleration**2 / 2)
        falling = np.where(v < join, self.jerk * (below + (turn - self.peak)), free)
        return np.minimum(np.minimum(self.jerk * v, self.acceleration**2 / 2), falling)

    def _edges(self, turn: float, join: float) -> list[float]:
        found = [turn / 2, join, self._level()]
        if isfinite(self.jerk):
            rise = self.acceleration**2 / (2 * self.jerk)
            found += [rise, turn - rise]
        return [0.0, *sorted({v for v in found if 0 < v < self.peak}), self.peak]

    def _level(self) -> float:
        """The speed at which y0 passes the limit of acceleration; 0 without one."""
        if not isfinite(self.acceleration):
            return 0.0
        share = self.price / (self.mass * self.acceleration) ** 2
        return 2 * self.peak / (1 + sqrt(1 + 4 * self.peak / share))

    @cached_property
    def _fall(self) -> tuple[float, float]:
        """The line y = J (turn - v) of the fall: ``turn``, and the speed at which it ends on y0."""
        if not isfinite(self.jerk):
            return 0.0, 0.0
        steep = self._steep()
        crossing = max(self._level(), self._meeting())
        if crossing >= steep:
            return crossing + self._free(crossing) / self.jerk, crossing
        low = steep + self._free(steep) / self.jerk
        high = min(crossing + self._free(crossing) / self.jerk, self.peak)
        if low >= high or self._balance(high, steep) <= 0:
            return high, self._joined(high, steep)
        turn = float(brentq(lambda c: self._balance(c, steep), low, high, xtol=1e-15 * self.peak, rtol=1e-14))
        return turn, self._joined(turn, steep)

    def _steep(self) -> float:
        """The speed below which y0 falls faster than J: v³ + c v = 2 c V."""
        return min(_cubic_root(self._share, 2 * self._share * self.peak), self.peak)

    def _meeting(self) -> float:
        """The speed at which the rise y = J v meets y0: v³ + c v = c V."""
        return min(_cubic_root(self._share, self._share * self.peak), self.peak)

    def _joined(self, turn: float, steep: float) -> float:
        """Where the fall meets y0 for the second time; the peak if it does not."""

        if turn >= self.peak or self.jerk * (turn - steep) <= self._free(steep):
            return self.peak if turn >= self.peak else steep
        return _largest_root(turn, self._share, self._share * self.peak, steep)

    def _balance(self, turn: float, steep: float) -> float:
        """∫∂/∂y of the integrand over the fall."""
        start = max(turn / 2, turn - self.acceleration**2 / (2 * self.jerk))
        v, below, weight = between(start, self._joined(turn, steep), self.peak)
        y = self.jerk * (turn - v)
        return float(weight @ ((self.mass**2 * v**2 - self.price * below / (2 * y)) / np.sqrt(2 * y)))
