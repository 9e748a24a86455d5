"""Ties: where the optimum is not unique, or too flat to be found alike twice, a second solve takes the smoothest."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from trajopt.attempt import Attempt, Clock, convex, rounding, smoothest
from trajopt.objective import Lowered, lower
from trajopt.problem import DERIVATIVES, Problem
from trajopt.routing import Route
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Setting, Transcript

_WEIGHTS: Final = (1e-5, 1e-7, 1e-9)  # of smoothness, relative, in the second solve; the first that costs nothing
_COST: Final = 2e-9  # relative: what counts as nothing


def break_tie(setting: Setting, attempt: Attempt, chosen: Route, clock: Clock) -> tuple[Attempt, Route]:
    """The smoothest of the optima, the same on every machine, where the profile is not determined; else the attempt.

    Beside an objective that is linear in disguise a small enough weight changes nothing but which optimum is found
    (Mangasarian & Meyer 1979); beside a curved one it costs the square of the weight. To hold the optimum by a row
    instead leaves a set without interior, in which solvers stall.
    """
    if attempt.trajectory is None:
        return attempt, chosen
    if determines_profile(setting.problem):
        return attempt, replace(chosen, unique=True)
    for weight in _WEIGHTS:
        second = _with_smoothness(setting, attempt, weight, clock)
        if second.trajectory is not None and _costs_nothing(setting, second.trajectory, attempt):
            tied = replace(attempt, trajectory=second.trajectory)
            label = " + ".join(term.label for term in setting.problem.objective.terms)
            return tied, tied_route(chosen, setting, attempt, tied, label)
        if clock.over:
            break
    return attempt, chosen


def _with_smoothness(setting: Setting, attempt: Attempt, weight: float, clock: Clock) -> Attempt:
    """The least of the objective and, with that weight, of its smoothness, both over what they are in the attempt."""
    objective, smooth = setting.problem.objective, smoothest(setting.problem)
    assert attempt.trajectory is not None
    roughness = attempt.trajectory.measure(smooth)

    def goal(transcript: Transcript) -> Lowered:
        cost, rough = lower(transcript, objective), lower(transcript, smooth)
        best = max(abs(cost.expression_value(attempt.value)), 1e-3)
        size = max(rough.expression_value(roughness), 1e-9)
        return Lowered(cost.expression * (1 / best) + rough.expression * (weight / size), 1.0, None)

    return convex(setting, attempt.trajectory.duration, goal, clock, step=True, again=attempt)


def _costs_nothing(setting: Setting, trajectory: Trajectory, attempt: Attempt) -> bool:
    """Whether a smoother profile holds the true objective: its weight, or a linearised power, may be too much."""
    assert attempt.trajectory is not None
    objective = setting.problem.objective
    best = min(attempt.value, attempt.trajectory.measure(objective))
    return trajectory.measure(objective) <= best + _COST * rounding(setting.mesh) * max(abs(best), 1e-3 * attempt.size)


def determines_profile(problem: Problem) -> bool:
    """Whether the objective is strictly convex in the top derivative, or in the one below it.

    In anything lower it is too flat: the L2 norm of velocity at nodes leaves the jerk to ring at the cost of 1e-9.
    """
    high = {*DERIVATIVES[problem.order - 1 :], *(("force", "current", "voltage") if problem.order <= 3 else ())}
    if problem.order <= 3 and any(term.minimize == "copper_loss" for term in problem.objective.terms):
        return True
    return any(t.minimize in high and t.norm is not None and t.norm.strictly_convex for t in problem.objective.terms)


def tied_route(chosen: Route, setting: Setting, first: Attempt, second: Attempt, label: str) -> Route:
    assert first.trajectory is not None and second.trajectory is not None
    velocity = [x.trajectory.chain[1] for x in (first, second) if x.trajectory is not None]
    moved = float(np.max(np.abs(velocity[0] - velocity[1])) / max(np.max(np.abs(velocity[1])), 1e-300))
    smooth = smoothest(setting.problem).terms[0].label
    note = f"{label} held, {smooth} minimised"
    unique = moved <= 1e-3
    if not unique:
        note += f"; the optimum is not unique (velocity moved by {100 * moved:.2g} % of its peak)"
    return replace(chosen, tie_break=note, unique=unique)
