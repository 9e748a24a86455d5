"""What an optimum saves against the profiles that drives offer: trapezoid, S-curve, quintic, of the same duration.

For rest-to-rest moves of fixed time, and objectives that a load is paid by. Each profile is laid on a fine mesh of
constant accelerations and measured as the optimum is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, sqrt
from typing import Any, Final

import numpy as np
from scipy.optimize import minimize_scalar

from trajopt.mesh import Floats, Mesh
from trajopt.problem import DERIVATIVES, Problem
from trajopt.scaling import sizes_of
from trajopt.schemes import EXACT
from trajopt.trajectory import Trajectory

_INTERVALS: Final = 600
_LIMITED: Final = DERIVATIVES[1:4]
_RAMPS: Final = np.linspace(0.01, 0.5, 50)  # shares of the duration, looked at before the best one is refined


@dataclass(frozen=True)
class Profile:
    """A symmetric rest-to-rest profile of stroke 1 in time 1: its velocity (M,) at times (M,), and its ``peaks`` of
    velocity, acceleration and jerk, which is infinite where acceleration jumps."""

    velocity: Callable[[Floats], Floats]
    peaks: tuple[float, float, float]


def trapezoid(ramp: float) -> Profile:
    """Constant acceleration for a share ``ramp`` of the time, cruise, constant deceleration."""
    top = 1 / (1 - ramp)
    return Profile(lambda t: np.minimum(np.minimum(t, 1 - t) * (top / ramp), top), (top, top / ramp, inf))


def s_curve(ramp: float, jerk: float = inf) -> Profile | None:
    """The same with ramps of limited jerk; without a limit, of the least jerk. None where the jerk is too little."""
    top = 1 / (1 - ramp)
    jerk = 4 * top / ramp**2 if jerk == inf else jerk
    if jerk * ramp**2 < 4 * top * (1 - 1e-12):
        return None
    peak = (jerk * ramp - sqrt(max((jerk * ramp) ** 2 - 4 * jerk * top, 0.0))) / 2
    bend = peak / jerk

    def rising(t: Floats) -> Floats:
        early, late = np.clip(t, 0, bend), np.clip(ramp - t, 0, bend)
        middle = np.clip(t, bend, ramp - bend) - bend
        return jerk * (early**2 / 2 + (bend**2 - late**2) / 2) + peak * middle

    return Profile(lambda t: rising(np.minimum(t, 1 - t)), (top, peak, jerk))


QUINTIC: Final = Profile(lambda t: 30 * t**2 * (1 - t) ** 2, (15 / 8, 10 / sqrt(3), 60.0))


def compare_with_profiles(problem: Problem, objective: float) -> list[dict[str, Any]]:
    """Rows of ``profile``, ``objective`` (SI; None where no profile of the family keeps the limits), ``saving`` (what
    share of it the optimum saves) and ``breaks`` (the limits of velocity, acceleration and jerk that it does not keep).

    A trapezoid is sought within velocity and acceleration: no jerk limit can be kept by it. Empty where the comparison
    means nothing.
    """
    if not _comparable(problem) or not objective:
        return []
    stroke, duration = _stroke(problem), problem.move.fixed_time or 1.0
    jerk = _largest(problem, "jerk") * duration**3 / stroke
    found: dict[str, Profile | None] = {
        "best trapezoid": _best(problem, trapezoid),
        "trapezoid 1/3-1/3-1/3": trapezoid(1 / 3),
        "best S-curve": _best(problem, lambda ramp: s_curve(ramp, jerk)),
        "quintic": QUINTIC,
    }
    rows: list[dict[str, Any]] = []
    for name, profile in found.items():
        cost = None if profile is None else measured(problem, profile)
        saving = 1 - objective / cost if cost else None
        broken = [] if profile is None else broken_limits(problem, profile)
        rows.append({"profile": name, "objective": cost, "saving": saving, "breaks": broken})
    return rows


def measured(problem: Problem, profile: Profile) -> float:
    """The problem's objective on a profile, SI."""
    duration = problem.move.fixed_time
    assert duration is not None
    fractions = np.arange(_INTERVALS + 1) / _INTERVALS
    velocity = profile.velocity(fractions) * (_displacement(problem) / duration)
    acceleration = np.diff(velocity) * (_INTERVALS / duration)
    steps = np.diff(fractions) * duration
    chain = EXACT.rollout(np.zeros(2), acceleration, steps)
    origin = problem.move.start_position or 0.0
    return Trajectory(
        problem, Mesh(fractions), EXACT, sizes_of(problem), duration, origin, tuple(chain)
    ).measure(problem.objective)


def broken_limits(problem: Problem, profile: Profile) -> list[str]:
    """The limits of velocity, acceleration and jerk that a profile does not keep."""
    stroke, duration = _stroke(problem), problem.move.fixed_time or 1.0
    peaks = [peak * stroke / duration**i for i, peak in enumerate(profile.peaks, 1)]
    found = zip(_LIMITED, peaks, strict=True)
    return [name for name, peak in found if peak > _largest(problem, name) * (1 + 1e-9)]


def _best(problem: Problem, family: Callable[[float], Profile | None]) -> Profile | None:
    """The cheapest profile of a family, by its ramp, among those that keep the limits."""

    def cost(ramp: float, otherwise: float = inf) -> float:
        profile = family(float(ramp))
        if profile is None or any(name != "jerk" or profile.peaks[2] < inf for name in broken_limits(problem, profile)):
            return otherwise
        return measured(problem, profile)

    costs = [cost(ramp) for ramp in _RAMPS]
    k = int(np.argmin(costs))
    if costs[k] == inf:
        return None
    around = (float(_RAMPS[max(k - 1, 0)]), float(_RAMPS[min(k + 1, len(_RAMPS) - 1)]))
    found = minimize_scalar(cost, args=(2 * costs[k],), bounds=around, method="bounded", options={"xatol": 1e-6})
    return family(float(found.x) if found.fun < costs[k] else float(_RAMPS[k]))


def _comparable(problem: Problem) -> bool:
    """Rest to rest between given places in a given time, straight, for something that a load is paid by."""
    move = problem.move
    states = [state.fixed(problem.order) for state in (move.start, move.end)]
    at_rest = all(state.get(1) == 0.0 and not any(state.get(i) for i in range(2, problem.order)) for state in states)
    paid = all(term.minimize not in (*DERIVATIVES, "time") for term in problem.objective.terms)
    fixed = move.fixed_time is not None and isinstance(move.end.position, float) and move.start_position is not None
    exact = problem.transcription.scheme == "exact"
    paid = paid and not problem.objective.ceilings
    return at_rest and paid and fixed and exact and not move.via and _stroke(problem) > 0


def _displacement(problem: Problem) -> float:
    end = problem.move.end.position
    assert isinstance(end, float)
    return end - (problem.move.start_position or 0.0)


def _stroke(problem: Problem) -> float:
    end = problem.move.end.position
    return abs(_displacement(problem)) if isinstance(end, float) else 0.0


def _largest(problem: Problem, name: str) -> float:
    """The limit in the direction of the move, and for what changes sign in both."""
    limit = getattr(problem.limits, name)
    if limit is None:
        return inf
    forward = _displacement(problem) > 0
    if name == "velocity":
        return float(limit.highest if forward else -limit.lowest)
    return float(min(limit.highest, -limit.lowest))
