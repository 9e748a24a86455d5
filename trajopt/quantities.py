"""Quantities: what can be limited or minimised, from the chain of derivatives and the load.

force = inertia·a + viscous·v + coulomb·sign(v) (Clemen & Rupp eq. 13, 14); power = force·v (eq. 7); energy = ∫|P|dt
(eq. 12). Where inertia or the load's own force are curves over position, force = F(q) + ½ J'(q) v² + J(q) a + friction
(Van Oosterwyck et al. eq. 1). What is electrical is in `trajopt.motor`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from trajopt import motor, signals
from trajopt.curve import Curve
from trajopt.fields import Table
from trajopt.mesh import Mesh
from trajopt.problem import DERIVATIVES, Load, Problem
from trajopt.scaling import Sizes
from trajopt.schemes import Scheme
from trajopt.signals import LOBATTO, BetweenReversals, OnFloats, Signal

FORCES: Final = ("force", "current", "voltage", "envelope", "rms_force", "copper_loss")  # affine but for friction


_FITTED: Final = (1 - np.cos(np.linspace(0.0, np.pi, 11))) / 2


def force_along(model: Any, load: Load, position: Any, velocity: Any, acceleration: Any) -> Any:
    """F(q) + ½ J'(q) v² + J(q) a + viscous·v, N or N m: what a load with curves over position takes but for Coulomb
    friction, from vectors of position (absolute), velocity and acceleration."""
    inertia, force = load.inertia, load.force
    wanted = [(inertia, 0), (inertia, 1)] if isinstance(inertia, Curve) else []
    found = model.along(position, wanted + ([] if force is None else [(force, 0)]))
    total = model.times(found[0] if wanted else inertia, acceleration)
    if wanted:
        total = total + model.times(model.times(0.5, found[1]), model.squares(velocity))
    if load.viscous:
        total = total + model.times(load.viscous, velocity)
    return total if force is None else total + found[-1]


@dataclass(frozen=True)
class Quantities:
    """The quantities of one transcribed move, on a model's expressions or on floats."""

    problem: Problem
    model: Any
    scheme: Scheme
    mesh: Mesh
    sizes: Sizes
    chain: list[Any]  # (N+1,) each below the order, (N,) at the order; position as displacement, or at waypoints only
    steps: Any  # (N,) s

    def signal(self, name: str) -> Signal:
        """A quantity by name, SI, made once; position is the displacement from the start."""
        if name not in self._known:
            self._known[name] = self._made(name)
        return self._known[name]

    @cached_property
    def _known(self) -> dict[str, Signal]:
        return {}

    def _made(self, name: str) -> Signal:
        if name in DERIVATIVES:
            return self.scheme.signal(self.model, self.chain, DERIVATIVES.index(name), self.steps)
        made = {
            "force": self._force,
            "power": self._power,
            "current": self._current,
            "voltage": self._voltage,
            "heat": self._heat,
            "electrical_power": self._electrical_power,
        }
        return made[name]()

    def mix(self, force: float, velocity: float) -> Signal:
        """force·F + velocity·v: a current, a voltage, a side of an envelope."""
        count, model = self.mesh.intervals, self.model
        parts = [(force, "force"), (velocity, "velocity")]
        found = [signals.product(model, signals.constant(x, count), self.signal(name)) for x, name in parts if x]
        return found[0] if len(found) == 1 else signals.plus(model, *found)

    def returned(self) -> Signal:
        """An upper bound on the power that a motor feeds back, -P, by polynomials (by values for a load over position):
        |u| is more than its own smoothed sign times u, and |u|^γ more than its tangent at the middle of an interval."""
        load, model, count = self.problem.load, self.model, self.mesh.intervals
        assert load.motor is not None
        current, velocity, force = (self.signal(name) for name in ("current", "velocity", "force"))

        def product(*factors: Signal | float) -> Signal:
            found = signals.constant(1.0, count)
            for factor in factors:
                factor = signals.constant(factor, count) if isinstance(factor, float) else factor
                found = signals.product(model, found, factor)
            return found

        parts = [product(-1.0, force, velocity), product(-load.motor[1], current, current)]
        if load.switching:
            parts.append(product(-load.switching, current, self._sign(current, self.sizes.current)))
        if load.eddy:
            parts.append(product(-load.eddy, current, current, velocity, velocity))
        if load.hysteresis:
            speed = product(velocity, self._sign(velocity, self.sizes.derivative[1]))
            parts.append(product(-load.hysteresis, speed, self._tangent(current)))
        total = parts[0]
        for part in parts[1:]:
            total = signals.plus(model, total, part)
        return total

    def _sign(self, signal: Signal, size: float) -> Signal:
        if signal.points:
            return signals.sampled([self.model.signs(Signal(x, ()), size)[0] for x in signal.stations], signal)
        nodes, pieces = self.model.signs(signal, size)
        return Signal(nodes, pieces if signal.pieces else ())

    def _tangent(self, current: Signal) -> Signal:
        """|u|^γ at the nodes, and its tangent at the middle of every interval."""
        load, model = self.problem.load, self.model
        exponent, size = load.hysteresis_exponent, self.sizes.current
        if current.points:
            return signals.sampled([model.raised(x, exponent, size)[0] for x in current.stations], current)
        nodes = None if current.nodes is None else model.raised(current.nodes, exponent, size)[0]
        if not current.pieces:
            return Signal(nodes, ())
        middle = sum(current.pieces[1:], current.pieces[0]) * (1 / len(current.pieces))
        value, slope = model.raised(middle, exponent, size)
        return Signal(nodes, tuple(value + model.times(slope, x - middle) for x in current.pieces))

    def _current(self) -> Signal:
        assert self.problem.load.motor is not None
        return self.mix(1 / self.problem.load.motor[0], 0.0)

    def _voltage(self) -> Signal:
        assert self.problem.load.motor is not None
        constant, resistance = self.problem.load.motor
        return self.mix(resistance / constant, constant)

    def _heat(self) -> Signal:
        load, size, current = self.problem.load, self.sizes.current, self.signal("current")
        return signals.sampled([motor.copper(self.model, load, u, size) for u in current.stations], current)

    def _electrical_power(self) -> Signal:
        load, model, size = self.problem.load, self.model, self.sizes.current
        found = [
            motor.heat(model, load, u, size) + motor.iron(model, load, u, self._speed(v), size) + model.times(force, v)
            for force, v, u in self.ends("force", "velocity", "current")
        ]
        return signals.sampled(found, self.signal("force"))

    def ends(self, *names: str) -> list[tuple[Any, ...]]:
        """Signals by name where force is sampled: see `trajopt.signals.Signal.stations`."""
        force = self.signal("force")
        found = (force if name == "force" else self.signal(name) for name in names)
        return list(zip(*(signal.where(self.model, force) for signal in found), strict=True))

    def _speed(self, velocity: Any) -> Any:
        """|v| at samples."""
        way = self.problem.one_way
        return self.model.times(way, velocity) if way else self.model.raised(velocity, 1.0, self.sizes.derivative[1])[0]

    def _force(self) -> Signal:
        load, model = self.problem.load, self.model
        if load.curves:
            return self._along()
        force = self._inertial()
        velocity = self.signal("velocity")
        if load.viscous:
            viscous = signals.constant(load.viscous, self.mesh.intervals)
            force = signals.plus(model, force, signals.product(model, viscous, velocity))
        if load.coulomb:
            force = signals.plus(model, force, self._coulomb(velocity))
        return force

    def _along(self) -> Signal:
        """Force of a load over position: at the Lobatto points of the intervals; polynomials where metrics ask."""
        position, velocity, acceleration = (self.signal(name) for name in DERIVATIVES[:3])
        if isinstance(self.model, BetweenReversals):
            at = [[x.within(self.model, s) for x in (position, velocity, acceleration)] for s in _FITTED]
            force = signals.fitted([self._smooth(q, v, a) for q, v, a in at], _FITTED)
            coulomb = self.problem.load.coulomb
            return signals.plus(self.model, force, self._coulomb(velocity)) if coulomb else force
        jumps = acceleration.nodes is None
        inner = Signal(acceleration.nodes, (), LOBATTO if jumps else LOBATTO[1:-1])
        where = zip(*(x.where(self.model, inner) for x in (position, velocity, acceleration)), strict=True)
        return signals.sampled([self._smooth(q, v, a) + self._rubbing(v) for q, v, a in where], inner)

    def _smooth(self, displacement: Any, velocity: Any, acceleration: Any) -> Any:
        """The force at vectors of samples, but for Coulomb friction."""
        position = displacement + (self.problem.move.start_position or 0.0)
        return force_along(self.model, self.problem.load, position, velocity, acceleration)

    def _rubbing(self, velocity: Any) -> Any:
        """Coulomb friction at a vector of velocities."""
        coulomb, way = self.problem.load.coulomb, self.problem.one_way
        if not coulomb:
            return 0.0
        return coulomb * (way or self.model.signs(Signal(velocity, ()), self.sizes.derivative[1])[0])

    def holding(self) -> Any:
        """The force that holds a load over position at the end of the move."""
        force, move = self.problem.load.force, self.problem.move
        if force is None:
            return 0.0
        return self.model.along(self.chain[0][-1:] + (move.start_position or 0.0), [(force, 0)])[0][0]

    def _inertial(self) -> Signal:
        """What it takes to accelerate the load."""
        return signals.product(self.model, self._inertia(), self.signal("acceleration"))

    def _inertia(self) -> Signal:
        inertia = self.problem.load.inertia
        if isinstance(inertia, float) or inertia is None:
            return signals.constant(inertia, self.mesh.intervals)
        assert isinstance(inertia, Table)
        return signals.linear(inertia.at(self.mesh.fractions * (self.problem.move.fixed_time or 0.0)))

    def _coulomb(self, velocity: Signal) -> Signal:
        coulomb, way = self.problem.load.coulomb, self.problem.one_way
        stands = isinstance(self.model, OnFloats) and not np.any(velocity.nodes)  # friction holds it, at no cost
        if way and not stands:
            return signals.constant(way * coulomb, self.mesh.intervals)
        nodes, pieces = self.model.signs(velocity, self.sizes.derivative[1])
        return Signal(coulomb * nodes, tuple(coulomb * piece for piece in pieces) if velocity.pieces else ())

    def _power(self) -> Signal:
        return signals.product(self.model, self.signal("force"), self.signal("velocity"))


@dataclass(frozen=True)
class Driven(Quantities):
    """The quantities of a joint of an arm, whose ``torque`` follows from the motion of all joints."""

    torque: Signal

    def _inertial(self) -> Signal:
        return self.torque


def is_affine(problem: Problem, name: str) -> bool:
    """Whether a quantity is affine in the kinematic variables, at a fixed duration, or a square of what is."""
    if name in FORCES:
        return not problem.load.curves and (not problem.load.coulomb or problem.one_way != 0)
    return name not in ("power", "energy", "electrical_energy", "brake_energy", "time")
