"""What the optimum is in continuous time, where the velocity domain knows it, and the arcs of a motor's move.

With speed as the independent variable (`trajopt.velocity_domain`) two kinds of one-way moves from rest to rest have
optima that no mesh limits: a servomotor without a jerk limit, and a mass under one. A solution of such a problem says
by how much its mesh misses them, and names the arcs of the motor's optimum (Wang, Ueda & Bortoff) with switch times and
the necessary conditions. Other moves of a motor have their arcs read off the trajectory, to an interval.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import groupby
from math import inf, isfinite, sqrt
from typing import Any, Final

import numpy as np

from trajopt import velocity_domain as vd
from trajopt.errors import InternalError
from trajopt.fields import Limit
from trajopt.mesh import Floats
from trajopt.problem import Problem
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Setting

_BELOW: Final = 1e-6  # relative: an answer this far below the optimum contradicts it
_ZERO: Final = 1e-3  # of the peak current: below it the control counts as zero
_AT: Final = 1e-6  # relative: this close to a limit is on it
_PROVEN: Final = ("energy", "power linf")  # of the others, the best peak speed comes from a search on a grid


@dataclass(frozen=True)
class MassOptimum:
    """The least energy (J), or norm of power (W), of a mass, without the weight of the objective, and the ramps of the
    move that has it."""

    value: float
    ramps: tuple[vd.Ramp, vd.Ramp]

    def on(self, setting: Setting) -> Trajectory:
        """The move at the nodes of a mesh, to linearise power at; between them it is nearly one."""
        problem, mesh, scheme, sizes = setting.problem, setting.mesh, setting.scheme, setting.sizes
        duration = problem.move.fixed_time or 0.0
        steps = mesh.steps * duration
        found = vd.over_time(self.ramps, duration, mesh.fractions * duration)
        speed, acceleration = (problem.one_way * x for x in found)
        position = np.concatenate([[0.0], np.cumsum(steps * (speed[1:] + speed[:-1]) / 2)])
        chain: tuple[Floats, ...] = (position, speed, acceleration, np.diff(acceleration) / steps)
        if problem.order == 2:
            chain = (position, speed, np.diff(speed) / steps)
        return Trajectory(problem, mesh, scheme, sizes, duration, problem.move.start_position or 0.0, chain)


def mass_optimum(problem: Problem) -> MassOptimum | None:
    """The optimum in continuous time of a mass without friction, under limits of velocity, acceleration and jerk, for
    what its power is; None for other problems. A power limit plays no part in it."""
    if len(problem.objective.all_terms) != 1 or not _one_way_rest_to_rest(problem) or not _mass_alone(problem):
        return None
    try:
        return _mass_optimum(problem)
    except (ValueError, RuntimeError, ArithmeticError):  # too little time, not met to a billionth, absurd numbers
        return None


def findings(
    problem: Problem, trajectory: Trajectory, metrics: Mapping[str, float], mass: MassOptimum | None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """What joins the certificate and the structure of a solved problem, whose `mass_optimum` is ``mass``: both empty
    where nothing is known.

    Raises InternalError when an answer is better than an optimum in continuous time that is proven.
    """
    if len(problem.objective.all_terms) != 1 or not _one_way_rest_to_rest(problem):
        return {}, _on_mesh(trajectory)
    if mass is not None and _is_idle(problem.limits.power, metrics):
        return _certificate(problem, mass.value, metrics), _on_mesh(trajectory)
    if _motor_alone(problem):
        try:
            optimum = _servo(problem)
        except (ValueError, RuntimeError):  # too little time, or not met to a billionth
            return {}, _on_mesh(trajectory)
        if certificate := _certificate(problem, optimum.energy, metrics):
            return certificate, _structure(optimum)
    return {}, _on_mesh(trajectory)


def _certificate(problem: Problem, optimum: float, metrics: Mapping[str, float]) -> dict[str, Any]:
    """The optimum, and how far above it the answer is between its nodes; empty where an answer that is better shows
    that a search without proof missed it."""
    (term,) = problem.objective.terms
    measured = metrics[_METRICS[term.label]]
    above = measured / optimum - 1
    if above < -_BELOW and term.label in _PROVEN:
        raise InternalError(f"the answer {measured!r} is below the optimum in continuous time, {optimum!r}")
    if above < -_BELOW:
        return {}
    return {"continuous_optimum": term.weight * optimum, "above_continuous": above}


_METRICS: Final = {
    "energy": "energy", "power linf": "peak_power", "power l2": "rms_power", "electrical_energy": "electrical_energy",
    "copper_loss": "copper_loss",
}  # fmt: skip


def _one_way_rest_to_rest(problem: Problem) -> bool:
    move, load = problem.move, problem.load
    states = [state.fixed(problem.order) for state in (move.start, move.end)]
    at_rest = all(state.get(i) == 0.0 for state in states for i in range(1, problem.order))
    placed = isinstance(move.end.position, float) and move.start_position is not None
    plain = not move.via and not problem.vibration and problem.transcription.scheme == "exact"
    constant = isinstance(load.inertia, float) and not load.curves
    constant = constant and not any(x.varies for x in problem.limits.given.values())
    moves = problem.one_way and move.fixed_time and placed and _distance(problem) > 0
    return bool(at_rest and plain and constant and moves)


def _distance(problem: Problem) -> float:
    """How far the axis goes in its one way."""
    end = problem.move.end.position
    assert isinstance(end, float)
    return problem.one_way * (end - (problem.move.start_position or 0.0))


def _motor_alone(problem: Problem) -> bool:
    """A motor without a jerk limit, for what it takes or loses."""
    known = {"velocity", "acceleration", "current", "voltage"}
    wanted = problem.objective.terms[0].minimize in ("electrical_energy", "copper_loss")
    return wanted and problem.order == 2 and set(problem.limits.given) <= known


def _mass_alone(problem: Problem) -> bool:
    """A mass without friction for what its power is; of limits, those of velocity, acceleration, jerk and power."""
    load, wanted = problem.load, problem.objective.terms[0].label in ("energy", "power linf", "power l2")
    known = {"velocity", "acceleration", "jerk", "power"}
    return wanted and not (load.viscous or load.coulomb) and problem.order <= 3 and set(problem.limits.given) <= known


def _is_idle(power: Limit | None, metrics: Mapping[str, float]) -> bool:
    """Whether a power limit is none to a move: one that stays below it."""
    return power is None or metrics["peak_power"] < min(power.highest, -power.lowest) * (1 - 1e-3)


def _ways(problem: Problem, name: str) -> tuple[float, float]:
    """A limit along the move and against it, as sizes."""
    limit = problem.limits.given.get(name)
    if limit is None:
        return inf, inf
    along, against = limit.highest, -limit.lowest
    return (along, against) if problem.one_way > 0 else (against, along)


def _servo(problem: Problem) -> vd.ServoOptimum:
    load, motor_limits = problem.load, {name: min(_ways(problem, name)) for name in ("current", "voltage")}
    assert isinstance(load.inertia, float) and load.torque_constant and load.resistance
    motor = vd.Servomotor(
        load.torque_constant, load.resistance, load.inertia, load.viscous, load.coulomb, load.switching, load.eddy,
        load.hysteresis, load.hysteresis_exponent, load.recovery,
    )  # fmt: skip
    faster, slower = _ways(problem, "acceleration")
    limits = vd.Limits(_ways(problem, "velocity")[0], faster, slower, **motor_limits)
    objective: Any = "copper" if problem.objective.terms[0].minimize == "copper_loss" else "energy"
    return vd.optimum(motor, _distance(problem), problem.move.fixed_time or 0.0, limits, objective)


def _mass_optimum(problem: Problem) -> MassOptimum:
    duration, mass = problem.move.fixed_time or 0.0, problem.load.inertia
    assert isinstance(mass, float)
    faster, slower = _ways(problem, "acceleration")
    jerk = min(_ways(problem, "jerk"))
    axis = vd.Axis(mass, _distance(problem), duration, _ways(problem, "velocity")[0], faster, slower, jerk)
    label = problem.objective.terms[0].label
    if label == "energy":
        peak = vd.least_peak(axis)
        return MassOptimum(mass * peak**2, axis.shortest(peak))
    if label == "power linf":
        found = vd.least_peak_power(axis)
        return MassOptimum(found.power, axis.shortest(found.peak, found.power))
    square = vd.least_square_power(axis)
    return MassOptimum(sqrt(square.value / duration), square.ramps)


def _structure(optimum: vd.ServoOptimum) -> dict[str, Any]:
    """Arcs and sub-trajectories of the optimum in continuous time, and the necessary conditions on it."""
    found = asdict(vd.conditions(optimum)).items()
    checked = {key: None if isinstance(x, float) and not isfinite(x) else x for key, x in found}
    return {
        "of": "the optimum in continuous time",
        "sequence": optimum.sequence,
        "arcs": [{"from": arc.start, "to": arc.end, "name": arc.name} for arc in optimum.arcs],
        "subtrajectories": [{"from": arc.start, "to": arc.end, "name": arc.name} for arc in optimum.subtrajectories],
        "peak_velocity": optimum.peak,
        "conditions": checked,
    }


def _on_mesh(trajectory: Trajectory) -> dict[str, Any]:
    """The arcs of a motor's one-way move, to an interval: the sign of its current, and A or V on a limit of
    acceleration or velocity, U elsewhere; Z without current. Empty without a motor."""
    problem = trajectory.problem
    if not problem.load.torque_constant or not problem.one_way or trajectory.scheme.terms == 1:
        return {}
    current, velocity, acceleration = (_middles(trajectory, name) for name in ("current", "velocity", "acceleration"))
    names = []
    for u, v, a in zip(problem.one_way * current, velocity, acceleration, strict=True):
        limited = "A" if _on_limit(problem, "acceleration", a) else "V" if _on_limit(problem, "velocity", v) else "U"
        sign = "P" if u > 0 else "N"
        names.append("Z" if abs(u) <= _ZERO * np.max(np.abs(current)) else sign + limited)
    arcs: list[dict[str, Any]] = []
    k = 0
    for name, group in groupby(names):
        count = len(list(group))
        arcs.append({"from": float(trajectory.time[k]), "to": float(trajectory.time[k + count]), "name": name})
        k += count
    return {"of": "the trajectory, to an interval", "sequence": "-".join(arc["name"] for arc in arcs), "arcs": arcs}


def _middles(trajectory: Trajectory, name: str) -> Any:
    """(N,) a signal in the middle of the intervals, roughly: the mean of its Bernstein coefficients."""
    return np.mean(trajectory.signal(name).rows, axis=0)


def _on_limit(problem: Problem, name: str, value: float) -> bool:
    limit = problem.limits.given.get(name)
    if limit is None:
        return False
    sides = (side for side in (limit.lowest, limit.highest) if side and isfinite(side))
    return any(abs(value - side) <= _AT * abs(side) for side in sides)
