"""Least time, energy and peak power of a mass moved from rest to rest, and the front of the last two: global minima.

A move up to a peak speed v takes the energy m v² (∫|m a v| dt). With the quickest ramps a peak speed v reaches
v T - ∫(v - speed) dt in the duration T; moves that reach farther than the stroke can be slowed to it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import exp, inf, isfinite, sqrt

from scipy.optimize import brentq

from trajopt.velocity_domain.axis import Axis
from trajopt.velocity_domain.roots import common_root


@dataclass(frozen=True)
class PowerOptimum:
    """The least peak power, W, with the peak speed (m/s) and the energy (J) of the move that has it."""

    power: float
    peak: float
    energy: float


def minimum_time(axis: Axis) -> float:
    """The least duration over the stroke; that of the axis plays no part."""
    peak = rising_root(lambda v: v * axis.quickest(v)[0] - axis.quickest(v)[1] - axis.distance, 0.0, axis.velocity)
    if not isfinite(peak):
        return 0.0
    time, lag = axis.quickest(peak)
    return time + max(axis.distance - (peak * time - lag), 0.0) / peak


def least_energy(axis: Axis) -> float:
    """The least ∫|m a v| dt, J. Raises ValueError for a duration below the least, which it names."""
    return axis.mass * least_peak(axis) ** 2


def least_peak(axis: Axis) -> float:
    """The smallest peak speed with which the end is reached in time. Raises as ``least_energy``."""
    least = minimum_time(axis)
    if axis.duration < least * (1 - 1e-12):
        raise ValueError(f"too little time: the move takes {least:.9g} s, not {axis.duration:.9g} s")
    mean = axis.distance / axis.duration
    top = rising_root(lambda v: axis.quickest(v)[0] - axis.duration, mean, axis.velocity)
    return rising_root(lambda v: _spare(axis, v, inf), mean, top)


def least_peak_power(axis: Axis) -> PowerOptimum:
    """The least possible peak of |m a v|. Raises as ``least_energy``."""
    low = least_peak(axis)
    if (found := _at_once(axis, low)) is not None:
        return found

    def surplus(v: float) -> float:
        return axis.quickest(v, power_at(axis, v))[0] - axis.duration

    peak = rising_root(surplus, low * (1 + 1e-9), axis.velocity)
    return PowerOptimum(power_at(axis, peak), peak, axis.mass * peak**2)


def _at_once(axis: Axis, low: float) -> PowerOptimum | None:
    """The least peak power without a stay, by peak speed and power at once; None where that finds nothing."""
    mean = axis.distance / axis.duration
    natural = axis.mass * mean**2 / axis.duration

    def misses(x: float, z: float) -> tuple[float, float]:
        if not (low < x * mean < axis.velocity and abs(z) < 60):
            return inf, inf
        time, lag = axis.quickest(x * mean, natural * exp(z))
        return time / axis.duration - 1, lag / (axis.distance * (x - 1)) - 1

    found = common_root(misses, (1.5, 1.0))
    if found is None:
        return None
    peak, power = float(found[0]) * mean, natural * exp(found[1])
    return PowerOptimum(power, peak, axis.mass * peak**2)


def power_within(axis: Axis, energy: float) -> PowerOptimum:
    """The least peak power among the moves that take at most ``energy`` J: a point of the Pareto front.

    Raises ValueError for less energy than any move takes, which it names, and as ``least_energy``.
    """
    low = least_peak(axis)
    if energy < axis.mass * low**2 * (1 - 1e-12):
        raise ValueError(f"every move takes at least {axis.mass * low**2:.9g} J, more than {energy:.9g} J")
    lowest = least_peak_power(axis)
    peak = sqrt(energy / axis.mass)
    if peak >= lowest.peak:
        return lowest
    return PowerOptimum(power_at(axis, peak), peak, energy)


def power_at(axis: Axis, peak: float) -> float:
    """The power limit with which the quickest ramps to a peak speed, and a stay there, just reach the end in time."""
    natural = axis.mass * peak**2 / axis.duration
    low = high = natural
    while _spare(axis, peak, high) < 0 and high < 1e12 * natural:
        high *= 2
    while _spare(axis, peak, low) > 0:
        low /= 2
    if _spare(axis, peak, high) < 0:
        return inf
    return float(brentq(lambda p: _spare(axis, peak, p), low, high, xtol=1e-15 * natural, rtol=1e-14))


def _spare(axis: Axis, peak: float, power: float) -> float:
    """How much farther than the stroke a peak speed reaches in the duration."""
    return peak * axis.duration - axis.quickest(peak, power)[1] - axis.distance


def rising_root(function: Callable[[float], float], low: float, high: float) -> float:
    """Where a function that rises from a negative value crosses zero; ``high`` if it does not."""
    if isfinite(high):
        if function(high) <= 0:
            return high
        top = high
    else:
        top = 2 * low or 1.0
        while function(top) < 0:
            if top > 1e12 * (low or 1.0):
                return high
            top *= 2
    if function(low) >= 0:
        return low
    return float(brentq(function, low, top, xtol=1e-16 * top, rtol=1e-14))
