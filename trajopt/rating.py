"""Whether a motor is rated for a move at all: what can be seen without solving, and is certain for every profile.

Only limits of the motor are judged, each alone: current, voltage, torque-speed envelope.
"""

from __future__ import annotations

from math import isfinite, sqrt
from typing import Final

from trajopt import units
from trajopt.motor import forces
from trajopt.problem import Problem

_ROUNDING: Final = 1e-9
_JUDGED: Final = ("current", "voltage", "envelope")


def refuse_weak_motor(problem: Problem) -> None:
    """Raise ValueError for a motor that cannot overcome friction, reach the speed of the move, or be fast enough."""
    limits, move = problem.limits, problem.move
    _refuse_little_force(problem)
    if not any(getattr(limits, name) is not None for name in _JUDGED):
        return
    _ends(problem)
    if problem.load.curves:  # the load itself may help or hinder
        return
    start, end = (state.fixed(2) for state in (move.start, move.end))
    if 0 not in start or 0 not in end or start[0] == end[0] or problem.load.inertia is None:
        return
    distance, way = abs(end[0] - start[0]), 1 if end[0] > start[0] else -1
    if start.get(1) == 0.0:
        _stiction(problem, way)
    duration = move.time[1] if isinstance(move.time, tuple) else move.fixed_time
    if duration is None:
        return
    if way * start.get(1, way * float("inf")) < distance / duration:
        _speed(problem, way, distance / duration, "the mean speed of the move")
    if start.get(1, "start") == end.get(1, "end") and limits.velocity is not None:
        slowest = limits.velocity.lowest if way > 0 else -limits.velocity.highest
        if slowest > 0:
            _speed(problem, way, slowest, "the least speed of limits.velocity")
    if start.get(1) == end.get(1) == 0.0 and isinstance(problem.load.inertia, float):
        _duration(problem, way, distance, duration)


def _refuse_little_force(problem: Problem) -> None:
    """Raise ValueError for a force limit that cannot set the axis off from rest, or anywhere against friction."""
    force, (start, end) = problem.limits.force, (state.fixed(2) for state in (problem.move.start, problem.move.end))
    if force is None or 0 not in start or 0 not in end or start[0] == end[0] or start.get(1) != 0.0:
        return
    most, coulomb = force.highest if end[0] > start[0] else -force.lowest, problem.load.coulomb
    if coulomb and most <= coulomb * (1 - _ROUNDING):
        kinds = units.kinds(problem.rotary)["force"]
        raise ValueError(
            f"limits.{problem.shown('force')}: {most:.6g} {kinds.unit} at most in the direction of the move cannot set"
            f" it off against load.coulomb = {coulomb:.6g} {kinds.unit}; raise it"
        )


def _ends(problem: Problem) -> None:
    envelope = problem.limits.envelope
    for where, state in (("start", problem.move.start), ("end", problem.move.end)):
        velocity = state.fixed(2).get(1, 0.0)
        if envelope is not None and abs(velocity) > envelope.speed[-1] * (1 + _ROUNDING):
            unit = units.kinds(problem.rotary)["velocity"].unit
            raise ValueError(
                f"move.{where}.velocity: {velocity:.9g} {unit} is beyond limits.envelope, which ends at"
                f" {envelope.speed[-1]:.9g} {unit}"
            )


def _pushing(problem: Problem, way: int, velocity: tuple[float, float]) -> dict[str, tuple[float, float]]:
    """By limit, the most force against and along a direction at speeds of a range in it."""
    along = velocity if way > 0 else (-velocity[1], -velocity[0])
    found = {name: forces(problem, name, along) for name in _JUDGED}
    return {name: (-low, high) if way > 0 else (high, -low) for name, (low, high) in found.items()}


def _stiction(problem: Problem, way: int) -> None:
    unit, coulomb = units.kinds(problem.rotary)["force"].unit, problem.load.coulomb
    for name, (_, most) in _pushing(problem, way, (0.0, 0.0)).items():
        if most <= coulomb * (1 - _ROUNDING) or most <= 0:
            raise ValueError(
                f"limits.{name}: gives the motor at most {most:.6g} {unit} at standstill, which cannot move the load"
                f" against load.coulomb = {coulomb:.6g} {unit}; raise it"
            )


def _speed(problem: Problem, way: int, speed: float, what: str) -> None:
    """At some time the axis has this speed (or more, which is harder) and does not slow down."""
    kinds, load = units.kinds(problem.rotary), problem.load
    friction = load.coulomb + load.viscous * speed
    envelope = problem.limits.envelope
    if envelope is not None and speed > envelope.speed[-1] * (1 + _ROUNDING):
        raise ValueError(
            f"limits.envelope: ends at {envelope.speed[-1]:.6g} {kinds['velocity'].unit}, below {what},"
            f" {speed:.6g} {kinds['velocity'].unit}; extend it, or give the move more time"
        )
    for name, (_, most) in _pushing(problem, way, (speed, speed)).items():
        if most >= friction - _ROUNDING * abs(most):
            continue
        at = f"{what}, {speed:.6g} {kinds['velocity'].unit}"
        if name == "voltage" and load.motor is not None:
            constant, resistance = load.motor
            needed = resistance / constant * friction + constant * speed
            raise ValueError(
                f"limits.voltage: is too low for {at}, which takes {needed:.6g} V; raise it, or give the move more time"
            )
        raise ValueError(
            f"limits.{name}: leaves {most:.6g} {kinds['force'].unit} at {at}, where friction takes {friction:.6g}"
            f" {kinds['force'].unit}; raise it, or give the move more time"
        )


def _duration(problem: Problem, way: int, distance: float, duration: float) -> None:
    """From rest to rest a move takes at least that of full force along and then against it."""
    load = problem.load
    assert isinstance(load.inertia, float)
    for name, (_, most) in _pushing(problem, way, (0.0, 0.0)).items():
        speeding = (most - load.coulomb) / load.inertia
        if not isfinite(speeding) or speeding <= 0:
            continue
        fastest = speeding * duration
        against = _pushing(problem, way, (0.0, fastest))[name][0]
        braking = (against + load.coulomb + load.viscous * fastest) / load.inertia
        least = sqrt(2 * distance * (1 / speeding + 1 / braking))
        if least > duration * (1 + 1e-6):
            unit = units.kinds(problem.rotary)["acceleration"].unit
            raise ValueError(
                f"limits.{name}: gives the motor at most {speeding:.6g} {unit}, with which the move takes {least:.6g} s"
                f" or more, and move.time is {duration:.6g} s; raise either"
            )
