"""Limits of a servomotor's move, each a line over speed, and the least time they leave."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, isnan, log1p
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from trajopt.velocity_domain.motor import Floats, Servomotor

Indices: TypeAlias = NDArray[np.intp]
Line: TypeAlias = tuple[float, float]  # acceleration at rest, its change per unit of speed

_VANISHED: Final = 1e-9  # of the acceleration at rest: the fastest speed is the one at which this is left


@dataclass(frozen=True)
class Limits:
    """Largest speed (rad/s), acceleration and deceleration (rad/s²; None: as the acceleration), current (A) and
    voltage (V, of R u + Kτ ω). Raises ValueError for limits that are not positive."""

    velocity: float = inf
    acceleration: float = inf
    deceleration: float | None = None
    current: float = inf
    voltage: float = inf

    def __post_init__(self) -> None:
        for name in ("velocity", "acceleration", "deceleration", "current", "voltage"):
            value = getattr(self, name)
            if value is not None and (isnan(value) or value <= 0):
                raise ValueError(f"the limit of {name} must be positive, not {value:g}")


@dataclass(frozen=True)
class Envelope:
    """The accelerations a motor may take at each speed: below every line of ``upper``, above every one of ``lower``.
    The first line of each is the limit of acceleration itself; the others are those of the drive.

    Raises ValueError for a motor that cannot move its load.
    """

    motor: Servomotor
    upper: tuple[Line, ...]
    lower: tuple[Line, ...]
    fastest: float  # largest speed that may be kept

    @classmethod
    def of(cls, motor: Servomotor, limits: Limits) -> Envelope:
        braking = limits.acceleration if limits.deceleration is None else limits.deceleration
        rest, slope = -motor.coulomb / motor.inertia, -motor.viscous / motor.inertia
        by_current = motor.torque_constant * limits.current / motor.inertia
        by_voltage = motor.torque_constant * limits.voltage / (motor.resistance * motor.inertia)
        induced = -(motor.torque_constant**2) / (motor.resistance * motor.inertia)
        upper, lower = [(limits.acceleration, 0.0)], [(-braking, 0.0)]
        if np.isfinite(by_current):
            upper.append((by_current + rest, slope))
            lower.append((-by_current + rest, slope))
        if np.isfinite(by_voltage):
            upper.append((by_voltage + rest, slope + induced))
            lower.append((-by_voltage + rest, slope + induced))
        if min(line[0] for line in upper) <= 0:
            raise ValueError("the motor cannot move the load: friction takes all the torque its limits allow")
        fastest = min([limits.velocity, *(-start * (1 - _VANISHED) / change for start, change in upper if change < 0)])
        return cls(motor, tuple(upper), tuple(lower), fastest)

    def top(self, peak: float, below: Floats) -> tuple[Floats, Indices]:
        """(n,) the largest acceleration at speeds ``below`` a peak, and the index of the line that sets it."""
        return _extreme(self.upper, peak, below, 1.0)

    def bottom(self, peak: float, below: Floats) -> tuple[Floats, Indices]:
        """(n,) the smallest acceleration at speeds ``below`` a peak, and the index of the line that sets it."""
        return _extreme(self.lower, peak, below, -1.0)

    def hardest(self, peak: float) -> tuple[float, float]:
        """(time, distance) of the quickest way up to a peak speed and down again."""
        parts = [_ramp(self.upper, peak, 1.0), _ramp(self.lower, peak, -1.0)]
        return sum(p[0] for p in parts), sum(p[1] for p in parts)

    def least_time(self, distance: float) -> float:
        """The least duration of a move from rest to rest, s."""
        if np.isinf(self.upper[0][0]) and len(self.upper) == 1 and np.isinf(self.lower[0][0]):
            return 0.0 if np.isinf(self.fastest) else distance / self.fastest
        top = self.fastest
        if np.isfinite(top):
            time, covered = self.hardest(top)
            if covered <= distance:
                return time + (distance - covered) / top
        else:
            top = 1.0
            while self.hardest(top)[1] < distance:
                top *= 2
        return self.hardest(crossing(lambda w: self.hardest(w)[1], distance, 0.0, top))[0]


def crossing(function: Callable[[float], float], level: float, low: float, high: float) -> float:
    """Where an increasing function that may become infinite passes a positive level; an end if it does not."""

    def centred(x: float) -> float:
        value = function(x)
        return 0.5 if value == inf else value / (value + level) - 0.5

    if centred(high) <= 0:
        return high
    return low if centred(low) >= 0 else float(brentq(centred, low, high, xtol=1e-300, rtol=1e-15))


def _extreme(lines: tuple[Line, ...], peak: float, below: Floats, sign: float) -> tuple[Floats, Indices]:
    table = np.array([(start + change * peak) - change * below for start, change in lines])
    index = np.argmin(sign * table, axis=0)
    return np.take_along_axis(table, index[None], 0)[0], index


def _ramp(lines: tuple[Line, ...], peak: float, sign: float) -> tuple[float, float]:
    """(time, distance) to a speed along the lowest of the lines; infinite where it cannot be reached."""
    lines = tuple((sign * start, sign * change) for start, change in lines if np.isfinite(start))
    if not lines:
        return 0.0, 0.0
    crossings = [(b[0] - a[0]) / (a[1] - b[1]) for i, a in enumerate(lines) for b in lines[:i] if a[1] != b[1]]
    edges = [0.0, *sorted(v for v in crossings if 0 < v < peak), peak]
    time = distance = 0.0
    for low, high in zip(edges, edges[1:], strict=False):
        start, change = min(lines, key=lambda line: line[0] + line[1] * (low + high) / 2)
        first, gain = start + change * low, change * (high - low)
        if first + gain <= 0:
            return inf, inf
        t, d = _along(first, change, high - low)
        time, distance = time + t, distance + low * t + d
    return time, distance


def _along(first: float, change: float, rise: float) -> tuple[float, float]:
    """(time, distance above the starting speed) to gain speed ``rise`` from acceleration ``first`` on a line."""
    if abs(change * rise) < 0.05 * first:
        x, w = np.polynomial.legendre.leggauss(12)
        gained = rise * (x + 1) / 2
        share = w * rise / 2 / (first + change * gained)
        return float(share.sum()), float(gained @ share)
    time = log1p(change * rise / first) / change
    return time, (rise - first * time) / change
