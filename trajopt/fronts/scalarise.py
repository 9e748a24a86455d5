"""One point of a front: the problem with weights on its objectives, or ceilings on all but one; solved and bounded.

Everything that a front solves goes through `answer`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from trajopt.attempt import Clock, convex, to
from trajopt.power import relax
from trajopt.problem import FREE, Ceiling, Objective, Problem, Term
from trajopt.routing import has_power_bound, nonaffine_limits, route_on_mesh
from trajopt.solution import Solution
from trajopt.stretching import FALLS, is_plain
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Setting, without

_HELD: Final = (1e-9, 1e-8)  # relative: how closely an end of a front holds what came before; the first that it can
_FALLING: Final = ("current", "envelope", "rms_force", "time")  # by no one power, or a target itself


@dataclass(frozen=True)
class Plane:
    """No move has a smaller sum of ``weights`` (SI) times objectives than ``value``."""

    weights: tuple[float, ...]
    value: float


@dataclass(frozen=True)
class Task:
    """What to solve: ``weights`` (SI, zero where an objective is left out), or the least of objective ``minimized``
    with ``ceilings`` on the others; ``kind`` is anchor, weights or epsilon."""

    problem: Problem
    terms: tuple[Term, ...]
    kind: str
    weights: tuple[float, ...] = ()
    minimized: int = 0
    ceilings: tuple[float | None, ...] = ()
    start: Trajectory | None = None  # the answer of a neighbour
    duration: float | None = None  # s, where time is an objective; None for the least


@dataclass(frozen=True)
class Answer:
    """What came of a task. ``values`` (SI) of the objectives on the checked move, None without one; the ``planes`` and
    ``corners`` are lower bounds; ``prices``: what one more unit of each objective saves of the first."""

    task: Task
    solution: Solution
    values: tuple[float, ...] | None = None
    planes: tuple[Plane, ...] = ()
    corners: tuple[tuple[float, ...], ...] = ()
    weights: tuple[float, ...] | None = None  # of the plane that touches the front here


def answer(task: Task) -> Answer:
    """Solve a task, in this process."""
    if any(term.minimize == "time" for term in task.terms):
        return _timed(task)
    return {"anchor": _anchor, "weights": _weighted, "epsilon": _held}[task.kind](task)


def measured(solution: Solution, terms: Sequence[Term]) -> tuple[float, ...] | None:
    """The objectives of a solved move, SI."""
    if solution.trajectory is None:
        return None
    return tuple(solution.trajectory.measure(Objective(terms=(term,))) for term in terms)


def _solve(task: Task, terms: Sequence[Term], ceilings: Sequence[Ceiling] = ()) -> Solution:
    from trajopt.solving import solve

    objective = Objective(terms=tuple(terms), ceilings=tuple(ceilings) or None)
    return solve(task.problem.replace(objective=objective), start=task.start)


def _weighted_terms(task: Task, weights: Sequence[float]) -> list[Term]:
    pairs = zip(task.terms, weights, strict=True)
    return [term.model_copy(update={"weight": float(weight)}) for term, weight in pairs if weight > 0]


def _plane(solution: Solution, weights: Sequence[float]) -> tuple[Plane, ...]:
    bound = solution.certificate.get("lower_bound")
    return () if bound is None else (Plane(tuple(weights), bound),)


def _weighted(task: Task) -> Answer:
    """The least weighted sum (Clemen & Rupp eq. 26)."""
    solution = _solve(task, _weighted_terms(task, task.weights))
    planes = _plane(solution, task.weights)
    return Answer(task, solution, measured(solution, task.terms), planes, weights=task.weights)


def _anchor(task: Task) -> Answer:
    """The least of one objective, and of the others in turn with those before held, while the move is undetermined."""
    order = [task.minimized, *(k for k in range(len(task.terms)) if k != task.minimized)]
    weights = tuple(float(k == task.minimized) for k in range(len(task.terms)))
    solution = _solve(task, [task.terms[task.minimized]])
    planes = _plane(solution, weights)
    for k, term in enumerate([task.terms[k] for k in order[1:]], 1):
        values = measured(solution, task.terms)
        if values is None or solution.route.unique or min(values[i] for i in order[:k]) <= 0:
            break
        for share in _HELD if solution.route.model == "cvxpy" else (1e-7,):
            held = [_ceiling(task.terms[i], values[i] * (1 + share)) for i in order[:k]]
            second = _solve(task, [term], held)
            if second.status.solved:
                solution = second
                break
    return Answer(task, solution, measured(solution, task.terms), planes, weights=weights)


def _ceiling(term: Term, most: float) -> Ceiling:
    return Ceiling(of=term.minimize, norm=term.norm, at_most=most)


def _held(task: Task) -> Answer:
    """The least of one objective with the others below their ceilings, and the half-plane that their prices turn."""
    pairs = zip(task.terms, task.ceilings, strict=True)
    held = [_ceiling(term, most) for term, most in pairs if most is not None]
    minimized = task.terms[task.minimized]
    solution = _solve(task, [minimized], held)
    values, bound = measured(solution, task.terms), solution.certificate.get("lower_bound")
    if values is None:
        return Answer(task, solution)
    least = tuple(np.inf if most is None else most for most in task.ceilings)
    corners = () if bound is None else (tuple(bound if k == task.minimized else x for k, x in enumerate(least)),)
    prices = {row["name"]: max(-row["per_unit"], 0.0) for row in solution.prices}
    weights = tuple(
        1.0 if k == task.minimized else prices.get(f"{term.label}.at_most", 0.0) for k, term in enumerate(task.terms)
    )
    value = lower_bound(_reweighted(task, weights))
    planes = (Plane(weights, value),) if np.isfinite(value) else ()
    return Answer(task, solution, values, planes, corners, weights)


def _timed(task: Task) -> Answer:
    """The least time, or the least cost in a given time: also a bound for shorter ones where moves can be stretched."""
    from trajopt.solving import solve

    time = FREE if task.duration is None else task.duration
    move = task.problem.move.model_copy(update={"time": time})
    objective = Objective(terms=(task.terms[task.minimized],))
    solution = solve(task.problem.replace(move=move, objective=objective))
    values, bound = measured(solution, task.terms), solution.certificate.get("lower_bound")
    if values is None or bound is None or not (task.duration is None or stretches(task.problem, task.terms)):
        return Answer(task, solution, values)
    if task.kind == "anchor":
        weights = tuple(float(k == task.minimized) for k in range(len(task.terms)))
        return Answer(task, solution, values, (Plane(weights, bound),), weights=_slopes(task, solution))
    corner = tuple(bound if k == task.minimized else values[k] for k in range(len(task.terms)))
    return Answer(task, solution, values, corners=(corner,), weights=_slopes(task, solution))


def _slopes(task: Task, solution: Solution) -> tuple[float, ...] | None:
    """The half-plane that touches the front at a given time, from the price of the time."""
    found = {row["name"]: max(-row["per_unit"], 0.0) for row in solution.prices}
    if task.duration is None or "time" not in found:
        return None
    return tuple(found["time"] if term.minimize == "time" else 1.0 for term in task.terms)


def stretches(problem: Problem, terms: Sequence[Term]) -> bool:
    """Whether a move stretched in time keeps all limits and costs no more."""
    limits = problem.limits.given
    around_zero = all(x.lowest <= 0 <= x.highest for name, x in limits.items() if name != "position")
    named = {*limits, *(term.minimize for term in terms)}
    falling = named <= {*FALLS, *_FALLING} and all(term.minimize != "position" for term in terms)
    return is_plain(problem, terms) and around_zero and falling


def _reweighted(task: Task, weights: Sequence[float]) -> Problem:
    return task.problem.replace(objective=Objective(terms=tuple(_weighted_terms(task, weights))))


def lower_bound(problem: Problem) -> float:
    """The certified bound of a problem of fixed time by itself, without an answer; -inf where none is known."""
    duration = problem.move.fixed_time
    setting, clock = without(Setting.of(problem), nonaffine_limits(problem)), Clock()
    if duration is None or route_on_mesh(problem).model != "cvxpy":
        return -np.inf
    if has_power_bound(problem) and not is_convex(problem):
        return relax(setting, clock).bound
    return convex(setting, duration, to(problem.objective), clock).bound


def is_convex(problem: Problem) -> bool:
    """Whether all objectives and limits are convex in the move, so that a mixture of two moves costs at most the
    mixture of their costs."""
    from trajopt.quantities import is_affine

    names: Final = [term.minimize for term in problem.objective.all_terms]
    return (
        problem.move.fixed_time is not None
        and not nonaffine_limits(problem)
        and all(is_affine(problem, name) for name in names)
    )
