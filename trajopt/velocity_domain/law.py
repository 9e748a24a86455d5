"""The optimal acceleration at each speed, given the prices of time and of distance.

With speed v as the independent variable and p = 1/|a| on each way, time ∫p dv and distance ∫v p dv are linear and the
cost ∫p Q(v, 1/p) dv is convex: its minimum under two prices is found speed by speed. Where h(v) is the price of staying
at speed v for a second, (Q - h)/|a| is least where the line from (0, h) touches Q as a function of a, or at a limit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.velocity_domain.limits import Envelope
from trajopt.velocity_domain.motor import Floats, Loss, Servomotor
from trajopt.velocity_domain.roots import increasing_root

Codes = NDArray[np.int64]

# Names of arcs: sign of the control; A acceleration-limited, C drive-limited, U unconstrained, V at the speed limit.
NAMES = ("PA", "PC", "PU", "PV", "Z", "NU", "NC", "NA")
SUBS = ("S11", "S2", "S12")  # P > 0 and u > 0; P <= 0; P > 0 and u < 0
_TINY = 1e-100  # A: in the place of 0 where a power of it may be infinite
PA, PC, PU, PV, Z, NU, NC, NA = range(8)
S11, S2, S12, NEUTRAL = range(4)  # NEUTRAL: the part of S2 in which P = 0 holds the current


def code(name: Any, sub: Any) -> Any:
    """One integer for a kind of arc within a part of the move."""
    return 4 * name + sub


@dataclass(frozen=True)
class Law:
    """The accelerations on the way up to a peak speed and down from it. Speeds are given as ``below`` = peak - speed.

    The price of a second at speed v is h(v) = hold cost at the peak - ``slope``·(peak - v): at the peak staying costs
    what it is worth. ``slope`` is the price of distance: that of the hold cost at the peak, and ``excess`` >= 0.
    """

    motor: Servomotor
    loss: Loss
    envelope: Envelope
    peak: float
    excess: float

    def hold_cost(self, speed: Any) -> Any:
        """W needed to keep a speed; convex in it."""
        return self.loss.cost(speed, self.motor.hold(speed))

    @cached_property
    def slope(self) -> float:
        """The price of distance, J/rad."""
        return hold_slope(self.motor, self.loss, self.peak) + self.excess

    @property
    def time_price(self) -> float:
        return float(self.hold_cost(self.peak)) - self.slope * self.peak

    def rising(self, below: Floats) -> tuple[Floats, Codes]:
        """(n,) accelerations and codes of the way up."""
        speed = self.peak - below
        free = self._torque * self._excess(speed, self.motor.hold(speed), self._gap(below), np.inf)
        limit, line = self.envelope.top(self.peak, below)
        name = np.where(free < limit, PU, np.where(line == 0, PA, PC))
        return np.minimum(free, limit), code(name, S11)

    def falling(self, below: Floats) -> tuple[Floats, Codes]:
        """(n,) accelerations, all negative, and codes of the way down."""
        speed = self.peak - below
        step, codes = self._braking(speed, self.motor.hold(speed), below)
        free = -self._torque * step
        limit, line = self.envelope.bottom(self.peak, below)
        held = free < limit
        if not held.any():
            return free, codes
        current = self.motor.current(speed, limit)
        sub = np.where(current > 0, S11, np.where(self.loss.power(speed, current) > 0, S12, S2))
        name = np.where(current > 0, np.where(line == 0, PA, PC), np.where(line == 0, NA, NC))
        return np.where(held, limit, free), np.where(held, code(name, sub), codes)

    @property
    def _torque(self) -> float:
        """Acceleration per ampere."""
        return self.motor.torque_constant / self.motor.inertia

    def _gap(self, below: Floats) -> Floats:
        """What staying at a speed costs beyond its price, never negative."""
        bend = hold_bend(self.motor, self.loss, self.peak, below)
        return np.asarray(self.excess * below + np.maximum(bend, 0.0))

    def _excess(self, speed: Floats, hold: Floats, gap: Floats, most: float | Floats) -> Floats:
        """|u - hold| of the tangent where u > 0: up if ``most`` is infinite, else down by at most ``most`` = hold."""
        quadratic, magnetic, power = self.loss.quadratic(speed), self.loss.hysteresis * speed, self.loss.exponent
        top = np.minimum(np.sqrt(gap / quadratic), most)
        if not self.loss.hysteresis:
            return np.asarray(top)
        sign = 1.0 if np.isscalar(most) else -1.0

        def value(x: Floats) -> tuple[Floats, Floats]:
            u = np.maximum(hold + sign * x, _TINY)
            bent = u**power * beyond_tangent(-sign * x / u, power)
            slope = 2 * quadratic + magnetic * power * (power - 1) * u ** (power - 2)
            return quadratic * x**2 + magnetic * bent - gap, slope * x

        return increasing_root(value, top)

    def _braking(self, speed: Floats, hold: Floats, below: Floats) -> tuple[Floats, Codes]:
        """hold - u of the unlimited way down, and its codes."""
        loss, gap = self.loss, self._gap(below)
        price = self.hold_cost(speed) - gap
        quadratic, magnetic = loss.quadratic(speed), loss.hysteresis * speed
        linear = loss.switching - loss.mechanical * speed  # dP/d|u| at u = -0
        positive = gap < quadratic * hold**2 + magnetic * hold**loss.exponent
        step = np.array(hold)
        step[positive] = self._excess(speed[positive], hold[positive], gap[positive], hold[positive])
        codes = np.where(positive, code(PU, S11), code(Z, S2))
        negative = ~positive & (price < -np.maximum(linear, loss.recovery * linear) * hold)
        if not negative.any():
            return step, codes
        at = np.flatnonzero(negative)
        size, sub = self._reversed(speed[at], hold[at], price[at], linear[at])
        step[at], codes[at] = hold[at] + size, code(NU, sub)
        return step, codes

    def _reversed(self, speed: Floats, hold: Floats, price: Floats, linear: Floats) -> tuple[Floats, Codes]:
        """|u| and sub-trajectory where the unlimited current is negative."""
        neutral = self._neutral(speed, linear)
        size = self._tangent(speed, hold, linear, price)
        paying = size > neutral
        size, sub = np.where(paying, size, neutral), np.where(paying, S12, NEUTRAL)
        if self.loss.recovery > 0:
            feeding = self._tangent(speed, hold, linear, price / self.loss.recovery)
            gaining = ~paying & (feeding < neutral)
            size, sub = np.where(gaining, feeding, size), np.where(gaining, S2, sub)
        return size, sub

    def _neutral(self, speed: Floats, linear: Floats) -> Floats:
        """|u| of the braking current at which P = 0; 0 where P is positive for every one."""
        quadratic, magnetic, power = self.loss.quadratic(speed), self.loss.hysteresis * speed, self.loss.exponent
        top = np.maximum(-linear, 0.0) / quadratic
        if not self.loss.hysteresis:
            return np.asarray(top)

        def value(x: Floats) -> tuple[Floats, Floats]:
            x = np.maximum(x, _TINY)
            return (
                quadratic * x + magnetic * x ** (power - 1) + linear,
                quadratic + magnetic * (power - 1) * x ** (power - 2),
            )

        return increasing_root(value, top)

    def _tangent(self, speed: Floats, hold: Floats, linear: Floats, price: Floats) -> Floats:
        """|u| at which the line from (0, price) touches P on the side of braking currents; 0 if at none."""
        quadratic, magnetic, power = self.loss.quadratic(speed), self.loss.hysteresis * speed, self.loss.exponent
        height = quadratic * hold**2 - linear * hold - price
        top = np.maximum(np.sqrt(np.maximum(height, 0.0) / quadratic) - hold, 0.0)
        if not self.loss.hysteresis:
            return np.asarray(top)

        def value(x: Floats) -> tuple[Floats, Floats]:
            x = np.maximum(x, _TINY)
            bent = (power - 1) * x**power + power * hold * x ** (power - 1)
            slope = power * (power - 1) * (x ** (power - 1) + hold * x ** (power - 2))
            return quadratic * (x + hold) ** 2 + magnetic * bent - height, 2 * quadratic * (x + hold) + magnetic * slope

        return increasing_root(value, top)


def hold_slope(motor: Servomotor, loss: Loss, speed: float) -> float:
    """The derivative of the hold cost."""
    hold = motor.hold(speed)
    if hold == 0:
        return 0.0
    by_current = loss.power_by_current(speed, hold) * motor.viscous / motor.torque_constant
    return float(loss.power_by_speed(speed, hold) + by_current)


def hold_bend(motor: Servomotor, loss: Loss, peak: float, below: Floats) -> Floats:
    """(n,) by how much the hold cost at speeds ``below`` a peak lies above its tangent there, without cancellation."""
    change, hold = motor.viscous / motor.torque_constant, motor.hold(peak)
    bend = (loss.resistance * change + loss.mechanical) * change * below**2
    if loss.eddy:
        step = below * (hold + change * (peak - below))
        bend = bend + loss.eddy * (step**2 + 2 * hold * peak * change * below**2)
    if loss.hysteresis and change:
        share = -change * below / hold
        curved = beyond_tangent(share, loss.exponent)
        fall = curved + loss.exponent * share
        bend = bend + loss.hysteresis * hold**loss.exponent * (peak * curved - below * fall)
    return np.asarray(bend)


def beyond_tangent(x: Floats, power: float) -> Floats:
    """(n,) (1 + x)^power - 1 - power·x for x >= -1, without cancellation near 0."""
    last = 1 + (power - 4) / 5 * x
    near = power * (power - 1) / 2 * x**2 * (1 + (power - 2) / 3 * x * (1 + (power - 3) / 4 * x * last))
    return np.where(np.abs(x) < 1e-3, near, np.maximum(1 + x, 0.0) ** power - 1 - power * x)
