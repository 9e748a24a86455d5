"""Characteristic sizes: what each signal can reach in this move, so that every solver sees numbers of size one.

Unscaled, solvers call wrong answers optimal: in nanometres an end error of 2000 %, in 1e6 units a feasible move
infeasible. With these sizes metres, nanometres and kilometres give the same program.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final

import numpy as np

from trajopt.motor import available_force
from trajopt.problem import DERIVATIVES, Load, Problem

_FACTORS: Final = (1.0, 4.0, 16.0, 128.0, 1024.0)  # of a change over its time to the power of their index


@dataclass(frozen=True)
class Sizes:
    """``derivative[i]``: size of the i-th derivative, SI; ``duration`` in s; ``force`` N or N m; ``power`` W; with a
    motor ``current`` A, ``voltage`` V, ``heat`` (copper) and ``losses`` (of all kinds) W."""

    derivative: tuple[float, ...]
    duration: float
    force: float
    current: float = 1.0
    voltage: float = 1.0
    heat: float = 1.0
    losses: float = 0.0

    @property
    def power(self) -> float:
        """Size of a power, W."""
        return self.force * self.derivative[1]

    def of(self, quantity: str) -> float:
        """Size of a quantity by name, SI."""
        if quantity in DERIVATIVES:
            return self.derivative[DERIVATIVES.index(quantity)]
        electrical = self.power + self.losses
        return {
            "force": self.force,
            "envelope": self.force,
            "rms_force": self.force,
            "power": self.power,
            "energy": self.power * self.duration,
            "current": self.current,
            "voltage": self.voltage,
            "heat": self.heat,
            "electrical_power": electrical,
            "brake_energy": electrical * self.duration,
            "time": self.duration,
        }[quantity]


def sizes_of(problem: Problem, order: int | None = None) -> Sizes:
    """The sizes of a problem: min(limit, what the stroke needs), but never below a boundary value.

    The stroke needs 4 D/T, 16 D/T², 128 D/T³, 1024 D/T⁴ at most when it is comfortably feasible, as does the way from
    one via state to the next in its time. A limit also bounds what lies below it, by what can be gained in the
    duration.
    """
    order = order or problem.order
    duration = problem.move.fixed_time or _free_duration(problem)
    stroke = _stroke(problem, duration)
    derivative, legs = [stroke], _legs(problem, duration)
    for i in range(1, order + 1):
        limit = min(_largest(problem, DERIVATIVES[k]) * duration ** (k - i) for k in range(i, order + 1))
        needs = (_FACTORS[i - j] * change / time ** (i - j) for j, change, time in legs if j < i)
        reach = min(limit, max(_FACTORS[i] * stroke / duration**i, *needs, 0.0))
        derivative.append(max(reach, *(abs(x) for x in _given(problem, i)), 1e-9 * min(limit, stroke / duration**i)))
    return _of_chain(problem.load, tuple(derivative), duration)


def resized(sizes: Sizes, problem: Problem, chain: Sequence[Any]) -> Sizes:
    """The sizes that a move really has, from the derivatives found: where it stays far below what it can reach."""
    peaks = (float(np.max(np.abs(x))) for x in chain)
    derivative = tuple(max(peak, 1e-6 * size) for peak, size in zip(peaks, sizes.derivative, strict=True))
    return _of_chain(problem.load, derivative, sizes.duration)


def _of_chain(load: Load, derivative: tuple[float, ...], duration: float) -> Sizes:
    inertia = load.inertia
    mass = 0.0 if inertia is None else inertia if isinstance(inertia, float) else max(inertia.value)
    force = mass * derivative[2] + load.viscous * derivative[1] + load.coulomb
    force += 0.0 if load.force is None else max(map(abs, load.force.value))
    return _with_motor(load, Sizes(derivative, duration, force or 1.0))


def _with_motor(load: Load, sizes: Sizes) -> Sizes:
    if load.motor is None:
        return sizes
    constant, resistance = load.motor
    current, speed = sizes.force / constant, sizes.derivative[1]
    heat = resistance * current**2
    losses = heat + load.switching * current + load.eddy * (speed * current) ** 2
    losses += load.hysteresis * speed * current**load.hysteresis_exponent
    return replace(sizes, current=current, voltage=resistance * current + constant * speed, heat=heat, losses=losses)


def _given(problem: Problem, i: int) -> list[float]:
    states = (problem.move.start, problem.move.end, *problem.move.via)
    values = [getattr(state, DERIVATIVES[i], None) for state in states]
    return [float(x) for x in values if isinstance(x, float)] or [0.0]


def _largest(problem: Problem, name: str) -> float:
    limit = getattr(problem.limits, name)
    return math.inf if limit is None else max(abs(limit.lowest), abs(limit.highest))


def _largest_side(problem: Problem, name: str) -> float:
    """Of the sides that a limit has: one alone makes a move from rest to rest take its time."""
    limit = getattr(problem.limits, name)
    sides = () if limit is None else (abs(limit.lowest), abs(limit.highest))
    return max((side for side in sides if math.isfinite(side)), default=math.inf)


def _legs(problem: Problem, duration: float) -> list[tuple[int, float, float]]:
    """(derivative, its change in size, s) from each state at which it is given to the next; none without via states."""
    move, found = problem.move, []
    via = [(state.time, state, None) for state in move.via]
    timed = [(0.0, move.start, 0.0), *via, (duration, move.end, 0.0)] if via else []
    for i in range(problem.order):
        given = [(t, state.fixed(i + 1, default).get(i)) for t, state, default in timed]
        known = [(t, x) for t, x in given if x is not None]
        found += [(i, abs(x - y), t - s) for (s, y), (t, x) in pairwise(known)]
    return found


def _stroke(problem: Problem, duration: float) -> float:
    """How far the axis goes, in m or rad: between given positions, or by the given velocities and accelerations."""
    positions = _given(problem, 0) + [problem.move.start_position or 0.0]
    reach = [max(positions) - min(positions)]
    reach += [abs(v) * duration for v in _given(problem, 1)]
    reach += [abs(a) * duration**2 / 2 for a in _given(problem, 2)]
    if any(reach):
        return max(reach)
    by_limits = [_largest(problem, DERIVATIVES[i]) * duration**i for i in (1, 2, 3, 4)]
    if (room := problem.limits.position) is not None:
        by_limits.append(room.highest - room.lowest)
    finite = [x for x in by_limits if math.isfinite(x)]
    return min(finite) if finite else 1.0


def _free_duration(problem: Problem) -> float:
    """An estimate of a free duration: the middle of its range, or what the limits allow for the stroke."""
    if isinstance(problem.move.time, tuple):
        return math.sqrt(problem.move.time[0] * problem.move.time[1])
    positions = _given(problem, 0) + [problem.move.start_position or 0.0]
    stroke = max(positions) - min(positions)
    if not stroke:
        velocity = max(abs(x) for x in _given(problem, 1))
        acceleration = _largest(problem, "acceleration")
        return 2 * velocity / acceleration if velocity and math.isfinite(acceleration) else 1.0
    factors = {"velocity": 1.0, "acceleration": 4.0, "jerk": 32.0, "snap": 512.0}
    times = [
        (factor * stroke / largest) ** (1 / i)
        for i, (name, factor) in enumerate(factors.items(), 1)
        if math.isfinite(largest := _largest_side(problem, name)) and largest
    ]
    if problem.load.inertia is not None:
        mass = problem.load.inertia if isinstance(problem.load.inertia, float) else max(problem.load.inertia.value)
        low, high = available_force(problem, (0.0, 0.0))
        if math.isfinite(strongest := max(abs(low), abs(high))):
            times.append(math.sqrt(4 * stroke * mass / strongest))
    return max(times, default=1.0)
