"""Axes that start and end together: the slowest sets the time, the others relax into the smoothest move within it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from pydantic import ValidationError

from trajopt import worker
from trajopt.attempt import Clock, smoothest
from trajopt.errors import BadInput
from trajopt.explain import has_free_ends, possible_times
from trajopt.problem import FREE, Objective, Problem, Term
from trajopt.problem_file import explain
from trajopt.solution import Solution
from trajopt.transcribe import Setting

if TYPE_CHECKING:
    from trajopt.axes.problem import AxesProblem
    from trajopt.plant.problem import PlantProblem


def synchronise(
    problems: Sequence[Problem | PlantProblem | AxesProblem],
    seconds: float | None = None,
    solve: Callable[..., Solution] = worker.solve,
) -> list[Solution]:
    """One solution an axis, all of one duration (s): the least time of the slowest.

    What the problems say of time and objective is put aside; their limits, loads and states hold. The slowest axis
    keeps its fastest move; every other minimises the L2 norm of its top derivative in the common time. Where the ends
    of an axis move, that time may be impossible for it: then it is the next that all can do, or the one above which
    some axis can do none, with that verdict. Where an axis has no solution (look at ``status``), its verdict stands and
    the others are those of their own least times.
    ``seconds`` limits each solve; ``solve`` replaces `trajopt.solve`. Raises ValueError without any problem, and
    BadInput for one that needs its fixed time, is a plant or has several axes itself.
    """
    if not problems:
        raise ValueError("needs at least one problem to synchronise")
    moves = [problem for problem in problems if isinstance(problem, Problem)]
    if len(moves) < len(problems):
        raise BadInput("synchronise: takes moves of one axis each; solve a plant, or several axes, by itself")
    fastest = [solve(_in_time(problem, FREE, _TIME), seconds) for problem in moves]
    if not all(solution.status.solved for solution in fastest):
        return fastest
    common = _common([_in_time(problem, FREE, _TIME) for problem in moves], fastest, seconds)
    return [
        solution if solution.duration == common else solve(_in_time(problem, common, smoothest(problem)), seconds)
        for problem, solution in zip(moves, fastest, strict=True)
    ]


def _common(problems: Sequence[Problem], fastest: Sequence[Solution], seconds: float | None) -> float:
    """The least duration, s, that all axes can do, if there is one."""
    common, before = max(solution.duration or 0.0 for solution in fastest), 0.0
    moving = [problem for problem in problems if not (problem.can_wait or has_free_ends(problem))]
    possible = [possible_times(Setting.of(problem), Clock(seconds)) for problem in moving] if len(problems) > 1 else []
    while common > before:
        before = common
        for intervals in possible:
            later = [max(common, low) for low, high in intervals if high is None or high >= common]
            common = min(later, default=common)
    return common


_TIME = Objective(terms=(Term(minimize="time"),))


def _in_time(problem: Problem, time: float | str, objective: Objective) -> Problem:
    try:
        return problem.replace(move=problem.move.model_copy(update={"time": time}), objective=objective)
    except ValidationError as error:
        raise BadInput(f"{problem.title or 'an axis'}: {explain(error)}") from None
