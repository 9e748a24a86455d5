"""A servomotor with its load, and what its move costs (Wang, Ueda, Bortoff 2013, eqs. 1 to 3).

I dω/dt = Kτ u - c - d ω for ω >= 0, and the electrical power P = R u² + Ke ω² u² + Kh ω |u|^γ + Ks |u| + Kτ u ω.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Objective: TypeAlias = Literal["energy", "copper"]


@dataclass(frozen=True)
class Servomotor:
    """A motor and the inertia it turns.

    Units: N m/A, ohm, kg m², N m s, N m, W/A for ``switching``; ``eddy``·ω²u² and ``hysteresis``·ω|u|^``exponent`` are
    watts. ``recovery`` is the share of the power fed back that is credited: 0 without feedback into the grid.
    Raises ValueError for a value that no motor has.
    """

    torque_constant: float
    resistance: float
    inertia: float
    viscous: float = 0.0
    coulomb: float = 0.0
    switching: float = 0.0
    eddy: float = 0.0
    hysteresis: float = 0.0
    exponent: float = 1.6
    recovery: float = 0.0

    def __post_init__(self) -> None:
        for name in ("torque_constant", "resistance", "inertia"):
            if not (isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} must be positive and finite, not {getattr(self, name):g}")
        for name in ("viscous", "coulomb", "switching", "eddy", "hysteresis"):
            if not (isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise ValueError(f"{name} must be finite and at least 0, not {getattr(self, name):g}")
        if not 1 < self.exponent <= 2:
            raise ValueError(f"the hysteresis exponent must lie in (1, 2], not {self.exponent:g}")
        if not 0 <= self.recovery <= 1:
            raise ValueError(f"the recovery efficiency must lie in [0, 1], not {self.recovery:g}")

    def friction(self, speed: Any) -> Any:
        """Coulomb and viscous torque, N m."""
        return self.coulomb + self.viscous * speed

    def hold(self, speed: Any) -> Any:
        """The current that keeps a speed, A."""
        return self.friction(speed) / self.torque_constant

    def current(self, speed: Any, acceleration: Any) -> Any:
        return (self.inertia * acceleration + self.friction(speed)) / self.torque_constant

    def acceleration(self, speed: Any, current: Any) -> Any:
        return (self.torque_constant * current - self.friction(speed)) / self.inertia


@dataclass(frozen=True)
class Loss:
    """The cost rate Q = max(0, P) - recovery·max(0, -P), W, with P as above; ``mechanical`` stands for its Kτ.

    Copper loss has every coefficient but the resistance zero. Q is convex in the current at each speed >= 0.
    """

    resistance: float
    eddy: float = 0.0
    hysteresis: float = 0.0
    exponent: float = 1.6
    switching: float = 0.0
    mechanical: float = 0.0
    recovery: float = 0.0

    @classmethod
    def of(cls, motor: Servomotor, objective: Objective) -> Loss:
        """Raises ValueError for an unknown objective."""
        if objective == "copper":
            return cls(motor.resistance)
        if objective != "energy":
            raise ValueError(f"the objective must be energy or copper, not {objective!r}")
        return cls(
            motor.resistance,
            motor.eddy,
            motor.hysteresis,
            motor.exponent,
            motor.switching,
            motor.torque_constant,
            motor.recovery,
        )

    def quadratic(self, speed: Any) -> Any:
        """The coefficient of u²."""
        return self.resistance + self.eddy * speed * speed

    def power(self, speed: Any, current: Any) -> Any:
        size = np.abs(current)
        magnetic = self.hysteresis * speed * size**self.exponent if self.hysteresis else 0.0
        return self.quadratic(speed) * size**2 + magnetic + self.switching * size + self.mechanical * current * speed

    def cost(self, speed: Any, current: Any) -> Any:
        power = self.power(speed, current)
        return np.where(power > 0, power, self.recovery * power)

    def power_by_current(self, speed: Any, current: Any) -> Any:
        """∂P/∂u for u other than zero."""
        size, sign = np.abs(current), np.sign(current)
        slope = 2 * self.quadratic(speed) * size + self.switching
        if self.hysteresis:
            slope = slope + self.exponent * self.hysteresis * speed * size ** (self.exponent - 1)
        return sign * slope + self.mechanical * speed

    def power_by_speed(self, speed: Any, current: Any) -> Any:
        """∂P/∂ω."""
        size = np.abs(current)
        magnetic = self.hysteresis * size**self.exponent if self.hysteresis else 0.0
        return 2 * self.eddy * speed * size**2 + magnetic + self.mechanical * current
