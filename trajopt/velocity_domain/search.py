"""The energy-optimal move of a servomotor without a jerk limit: the best peak speed, and the price of distance at it.

For a given peak speed the problem is convex (see ``law``) and one equation fixes the price of distance; the derivative
of the cost by the peak speed then has a sign that depends on whether time is left over. Every change of that sign on a
grid of peak speeds is followed up, and the cheapest kept.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import exp, inf, isfinite, log
from typing import Final, TypeAlias

import numpy as np
from scipy.optimize import brentq, root

from trajopt.velocity_domain.law import Law
from trajopt.velocity_domain.limits import Envelope, Limits, crossing
from trajopt.velocity_domain.motor import Floats, Loss, Objective, Servomotor
from trajopt.velocity_domain.pieces import Piece, deficit, pieces, stay
from trajopt.velocity_domain.servo import ServoOptimum

_PEAKS: Final = 16  # peak speeds of the grid
_COARSE: Final = 96  # speeds on each way for a first estimate
_TOP: Final = 40.0  # of the logarithm of the price of distance, over its natural size: the move is time-optimal
_FLOOR: Final = 28.0  # the same, under it: the move lingers at its peak as long as it likes
_DECADES: Final = 32.0  # in e-folds: how near the peak the estimate looks
_NEAR: Final = 1e-2  # relative: an estimate this near the largest peak is decided there
_MET: Final = 1e-9  # relative: how closely time and distance are met
_SHORT: Final = 1e-12  # relative: a duration below the least by less counts as the least

Integrator: TypeAlias = Callable[[Law], tuple[float, float]]  # (time, deficit) without a stay at the peak


def optimum(
    motor: Servomotor,
    distance: float,
    duration: float,
    limits: Limits | None = None,
    objective: Objective = "energy",
) -> ServoOptimum:
    """The cheapest move from rest to rest over ``distance`` > 0 rad in exactly ``duration`` s, speed never negative.

    Raises ValueError for a distance or duration that is not positive, a motor that cannot move its load, and a duration
    below the least possible one, which it names; RuntimeError where time and distance cannot be met to a billionth.
    """
    limits = Limits() if limits is None else limits
    for name, value in (("distance", distance), ("duration", duration)):
        if not (isfinite(value) and value > 0):
            raise ValueError(f"the {name} must be positive and finite, not {value:g}: the move is one-way, forwards")
    envelope = Envelope.of(motor, limits)
    least = envelope.least_time(distance)
    if duration < least * (1 + _SHORT):
        raise ValueError(f"too little time: the move takes more than {least:.9g} s, not {duration:.9g} s")
    search = _Search(motor, Loss.of(motor, objective), envelope, distance, duration)
    found = [search.refined(peak) for peak in search.candidates()]
    law, parts = min(found, key=lambda answer: sum(p.cost.sum() for p in answer[1]))
    return ServoOptimum(law, tuple(parts), distance, duration)


class _Search:
    def __init__(self, motor: Servomotor, loss: Loss, envelope: Envelope, distance: float, duration: float) -> None:
        self._motor, self._loss, self._envelope = motor, loss, envelope
        self._distance, self._duration = distance, duration
        self._least, self._most = self._range()
        self._last = self._natural(self._least)

    def candidates(self) -> list[float]:
        """Peak speeds, roughly, at which the cost has a local minimum."""
        most = self._most if isfinite(self._most) else self._open_end()
        share = np.linspace(0, 1, _PEAKS + 1)[1:]
        peaks = [float(x) for x in self._least + (most - self._least) * share**1.5]
        surplus = [self._surplus(peak) for peak in peaks]
        edges, values = [self._least, *peaks], [-inf, *surplus]
        found = []
        for i in range(_PEAKS):
            if values[i] < 0 <= values[i + 1]:
                found.append(self._root(edges[i], edges[i + 1]))
        return found + ([most] if values[-1] < 0 else [])

    def refined(self, guess: float) -> tuple[Law, list[Piece]]:
        """The law and the pieces at the minimum near a guess of its peak speed."""
        start = self._price(guess, self._estimate, self._natural(guess), 1.0, 1e-6)
        if guess > self._most * (1 - _NEAR):
            z = self._price(self._most, self._exact, start, 1e-3, 1e-14)
            if self._beyond(self._most, z, self._exact) <= 0:
                return self._answer(self._most, z)
        found = self._settled(guess, start)
        if found is None:
            floor = self._natural(guess) - _FLOOR
            if self._lingering(guess, floor, self._estimate)[1] <= 0:
                return self._answer(self._lingering(guess, floor, self._exact)[0], floor)
            high = start + 1
            while self._lingering(guess, high, self._estimate)[1] > 0:
                high += 2
            start = float(brentq(lambda z: self._lingering(guess, z, self._estimate)[1], floor, high, xtol=1e-6))
            found = self._settled(self._lingering(guess, start, self._estimate)[0], start)
        if found is None:
            raise RuntimeError("time and distance of the optimum could not be met")
        return self._answer(*found)

    def _settled(self, guess: float, start: float) -> tuple[float, float] | None:
        """The peak speed and the price at which time and distance are met; None where they are not found."""

        mean = self._distance / self._duration  # every peak speed lies above it

        def residual(x: Floats) -> Floats:
            peak, z = mean + (guess - mean) * exp(x[0]), start + x[1]
            time, lag = self._exact(self._law(peak, z))
            left = time + self._jump(peak) / exp(z) - self._duration
            return np.array([left / self._duration, log(max(lag, 1e-300) / self._lag(peak))])

        found = root(residual, np.zeros(2), options={"xtol": 1e-12, "eps": 1e-7, "factor": 0.1})
        if not np.abs(found.fun).max() <= _MET:
            return None
        return mean + (guess - mean) * exp(found.x[0]), start + float(found.x[1])

    def _lingering(self, guess: float, z: float, integrate: Integrator) -> tuple[float, float]:
        """(peak, surplus of time) of the move with a given price. Where friction makes a move linger, the peak hardly
        depends on the price, and the other way round is hopeless."""

        @cache
        def excess(peak: float) -> float:
            return log(integrate(self._law(peak, z))[1] / self._lag(peak))

        low, high, width = guess, guess, 1e-5
        while excess(low) < 0:
            low, width = low - width * (low - self._distance / self._duration), min(4 * width, 0.5)
        while excess(high) > 0:
            high, width = min(high * (1 + width), self._most), 4 * width
            if high == self._most:
                break
        peak = high if excess(high) > 0 else float(brentq(excess, low, high, xtol=1e-14 * guess, rtol=1e-14))
        return peak, self._beyond(peak, z, integrate)

    def _answer(self, peak: float, z: float) -> tuple[Law, list[Piece]]:
        law = self._law(peak, z)
        parts = pieces(law)
        left = self._duration - sum(p.duration for p in parts)
        if left > 1e-9 * self._duration:
            parts.insert(sum(p.way > 0 for p in parts), stay(law, left, peak == self._most))
        return law, parts

    def _range(self) -> tuple[float, float]:
        """Peak speeds of moves that keep the duration and reach the end."""
        envelope, duration = self._envelope, self._duration
        most = envelope.fastest
        finite, beyond = (most, 0.0) if isfinite(most) else (2 * self._distance / duration, 1e6)
        while envelope.hardest(finite)[0] < duration and finite < beyond * self._distance / duration:
            finite *= 2
        if envelope.hardest(finite)[0] > duration:
            most = finite = crossing(lambda w: envelope.hardest(w)[0], duration, 0.0, finite)
        return crossing(self._farthest, self._distance, self._distance / duration, finite), most

    def _farthest(self, peak: float) -> float:
        """The farthest move of the duration below a peak speed."""
        time, covered = self._envelope.hardest(peak)
        return covered + peak * (self._duration - time)

    def _open_end(self) -> float:
        """A peak speed beyond which, without limits, the cost only grows."""
        most = 2 * self._least
        while self._surplus(most) < 0:
            most *= 1.5
        return most * 1.5

    def _root(self, low: float, high: float) -> float:
        low += 1e-6 * (high - low)
        if self._surplus(low) >= 0:
            return low
        return float(brentq(lambda w: self._surplus(w), low, high, xtol=1e-6 * high, rtol=1e-6))

    def _surplus(self, peak: float) -> float:
        """By how much the move up to a peak exceeds the duration with the stay there that is worth it, s, estimated.
        Negative where a higher peak is cheaper."""
        self._last = self._price(peak, self._estimate, self._last, 1.0, 1e-4)
        if self._last < self._natural(peak) - _FLOOR:
            return self._duration
        return self._beyond(peak, self._last, self._estimate)

    def _beyond(self, peak: float, z: float, integrate: Integrator) -> float:
        return integrate(self._law(peak, z))[0] + self._jump(peak) / exp(z) - self._duration

    def _price(self, peak: float, integrate: Integrator, start: float, step: float, width: float) -> float:
        """The logarithm of the price of distance above the slope of the hold cost, for a peak: an end of its range
        where no price meets the distance. Sought from ``start`` in growing steps, then to within ``width``."""
        natural = self._natural(peak)

        @cache
        def excess(z: float) -> float:
            return log(integrate(self._law(peak, z))[1] / self._lag(peak))

        low = high = start
        grown = step
        while excess(high) > 0:
            if high > natural + _TOP:
                return high
            low, high, grown = high, high + grown, 2 * grown
        while excess(low) <= 0:
            if low < natural - _FLOOR:
                return low
            low, high, step = low - step, low, 2 * step
        return float(brentq(excess, low, high, xtol=width, rtol=1e-14))

    def _lag(self, peak: float) -> float:
        """What ∫(peak - speed) dt is in a move that meets time and distance, rad."""
        return peak * self._duration - self._distance

    def _law(self, peak: float, z: float) -> Law:
        return Law(self._motor, self._loss, self._envelope, peak, exp(z))

    def _natural(self, peak: float) -> float:
        """The logarithm of a price of distance that goes with accelerations of peak / duration."""
        current = 4 * peak / self._duration * self._motor.inertia / self._motor.torque_constant
        return log(float(self._loss.quadratic(peak)) * current**2 / peak)

    def _jump(self, peak: float) -> float:
        """The jump of dQ/da at the peak speed where holding it takes no current."""
        if self._motor.hold(peak) > 0:
            return 0.0
        fed = self._loss.mechanical * peak - self._loss.switching
        below = self._loss.recovery * fed if fed > 0 else fed
        above = self._loss.mechanical * peak + self._loss.switching
        return (above - below) * self._motor.inertia / self._motor.torque_constant

    def _exact(self, law: Law) -> tuple[float, float]:
        """(time, deficit) without a stay at the peak."""
        parts = pieces(law)
        return sum(p.duration for p in parts), deficit(parts, law.peak)

    def _estimate(self, law: Law) -> tuple[float, float]:
        """The same by one fixed quadrature."""
        below, weight = (law.peak * x for x in _fixed())
        pace = weight * (1 / law.rising(below)[0] - 1 / law.falling(below)[0])
        return float(pace.sum()), float(pace @ below)


@cache
def _fixed() -> tuple[Floats, Floats]:
    """(n,) speeds below a peak of 1, and their weights: dense about the peak, at which a move may linger."""
    x, w = np.polynomial.legendre.leggauss(_COARSE)
    s = (1 + x) / 2
    below = np.exp(-_DECADES * s**2)
    return below, below * _DECADES * s * w
