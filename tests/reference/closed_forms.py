"""Optima that are known in closed form. Rest to rest unless stated; SI."""

from __future__ import annotations

from math import exp, log, prod, sqrt, tanh
from typing import Final

# Order m of the top derivative -> its name, ∫u²dt and peak velocity of the move of least ∫u²dt, for D = T = 1.
SMOOTHEST: Final = {2: ("acceleration", 12.0, 3 / 2), 3: ("jerk", 720.0, 15 / 8), 4: ("snap", 100800.0, 35 / 16)}

PROFILES: Final = {  # position over time for D = T = 1: power -> coefficient
    2: {2: 3, 3: -2},
    3: {3: 10, 4: -15, 5: 6},
    4: {4: 35, 5: -84, 6: 70, 7: -20},
}


def least_square(order: int, intervals: int) -> float:
    """Least ∫u²dt for D = T = 1 when u is piecewise constant on equal intervals: exact for any N."""
    return SMOOTHEST[order][1] * prod(intervals**2 / (intervals**2 - i**2) for i in range(1, order))


LEAST_SQUARE_AT_8: Final = {2: 12.19047619047619, 3: 780.1904761904762}  # the same, typed in


def bryson_denham(highest: float) -> float:
    """Least ½∫a²dt from x = 0, v = 1 to x = 0, v = -1 in T = 1 with x <= ``highest``."""
    if highest >= 1 / 4:
        return 2.0
    return 2 + 6 * (1 - 4 * highest) ** 2 if highest >= 1 / 6 else 4 / (9 * highest)


def least_peak_velocity(distance: float, time: float, acceleration: float, jerk: float = float("inf")) -> float:
    """Least max v with limits on a and j."""
    s = time - acceleration / jerk
    return acceleration / 2 * (s - sqrt(s**2 - 4 * distance / acceleration))


def least_peak_power(mass: float, distance: float, time: float) -> float:
    """Least max|P|, no other limits."""
    return 9 / 4 * mass * distance**2 / time**3


def least_square_power(mass: float, distance: float, time: float) -> float:
    """Least ∫P²dt, no other limits."""
    return 125 / 36 * mass**2 * distance**4 / time**5


def trapezoid_time(distance: float, velocity: float, acceleration: float) -> float:
    """Minimum time with limits on v and a."""
    if distance >= velocity**2 / acceleration:
        return distance / velocity + velocity / acceleration
    return 2 * sqrt(distance / acceleration)


def s_curve_time(distance: float, velocity: float, acceleration: float, jerk: float) -> float:
    """Minimum time with limits on v, a and j, for moves long enough to reach the velocity limit."""
    ramp = velocity / acceleration + acceleration / jerk
    if velocity < acceleration**2 / jerk:
        ramp = 2 * sqrt(velocity / jerk)
    assert distance >= velocity * ramp
    return distance / velocity + ramp


# m -> s, with limits of 0.5 m/s, 4.905 m/s², 98.1 m/s³
CLEMEN_RUPP_TIMES: Final = {0.254: 0.6599367992, 0.05: 0.2580257669, 0.005: 0.1177109844}


def coulomb_time(distance: float, force: float, mass: float, coulomb: float) -> float:
    """Minimum time with a force limit and Coulomb friction."""
    forth, back = (force - coulomb) / mass, (force + coulomb) / mass
    return sqrt(2 * distance * (1 / forth + 1 / back))


def viscous_time(distance: float, force: float, mass: float, viscous: float) -> float:
    """Minimum time with a force limit and viscous friction."""
    fastest, tau = force / viscous, mass / viscous
    c = exp(-distance / (fastest * tau))
    return 2 * tau * log((1 + sqrt(1 - c)) / c) - distance / fastest


def least_square_acceleration_below(velocity: float, distance: float, time: float) -> float:
    """Least ∫a²dt with v <= ``velocity`` < 1.5 D/T."""
    return 16 / 9 * velocity**3 / (velocity * time - distance)


def least_square_viscous_force(mass: float, viscous: float, distance: float, time: float) -> float:
    """Least ∫(m a + b v)²dt."""
    w = viscous / mass
    return viscous**2 * distance**2 / (time - 2 / w * tanh(w * time / 2))


def minimum_jerk_through(position: float, at: float) -> float:
    """Least ∫j²dt for D = T = 1 that passes through ``position`` at time ``at``."""
    without = sum(c * at**k for k, c in PROFILES[3].items())
    return 720 + 20 * (position - without) ** 2 / (at * (1 - at)) ** 5
