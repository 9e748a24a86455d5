"""Quantities: what can be limited or minimised, from the chain of derivatives and the load.

force = inertia·a + viscous·v + coulomb·sign(v) (Clemen & Rupp eq. 13, 14); power = force·v (eq. 7); energy = ∫|P|dt
(eq. 12).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from trajopt import signals
from trajopt.mesh import Mesh
from trajopt.problem import DERIVATIVES, Problem
from trajopt.scaling import Sizes
from trajopt.schemes import Scheme
from trajopt.signals import Signal


@dataclass(frozen=True)
class Quantities:
    """The quantities of one transcribed move, on a model's expressions or on floats."""

    problem: Problem
    model: Any
    scheme: Scheme
    mesh: Mesh
    sizes: Sizes
    chain: list[Any]  # (N+1,) each below the order, (N,) at the order; position as displacement from the start
    steps: Any  # (N,) s

    def signal(self, name: str) -> Signal:
        """A quantity by name, SI; position is the displacement from the start."""
        if name in DERIVATIVES:
            return self.scheme.signal(self.model, self.chain, DERIVATIVES.index(name), self.steps)
        return self._force() if name == "force" else self._power()

    def _force(self) -> Signal:
        load, model = self.problem.load, self.model
        force = signals.product(model, self._inertia(), self.signal("acceleration"))
        velocity = self.signal("velocity")
        if load.viscous:
            viscous = signals.constant(load.viscous, self.mesh.intervals)
            force = signals.plus(model, force, signals.product(model, viscous, velocity))
        if load.coulomb:
            force = signals.plus(model, force, self._coulomb(velocity))
        return force

    def _inertia(self) -> Signal:
        inertia = self.problem.load.inertia
        if isinstance(inertia, float) or inertia is None:
            return signals.constant(inertia, self.mesh.intervals)
        return signals.linear(inertia.at(self.mesh.fractions * (self.problem.move.fixed_time or 0.0)))

    def _coulomb(self, velocity: Signal) -> Signal:
        coulomb, way = self.problem.load.coulomb, self.problem.one_way
        if way:
            return signals.constant(way * coulomb, self.mesh.intervals)
        nodes, pieces = self.model.signs(velocity, self.sizes.derivative[1])
        return Signal(coulomb * nodes, tuple(coulomb * piece for piece in pieces) if velocity.pieces else ())

    def _power(self) -> Signal:
        return signals.product(self.model, self._force(), self.signal("velocity"))


def is_affine(problem: Problem, name: str) -> bool:
    """Whether a quantity is affine in the kinematic variables, at a fixed duration."""
    if name == "force":
        return not problem.load.coulomb or problem.one_way != 0
    return name not in ("power", "energy", "time")
