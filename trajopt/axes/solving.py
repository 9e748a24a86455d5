"""Solve a problem of several axes: one by one where nothing couples them, else from many starts. Always checked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from time import perf_counter
from typing import Any, Final

import numpy as np

from trajopt import checker
from trajopt.attempt import Clock
from trajopt.axes.attempt import AxesAttempt, AxesProgram, on_mesh
from trajopt.axes.between import drawn_in, excess, restored
from trajopt.axes.explain import explain, forward_only_speed
from trajopt.axes.motion import Motion
from trajopt.axes.problem import AxesProblem
from trajopt.axes.second_look import second_look
from trajopt.axes.solution import AxesSolution
from trajopt.axes.starts import Guess, guesses
from trajopt.axes.synchronise import synchronise
from trajopt.axes.transcription import AxesSetting
from trajopt.conclude import KEPT
from trajopt.model import Claim
from trajopt.problem import FREE, Problem
from trajopt.routing import route
from trajopt.solution import Solution
from trajopt.verdict import Verdict

_SAME: Final = 1e-4  # relative: coarse optima within it are one
_ROUNDS: Final = 6  # of drawing in
_REFINED: Final = 2  # how many of the distinct ones are refined,
_NEAR: Final = 0.25  # if they are no worse than the best by more than this share of it


def solve(problem: AxesProblem, seconds: float | None = None) -> AxesSolution:
    """`trajopt.solve` of several axes in this process; ``seconds`` is kept between and within solver runs only."""
    clock = Clock(seconds)
    if not problem.coupled:
        return _one_by_one(problem, clock)
    starts, found = _search(problem, clock)
    unsolved = AxesSolution(Verdict.UNDECIDED, problem, route(problem))
    if not found:
        return _failed(unsolved, starts, clock)
    certificate = _certificate(len(starts), [attempt.value for attempt in found])
    best = _refined(AxesSetting.of(problem), _distinct(found)[:_REFINED], clock)
    if best.motion is None:
        message = f"{len(found)} of {len(starts)} coarse starts were feasible, but none could be refined"
        return replace(unsolved, status=_late(clock), timings=clock.timings(), message=message)
    best = _kept(AxesSetting.of(problem), best, clock)
    if (forward := forward_only_speed(problem)) is not None:
        certificate["forward_only_bound"] = forward
    assert best.motion is not None
    return _concluded(unsolved, best.motion, certificate, clock, Verdict.SOLVED_LOCAL)


def _search(problem: AxesProblem, clock: Clock) -> tuple[list[AxesAttempt], list[AxesAttempt]]:
    """All attempts on the coarse mesh, and those that came to an optimum, best first."""
    transcription = problem.transcription
    coarse = min(transcription.intervals, problem.search.intervals)
    if transcription.scheme == "euler" and isinstance(problem.release, float):
        coarse = transcription.intervals  # the release must fall on one of the equal steps
    program = AxesProgram(on_mesh(AxesSetting.of(problem), coarse), clock)
    tried = []
    for guess in _shown(guesses(problem), problem.search.starts):
        tried.append(program.run(guess))
        if clock.over:
            break
    return tried, sorted((a for a in tried if a.motion is not None), key=lambda attempt: attempt.value)


def _refined(setting: AxesSetting, found: list[AxesAttempt], clock: Clock) -> AxesAttempt:
    """The best that becomes of coarse optima on the asked mesh, and once more from there, warm: where the objective is
    flat, other optima lie near."""
    program, near = AxesProgram(setting, clock), [x for x in found if x.value <= (1 + _NEAR) * found[0].value]
    best = min((_run(program, coarse, "ipopt-adaptive") for coarse in near), key=_rank)
    if best.motion is None:
        best = min((_run(program, coarse, "ipopt") for coarse in found), key=_rank)
    if best.motion is None or clock.over:
        return best
    return min(best, _run(program, best, "ipopt-warm"), key=_rank)


def _kept(setting: AxesSetting, best: AxesAttempt, clock: Clock) -> AxesAttempt:
    """The best, with what slips between its nodes drawn in by as much, and found again from there."""
    share = 0.0
    for _ in range(_ROUNDS):
        assert best.motion is not None
        over = excess(best.motion)
        if over <= KEPT or clock.over:
            break
        share += 1.05 * over
        tighter = AxesProgram(drawn_in(setting, share), clock)
        ends = (_run(tighter, best, rung) for rung in ("ipopt-warm", "ipopt"))
        inner = next((end for end in ends if end.motion is not None), None)
        if inner is None or inner.motion is None:
            break
        motion = restored(inner.motion, setting.problem)
        best = replace(inner, motion=motion, value=motion.objective)
    return best


def _run(program: AxesProgram, start: AxesAttempt, rung: str) -> AxesAttempt:
    assert start.motion is not None
    return program.run(Guess.from_motion(start.motion), rung)


def _rank(attempt: AxesAttempt) -> float:
    return np.inf if attempt.motion is None else attempt.value


def _shown(starts: Iterator[Guess], count: int) -> Iterator[Guess]:
    """The starts, with a progress bar on standard error where that is a terminal."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    yield from track(starts, "starts", total=count, console=console, transient=True, disable=not console.is_terminal)


def _distinct(found: list[AxesAttempt]) -> list[AxesAttempt]:
    """The best of every group of optima of one value."""
    kept: list[AxesAttempt] = []
    for attempt in found:
        if not kept or attempt.value > kept[-1].value * (1 + _SAME) + 1e-300:
            kept.append(attempt)
    return kept


def _certificate(starts: int, values: list[float]) -> dict[str, Any]:
    """What the starts say about better motions; ``values`` are sorted."""
    best, optima = values[0], [values[0]]
    for value in values:
        if value > optima[-1] * (1 + _SAME) + 1e-300:
            optima.append(value)
    return {
        "lower_bound": None,
        "gap": None,
        "bounds": "no bound known: the best local optimum of several starts",
        "starts": starts,
        "feasible": len(values),
        "agreed": sum(value <= best * (1 + _SAME) for value in values),
        "distinct": len(optima),
        "optima": optima,
        "spread": (values[-1] - best) / best if best else 0.0,
    }


def _concluded(
    unsolved: AxesSolution, motion: Motion, certificate: dict[str, Any], clock: Clock, verdict: Verdict
) -> AxesSolution:
    """The solution, once the independent check has spoken."""
    found = replace(
        unsolved, status=verdict, objective=motion.objective, duration=motion.duration, metrics=motion.metrics,
        certificate=certificate, motion=motion,
    )  # fmt: skip
    since = perf_counter()
    report = checker.check(found.to_dict(), unsolved.problem.canonical())
    audit, faults = report.to_dict(), list(map(str, report.failed))
    if unsolved.problem.arm is not None and audit["not_checked"]:
        audit["second_evaluation"], doubts = second_look(motion)
        faults += doubts
    clock.charge("check", since)
    if faults:
        message = f"a motion was found, but the check found: {'; '.join(faults[:3])}"
        return replace(unsolved, audit=audit, timings=clock.timings(), message=message)
    return replace(found, audit=audit, timings=clock.timings())


def _failed(unsolved: AxesSolution, starts: list[AxesAttempt], clock: Clock) -> AxesSolution:
    """No start was feasible: why, where that can be shown."""
    found = explain(unsolved.problem, clock)
    if found.get("impossible"):
        status = Verdict.IMPOSSIBLE if found["continuous"] else Verdict.IMPOSSIBLE_ON_GRID
        return replace(
            unsolved, status=status, explanation=found, timings=clock.timings(), message=found["text"][0]
        )
    limited = any(attempt.outcome.claim is Claim.LIMIT for attempt in starts)
    status = Verdict.LIMIT if limited else _late(clock)
    message = f"none of {len(starts)} starts was feasible; try more starts, more time or wider limits"
    return replace(unsolved, status=status, explanation=found, timings=clock.timings(), message=message)


def _late(clock: Clock) -> Verdict:
    return Verdict.LIMIT if clock.over else Verdict.UNDECIDED


def _one_by_one(problem: AxesProblem, clock: Clock) -> AxesSolution:
    """Every axis by itself; in a free time that they share, the slowest sets it and the others relax."""
    def alone(move: Problem, seconds: float | None = None) -> Solution:
        from trajopt.solving import solve as solve_move

        return solve_move(move, seconds)

    if problem.move.shared and problem.move.time == FREE:
        solutions = synchronise(problem.moves, clock.left(), alone)
    else:
        solutions = [alone(move, clock.left()) for move in problem.moves]
    worst = max((solution.status for solution in solutions), key=lambda status: (status.exit_code, status.value))
    unsolved = AxesSolution(Verdict.UNDECIDED, problem, route(problem))
    if not worst.solved:
        return _stuck(unsolved, solutions, clock)
    trajectories = tuple(s.trajectory for s in solutions if s.trajectory is not None)
    moved = tuple(replace(t, problem=move) for t, move in zip(trajectories, problem.moves, strict=True))
    return _concluded(unsolved, Motion(problem, moved), _bound(problem, solutions), clock, worst)


def _stuck(unsolved: AxesSolution, solutions: list[Solution], clock: Clock) -> AxesSolution:
    """The verdict of the first axis that has no solution, with its explanation."""
    k = next(k for k, solution in enumerate(solutions) if not solution.status.solved)
    failed, name = solutions[k], unsolved.problem.axes[k].name
    explanation = dict(failed.explanation)
    if "text" in explanation:
        explanation["text"] = [f"{name}: {line}" for line in explanation["text"]]
    message = f"{name}: {failed.message or failed.status.advice}"
    return replace(
        unsolved, status=failed.status, explanation=explanation, timings=clock.timings(), message=message
    )


def _bound(problem: AxesProblem, solutions: list[Solution]) -> dict[str, Any]:
    """A bound on the objective from those of the axes: of sums the sum, of a time or a largest one the largest."""
    bounds = [solution.certificate.get("lower_bound") for solution in solutions]
    terms, timed = problem.objective.terms, problem.move.time == FREE
    largest = timed or (len(terms) == 1 and terms[0].combine == "max")
    mixed = not largest and any(term.combine == "max" for term in terms)
    if timed:
        slowest = max(range(len(solutions)), key=lambda k: solutions[k].duration or 0.0)
        least = bounds[slowest]
        bounds = [None if least is None else sum(term.weight for term in terms) * least]
    if mixed or any(bound is None for bound in bounds):
        return {"lower_bound": None, "gap": None, "bounds": "no bound known: a local optimum"}
    known = [float(bound) for bound in bounds if bound is not None]
    bound, value = max(known) if largest else sum(known), _value(problem, solutions)
    gap = max((value - bound) / abs(value), 0.0) if value else 0.0
    return {"lower_bound": min(bound, value), "gap": gap, "bounds": "every motion of the axes, as each axis by itself"}


def _value(problem: AxesProblem, solutions: list[Solution]) -> float:
    moved = tuple(solution.trajectory for solution in solutions if solution.trajectory is not None)
    moves = zip(moved, problem.moves, strict=True)
    return Motion(problem, tuple(replace(trajectory, problem=move) for trajectory, move in moves)).objective
