"""Ties: where the optimum is not unique, or too flat to be found alike twice, a second solve takes the smoothest."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from trajopt.attempt import Attempt, Clock, convex, smoothest
from trajopt.objective import Lowered, lower
from trajopt.problem import DERIVATIVES, Problem
from trajopt.routing import Route
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Setting, Transcript

_ENOUGH: Final = 1e-8  # gap of the second solve, whose value nobody is told
HELD: Final = (1e-9, 1e-8)  # relative: how closely the second solve holds the optimum; the first that it can


def break_tie(setting: Setting, attempt: Attempt, chosen: Route, clock: Clock) -> tuple[Attempt, Route]:
    """The smoothest of the optima, the same on every machine, where the profile is not determined; else the attempt."""
    if attempt.trajectory is None:
        return attempt, chosen
    if _determines_profile(setting.problem):
        return attempt, replace(chosen, unique=True)
    for share in HELD:
        second = _smoothest_optimum(setting, attempt, share, clock)
        if second.trajectory is not None and _costs_no_more(setting, second.trajectory, attempt, 2 * share):
            tied = replace(attempt, trajectory=second.trajectory, notes=attempt.notes | {"held": share})
            label = " + ".join(term.label for term in setting.problem.objective.terms)
            return tied, tied_route(chosen, setting, attempt, tied, label)
    return attempt, chosen


def _smoothest_optimum(setting: Setting, attempt: Attempt, share: float, clock: Clock) -> Attempt:
    """The smoothest move whose objective exceeds the attempt's by at most a share of it."""
    objective, smooth = setting.problem.objective, smoothest(setting.problem)
    assert attempt.trajectory is not None

    def goal(transcript: Transcript) -> Lowered:
        held = lower(transcript, objective)
        best = held.expression_value(attempt.value)
        transcript.model.nonpositive(held.expression - best - share * max(abs(best), 1e-3))
        return lower(transcript, smooth)

    return convex(setting, attempt.trajectory.duration, goal, clock, enough=_ENOUGH)


def _costs_no_more(setting: Setting, trajectory: Trajectory, attempt: Attempt, share: float) -> bool:
    """Whether a smoother profile holds the true objective: solvers may not, nor may a linearised power."""
    assert attempt.trajectory is not None
    objective = setting.problem.objective
    best = min(attempt.value, attempt.trajectory.measure(objective))
    return trajectory.measure(objective) <= best + share * max(abs(best), 1e-3 * attempt.size)


def _determines_profile(problem: Problem) -> bool:
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
