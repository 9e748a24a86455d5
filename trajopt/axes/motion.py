"""A motion: the trajectories of all axes over one time grid, with the torques of the arm that couples them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import comb
from typing import Any, Final

import numpy as np

from trajopt.axes.objective import measure
from trajopt.axes.problem import AxesProblem
from trajopt.mesh import Floats
from trajopt.metrics import metrics
from trajopt.quantities import Driven
from trajopt.signals import OnFloats, Signal
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Transcript

_DEGREE: Final = 10  # of the polynomial through the torque of an interval


@dataclass(frozen=True)
class Motion:
    """``axes``: a trajectory each; ``release``: when the tip must have its velocity (s), None where it need not."""

    problem: AxesProblem
    axes: tuple[Trajectory, ...]
    release: float | None = None

    @property
    def duration(self) -> float:
        """The time of the slowest axis, s."""
        return max(axis.duration for axis in self.axes)

    @property
    def objective(self) -> float:
        """The SI value of the problem's objective."""
        return measure([axis.transcript for axis in self.axes], self.problem.objective)

    @property
    def metrics(self) -> dict[str, float]:
        """The metrics of every axis by its name: ``shoulder.peak_power``."""
        names = [axis.name for axis in self.problem.axes]
        found = [metrics(axis) for axis in self.axes]
        return {f"{name}.{key}": x for name, own in zip(names, found, strict=True) for key, x in own.items()}

    def at(self, t: Any) -> dict[str, dict[str, Floats]]:
        """By axis, position and its derivatives at times ``t`` (s), exactly; after its own end an axis stays there.
        Raises ValueError outside the motion."""
        t = np.asarray(t, dtype=float)
        if not np.all((t >= 0) & (t <= self.duration)):
            raise ValueError(f"t must be within 0 to {self.duration:g} s")
        names = [axis.name for axis in self.problem.axes]
        return {
            name: axis.at(np.minimum(t, axis.duration)) for name, axis in zip(names, self.axes, strict=True)
        }

    def joints(self, t: Any) -> tuple[list[Floats], list[Floats]]:
        """Positions and velocities of all axes at times ``t`` (s)."""
        found = self.at(t).values()
        return [x["position"] for x in found], [x["velocity"] for x in found]

    def tip(self, t: Any) -> dict[str, Floats]:
        """x, y (m) and vx, vy (m/s) of the arm's tip at times ``t`` (s)."""
        q, w = self.joints(t)
        arm = self.problem.dynamics
        return dict(zip(("x", "y", "vx", "vy"), (*arm.tip(q), *arm.tip_velocity(q, w)), strict=True))


def driven(problem: AxesProblem, axes: Sequence[Trajectory]) -> tuple[Trajectory, ...]:
    """The trajectories with the torques of the arm; unchanged where there is none."""
    if problem.dynamics is None:
        return tuple(axes)
    torques = _torques(problem.dynamics, axes)
    return tuple(
        replace(axis, quantities=partial(Driven, torque=torque)) for axis, torque in zip(axes, torques, strict=True)
    )


def loads(arm: Any, axes: Sequence[Transcript]) -> list[list[Any]]:
    """The torques of an arm where force is sampled: a list an axis, of one array at the nodes, or of two at the left
    and the right ends of the intervals where the acceleration jumps."""
    names = ("position", "velocity", "acceleration")
    like = axes[0].quantities.signal("acceleration")
    q, w, a = ([axis.quantities.signal(name).where(axis.model, like) for axis in axes] for name in names)
    origins = [axis.problem.move.start_position or 0.0 for axis in axes]
    found = []
    for k in range(len(q[0])):
        pose = [x[k] + origin for x, origin in zip(q, origins, strict=True)]
        found.append(arm.torque(pose, [x[k] for x in w], [x[k] for x in a]))
    return [list(of_axis) for of_axis in zip(*found, strict=True)]


def _torques(arm: Any, axes: Sequence[Trajectory]) -> list[Signal]:
    """The torque of every axis: at the nodes, and between them (exact scheme) the polynomial through 11 of its values,
    which misses it by rounding."""
    found = loads(arm, [axis.transcript for axis in axes])
    nodes = [of_axis[0] if len(of_axis) == 1 else None for of_axis in found]
    if axes[0].scheme.terms == 1:
        return [Signal(values, ()) for values in nodes]
    points = (1 - np.cos(np.pi * np.arange(_DEGREE + 1) / _DEGREE)) / 2
    samples = [_inside(arm, axes, s) for s in points]
    basis = np.array([[comb(_DEGREE, i) * s**i * (1 - s) ** (_DEGREE - i) for i in range(_DEGREE + 1)] for s in points])
    pieces = [np.linalg.solve(basis, np.array([sample[k] for sample in samples])) for k in range(len(axes))]
    return [Signal(values, tuple(piece)) for values, piece in zip(nodes, pieces, strict=True)]


def _inside(arm: Any, axes: Sequence[Trajectory], s: float) -> list[Floats]:
    """The torques at a fraction of every interval."""
    names = ("position", "velocity", "acceleration")
    q, w, a = ([axis.signal(name).within(OnFloats(), s) for axis in axes] for name in names)
    pose = [x + axis.origin for x, axis in zip(q, axes, strict=True)]
    return [np.asarray(x) for x in arm.torque(pose, w, a)]
