"""The servomotor: what current, voltage and electrical power a force and a velocity take, and what is drawn in a move.

current u = F/Kt; voltage R u + Kt v; the power drawn from the drive's bus

    P = F v + R u² + Ks |u| + Ke v² u² + Kh |v| |u|^γ

with copper, switching, eddy-current and hysteresis losses (the loss function of Wang, Ueda & Bortoff). What a braking
motor feeds back is lost but for a share, the recovery η: the electrical energy of a move is
∫ max(0, P) - η max(0, -P) dt.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from norms import Norm, Rows
from trajopt.fields import Limit
from trajopt.mesh import Floats
from trajopt.problem import Load, Problem
from trajopt.signals import OnFloats


def copper(model: Any, load: Load, current: Any, size: float) -> Any:
    """R u², W, from the current in A and its size."""
    assert load.motor is not None
    return model.times(load.motor[1] * size**2, model.squares(current * (1 / size)))


def heat(model: Any, load: Load, current: Any, size: float) -> Any:
    """R u² + Ks|u|, W: convex in the current."""
    found = copper(model, load, current, size)
    switching = load.switching * size
    return found + model.times(switching, model.magnitude(current * (1 / size))) if switching else found


def iron(model: Any, load: Load, current: Any, speed: Any, size: float) -> Any:
    """Ke v² u² + Kh|v||u|^γ, W, for |v| = ``speed``."""
    found: Any = 0.0
    if load.eddy:
        found = model.times(model.times(load.eddy, model.squares(speed)), model.squares(current))
    if load.hysteresis:
        raised = model.raised(current, load.hysteresis_exponent, size)[0]
        found = found + model.times(model.times(load.hysteresis, speed), raised)
    return found


def power(load: Load, force: Floats, velocity: Floats) -> Floats:
    """The power drawn, W, from floats."""
    assert load.motor is not None
    floats, current = OnFloats(), force / load.motor[0]
    drawn: Floats = force * velocity + heat(floats, load, current, 1.0)
    drawn += iron(floats, load, current, np.abs(velocity), 1.0)
    return drawn


class Intake(Norm):
    """∫ max(0, x) - recovery·max(0, -x) dt: the energy drawn by a power of both signs, in the style of a norm."""

    name = "intake"

    def __init__(self, recovery: float) -> None:
        self.recovery = recovery

    def measure(self, x: Floats, weights: Floats, duration: float) -> float:
        return float(duration * (weights @ ((1 - self.recovery) * np.maximum(x, 0.0) + self.recovery * x)))

    def lower(self, model: Rows, x: Any, weights: Floats, duration: Any) -> Any:
        if self.recovery == 1.0:
            return duration * model.total(weights, x)
        bound = model.variable(len(weights))
        model.nonpositive(x - bound)
        model.nonpositive(-bound)
        drawn = model.total((1 - self.recovery) * weights, bound)
        return duration * (drawn + model.total(self.recovery * weights, x) if self.recovery else drawn)


def implied(problem: Problem) -> Problem:
    """The problem with the limits on force, acceleration and velocity that those of the motor imply, at any instant.

    a = (F - viscous·v - coulomb)/inertia; limits that vary in time count by their widest.
    """
    limits, load, way = problem.limits, problem.load, problem.one_way
    velocity = _range(limits.velocity)
    if limits.envelope is not None:
        velocity = _both(velocity, (-limits.envelope.speed[-1], limits.envelope.speed[-1]))
    force = available_force(problem, velocity)
    acceleration = _range(limits.acceleration)
    if isinstance(load.inertia, float) and load.force is None and (way or not load.coulomb):
        drag = [load.viscous * v if load.viscous else 0.0 for v in velocity]
        low, high = ((force[k] - drag[1 - k] - way * load.coulomb) / load.inertia for k in (0, 1))
        if load.coulomb:  # at rest friction takes any value up to Coulomb's, and the axis may stay
            low, high = min(low, 0.0), max(high, 0.0)
        acceleration = _both(acceleration, (low, high))
    found = {"velocity": velocity, "force": force, "acceleration": acceleration}
    changed = {name: _limit(*pair) for name, pair in found.items() if pair != _range(getattr(limits, name))}
    return problem.model_copy(update={"limits": limits.model_copy(update=changed)}) if changed else problem


def available_force(problem: Problem, velocity: tuple[float, float]) -> tuple[float, float]:
    """The least and greatest force that the limits allow at any velocity of a range."""
    found = _range(problem.limits.force)
    for name in ("current", "voltage", "envelope"):
        found = _both(found, forces(problem, name, velocity))
    return found


def forces(problem: Problem, name: str, velocity: tuple[float, float]) -> tuple[float, float]:
    """What one limit of the motor leaves of the force at any velocity of a range: the least and the greatest."""
    limits, motor = problem.limits, problem.load.motor
    if name == "envelope":
        if limits.envelope is None:
            return -np.inf, np.inf
        slowest = 0.0 if velocity[0] <= 0 <= velocity[1] else min(abs(velocity[0]), abs(velocity[1]))
        most = float(np.interp(slowest, limits.envelope.speed, limits.envelope.force))
        return -most, most
    low, high = _range(getattr(limits, name))
    if motor is None:
        return -np.inf, np.inf
    constant, resistance = motor
    if name == "current":
        return constant * low, constant * high
    return (  # voltage, less the one that the velocity induces
        constant / resistance * (low - constant * velocity[1]),
        constant / resistance * (high - constant * velocity[0]),
    )


def _range(limit: Limit | None) -> tuple[float, float]:
    return (-np.inf, np.inf) if limit is None else (limit.lowest, limit.highest)


def _both(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    return max(a[0], b[0]), min(a[1], b[1])


def _limit(low: float, high: float) -> Limit | None:
    sides = {side: x for side, x in (("min", low), ("max", high)) if np.isfinite(x)}
    return Limit(**sides) if sides else None
