"""From an attempt to a solution: metrics, certificate, and the independent check, without which nothing is solved."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from time import perf_counter
from typing import Any, Final

import numpy as np

from trajopt import checker, friction
from trajopt.attempt import Attempt, Clock, convex, smoothest, to
from trajopt.errors import InternalError
from trajopt.explain import at_longest, explain
from trajopt.metrics import metrics
from trajopt.model import Claim
from trajopt.routing import Route, nonaffine_limits
from trajopt.solution import Solution
from trajopt.transcribe import Setting, without
from trajopt.verdict import Verdict

KEPT: Final = 1e-9  # of a limit: further answers are sought for one that exceeds it by more
GAP: Final = 1e-6  # relative: a checked answer within it of its lower bound is solved
_VERDICTS: Final = {Claim.INFEASIBLE: Verdict.IMPOSSIBLE_ON_GRID, Claim.LIMIT: Verdict.LIMIT}


def conclude(setting: Setting, chosen: Route, attempt: Attempt, clock: Clock, local: bool = False) -> Solution:
    """The solution that an attempt amounts to, once the independent check has spoken.

    With a gap above GAP it is SOLVED_LOCAL where ``local`` says that a local optimum will do, else UNDECIDED. Raises
    InternalError when the lower bound lies above a checked answer.
    """
    problem, outcome = setting.problem, attempt.outcome
    if outcome.solver and chosen.model == "cvxpy":
        chosen = replace(chosen, solver=outcome.solver)
    if attempt.trajectory is None:
        return _unsolved(setting, chosen, attempt, clock)
    trajectory = attempt.trajectory.of(problem)
    value = trajectory.measure(problem.objective)
    certificate = _certificate(setting, value, attempt)
    verdict = Verdict.SOLVED if certificate["gap"] is not None and certificate["gap"] <= GAP else Verdict.SOLVED_LOCAL
    found = metrics(trajectory)
    candidate = Solution(
        verdict, problem, chosen, value, trajectory.duration, found, certificate, trajectory=trajectory
    )
    since = perf_counter()
    report = checker.check(candidate.to_dict())
    clock.charge("check", since)
    if report.passed and attempt.bound - value > max(1e-6 * abs(value), attempt.forgiven):
        raise InternalError(f"lower bound {attempt.bound!r} above the answer {value!r}")
    audit, message = report.to_dict(), ""
    if not report.passed:
        message = f"{outcome.raw_status}, but the check found: {'; '.join(audit['failed'])}"
    elif verdict is Verdict.SOLVED_LOCAL and not local:
        message = f"{outcome.raw_status}, but the gap to the lower bound is {certificate['gap']}"
    if message:
        return Solution(Verdict.UNDECIDED, problem, chosen, audit=audit, timings=clock.timings(), message=message)
    noted = {key: attempt.notes[key] for key in ("prices", "structure") if key in attempt.notes}
    return replace(candidate, audit=audit, timings=clock.timings(), **noted)


def first_solved(
    setting: Setting, candidates: Iterable[tuple[Attempt, Route]], clock: Clock, local: bool = False
) -> Solution:
    """The conclusion of the first candidate that passes and keeps its limits to KEPT; else of the first that passes, or
    of the last."""
    best: Solution | None = None
    for attempt, chosen in candidates:
        solution = conclude(setting, chosen, attempt, clock, local)
        if best is None or not best.status.solved or (solution.status.solved and _keeps_limits(solution)):
            best = solution
        if attempt.trajectory is None or clock.over or (best.status.solved and _keeps_limits(best)):
            break
    assert best is not None
    return best


def _keeps_limits(solution: Solution) -> bool:
    return bool(solution.audit["excess"] <= KEPT)


def _unsolved(setting: Setting, chosen: Route, attempt: Attempt, clock: Clock) -> Solution:
    """A verdict without numbers. A move that is impossible in its time, or the longest of its range, is explained."""
    problem, outcome = setting.problem, attempt.outcome
    status, explanation = _VERDICTS.get(outcome.claim, Verdict.UNDECIDED), {}
    at_longest_time = at_longest(problem)
    longest = at_longest_time.move.fixed_time
    if status is Verdict.IMPOSSIBLE_ON_GRID and longest is not None:
        since = perf_counter()
        longest_move = replace(setting, problem=at_longest_time)
        tried = without(longest_move, nonaffine_limits(problem))
        explanation = _by_ceilings(longest_move, longest, clock) or explain(tried, clock)
        if explanation["continuous"]:
            status = Verdict.IMPOSSIBLE
        elif not friction.is_settled(tried, clock):
            status, explanation = Verdict.UNDECIDED, {}
        clock.charge("explain", since)
    if status is Verdict.UNDECIDED and clock.over:
        status = Verdict.LIMIT
    message = explanation["text"][0] if explanation else outcome.raw_status
    if status is Verdict.LIMIT and clock.over:
        message = "stopped at the time limit"
    if status is Verdict.UNDECIDED and problem.load.coulomb:
        message += "; the program takes friction at rest for friction in motion"
    return Solution(status, problem, chosen, explanation=explanation, timings=clock.timings(), message=message)


def _by_ceilings(setting: Setting, duration: float, clock: Clock) -> dict[str, Any]:
    """Where the move is possible without the ceilings of the objective, that they are why it is not; else nothing."""
    problem = setting.problem
    if not problem.objective.ceilings:
        return {}
    kinematic = without(setting, nonaffine_limits(problem))
    if convex(kinematic, duration, to(smoothest(problem)), clock).trajectory is None:
        return {}
    held = " and ".join(f"{problem.shown(c.term.label)} at most {c.at_most:g}" for c in problem.objective.ceilings)
    text = f"no move on this mesh keeps {held} (SI); within the limits alone it is possible: raise the ceiling"
    return {"continuous": False, "text": [text]}


def _certificate(setting: Setting, value: float, attempt: Attempt) -> dict[str, Any]:
    """Lower bound, gap and what the bound is about; for a local optimum also how many starts agreed on it."""
    starts: dict[str, Any] = {key: attempt.notes[key] for key in ("starts", "agreed") if key in attempt.notes}
    bound = attempt.bound
    if not np.isfinite(bound):
        return {"lower_bound": None, "gap": None, "bounds": "no bound known: a local optimum", **starts}
    gap = (value - bound) / max(abs(value), 1e-300)
    between = attempt.trajectory is not None and attempt.trajectory.scheme.terms > 1
    about = "every move on this mesh" + (" whose Bernstein coefficients keep the limits" if between else "")
    about = attempt.notes.get("bounds", about) + ", friction at rest as in motion" * friction.is_charged(setting)
    return {"lower_bound": min(bound, value), "gap": max(gap, 0.0), "bounds": about, **starts}
