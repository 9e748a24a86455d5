"""A vertical slider-crank in closed form: the test mechanism of position-dependent inertia.

After Van Oosterwyck et al., *Energy Optimal Point-to-Point Motion Profile Optimization*; the mechanism is chosen here,
their CAD data are not public. Moral: trapezoid and quintic pay for the inertia that the crank has in the middle of its
turn; a profile that is slow there takes half the torque.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

import trajopt

Floats = NDArray[np.float64]

CRANK, ROD = 0.05, 0.16  # m
SLIDER, ROD_MASS, ROD_CENTRE, ROD_INERTIA = 3.0, 0.6, 0.06, 1.6e-3  # kg, kg, m from the crank pin, kg m²
MOTOR_AND_CRANK, UNBALANCE, UNBALANCE_AT = 2.0e-3, 0.8, 0.01  # kg m², kg, m
GRAVITY: Final = 9.81
TURN, DURATION = np.deg2rad(173.0), 73.5e-3  # rad, s

_AT_SLIDER = ROD_MASS * ROD_CENTRE / ROD  # of the mass of the rod, and what is left for the crank pin
_AT_PIN = ROD_MASS - _AT_SLIDER
_EXTRA = ROD_INERTIA - ROD_MASS * ROD_CENTRE * (ROD - ROD_CENTRE)


def _geometry(angle: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """x', x'' of the slider and f', f'' of the rod's angle, by that of the crank."""
    k = CRANK / ROD
    s, c = np.sin(angle), np.cos(angle)
    root = np.sqrt(1 - (k * s) ** 2)
    x1 = CRANK * s + ROD * k**2 * s * c / root
    x2 = CRANK * c + ROD * k**2 * ((c**2 - s**2) / root + (k * s * c) ** 2 / root**3)
    return x1, x2, k * c / root, -k * s / root + k**3 * s * c**2 / root**3


def inertia(angle: Floats) -> Floats:
    """J, kg m²."""
    x1, _, f1, _ = _geometry(angle)
    return MOTOR_AND_CRANK + _AT_PIN * CRANK**2 + (SLIDER + _AT_SLIDER) * x1**2 + _EXTRA * f1**2


def inertia_slope(angle: Floats) -> Floats:
    """dJ/dθ, kg m²/rad."""
    x1, x2, f1, f2 = _geometry(angle)
    return 2 * (SLIDER + _AT_SLIDER) * x1 * x2 + 2 * _EXTRA * f1 * f2


def load_torque(angle: Floats) -> Floats:
    """T_l, N m: of gravity."""
    x1, _, _, _ = _geometry(angle)
    return GRAVITY * ((SLIDER + _AT_SLIDER) * x1 + (_AT_PIN * CRANK + UNBALANCE * UNBALANCE_AT) * np.sin(angle))


def load(step: float = 1.0, low: float = -10.0, high: float = 190.0, **more: float) -> trajopt.Load:
    """The mechanism as a load: tables from ``low`` to ``high`` with a row every ``step`` degrees."""
    count = round((high - low) / step) + 1
    ends = np.deg2rad(low), np.deg2rad(high)
    curves = (trajopt.Curve.of(function, *ends, count) for function in (inertia, load_torque))
    return trajopt.Load(**dict(zip(("inertia", "force"), curves, strict=True)), **more)


def table(step: float = 1.0, low: float = -10.0, high: float = 190.0) -> str:
    """The table `slider_crank.csv`, as a CAD system would export it."""
    degrees = np.arange(low, high + step / 2, step)
    angle = np.deg2rad(degrees)
    rows = zip(degrees, inertia(angle), load_torque(angle), strict=True)
    return "\n".join(["theta [deg],J [kg m^2],T [N m]", *(f"{q:g},{j:.17g},{t:.17g}" for q, j, t in rows)]) + "\n"


def cycle_rms(forward: trajopt.Solution, back: trajopt.Solution) -> float:
    """RMS torque of a cycle, N m: forwards, a dwell, back, a dwell, the crank held against gravity in both."""
    square = length = 0.0
    for solution in (forward, back):
        assert solution.duration is not None and solution.problem.load.force is not None
        dwell = solution.problem.move.dwell
        held = float(solution.problem.load.force.at(solution.at(solution.duration)["position"]))
        square += solution.metrics["rms_force"] ** 2 * solution.duration + held**2 * dwell
        length += solution.duration + dwell
    return float(np.sqrt(square / length))
