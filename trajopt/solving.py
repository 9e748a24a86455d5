"""Solve a problem: route, solve, break ties, price, conclude. Nothing is called solved before the check has passed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from time import perf_counter

import numpy as np

from trajopt import closed_form
from trajopt.attempt import ENOUGH, Attempt, Clock, convex, nonconvex, rungs, smoothest, to
from trajopt.closed_form import smoothest_move
from trajopt.conclude import KEPT, conclude, first_solved
from trajopt.continuous import MassOptimum, findings, mass_optimum
from trajopt.explain import explain_power, tested
from trajopt.model import Claim, Outcome
from trajopt.power import linearised, optimum, relax
from trajopt.prices import priced
from trajopt.problem import Problem
from trajopt.quantities import is_affine
from trajopt.routing import ALONE, Route, has_power_bound, nonaffine_limits, route, route_on_mesh
from trajopt.several_starts import from_several_starts
from trajopt.solution import Solution
from trajopt.switching import Impossible, Unresolved
from trajopt.switching_times import as_chain, fastest, floor, forwards
from trajopt.ties import break_tie, tied_route
from trajopt.tighten import tighten
from trajopt.time_search import minimum_time
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Setting, drawn_in, prescribed, without
from trajopt.verdict import Verdict

_DRAWN = 3e-9  # of a limit
_LATER = 2e-8  # of a least time
_ROUNDS = 4  # of drawing in


def solve(problem: Problem, seconds: float | None = None, start: Trajectory | None = None) -> Solution:
    """`trajopt.worker.solve` in this process, where ``seconds`` is kept between and within solver runs only. ``start``:
    the answer of a neighbouring problem, from which a descent starts, and a local solver that would try several."""
    clock = Clock(seconds)
    since = perf_counter()
    mass = mass_optimum(problem)
    clock.charge("continuous time", since)
    solution = _solve(problem, clock, start, mass)
    if solution.trajectory is None:
        return _with_tested_cures(solution, clock)
    since = perf_counter()
    certificate, structure = findings(problem, solution.trajectory, solution.metrics, mass)
    if solution.certificate["lower_bound"] is None and (least := floor(problem)) is not None:
        assert solution.duration is not None
        gap = 1 - least / solution.duration
        certificate = {"lower_bound": least, "gap": gap, "bounds": "every move in continuous time"}
    clock.charge("continuous time", since)
    found = {**solution.certificate, **certificate}
    return replace(solution, certificate=found, structure={**structure, **solution.structure}, timings=clock.timings())


def _with_tested_cures(solution: Solution, clock: Clock) -> Solution:
    if not solution.explanation.get("limits") or solution.explanation.get("least_peak_power"):
        return solution
    since = perf_counter()
    explanation = tested(solution.problem, dict(solution.explanation), lambda cured: _works(cured, clock))
    clock.charge("explain", since)
    return replace(solution, explanation=explanation, timings=clock.timings())


def _works(problem: Problem, clock: Clock) -> bool:
    """Whether a move is found where that is in doubt: for a problem that is nonconvex."""
    nonaffine = nonaffine_limits(problem)
    if not nonaffine or clock.over:
        return not nonaffine
    setting = Setting.of(problem)
    answer = from_several_starts(setting, clock)
    return answer.trajectory is not None and conclude(setting, route(problem), answer, clock, local=True).status.solved


def _solve(problem: Problem, clock: Clock, start: Trajectory | None, mass: MassOptimum | None) -> Solution:
    """The checked answer, or the verdict."""
    chosen = route(problem)
    setting = Setting.of(problem)
    if (still := _coasting(setting)) is not None:
        solution = conclude(setting, chosen.because("coasting costs nothing: zero is optimal"), still, clock)
        if solution.status.solved:
            return solution
    since = perf_counter()
    if (smooth := smoothest_move(setting)) is not None:
        clock.charge("closed form", since)
        solution = conclude(setting, closed_form.ROUTE, smooth, clock)
        if solution.status.solved:
            return solution
    if chosen.model == "arcs":
        solution = _by_arcs(setting, chosen, clock)
        cut_off = problem.transcription.min_dwell > 0 or problem.transcription.touches is not None
        if solution.status.solved or solution.status is Verdict.IMPOSSIBLE or cut_off:
            return solution
        on_mesh = route_on_mesh(problem)
        chosen = on_mesh.because(f"{on_mesh.reason} (switching times: {solution.message})")
    if chosen.model == "pyomo":
        return _local(setting, chosen, clock, start)
    lean = without(setting, nonaffine_limits(problem))  # an answer that keeps those too is as good as with them
    if problem.move.fixed_time is None:
        solution, attempt = _shortest(setting, lean, chosen, clock)
    elif _is_affine(problem):
        solution, attempt = _convex(setting, lean, chosen, clock)
    else:
        near = mass.on(lean) if start is None and mass is not None else start
        solution, attempt = _by_descent(setting, lean, chosen, clock, near)
    ended = attempt.trajectory is None and attempt.outcome.claim in (Claim.INFEASIBLE, Claim.LIMIT)
    if solution.status.solved or lean is setting or ended:
        return solution
    return _with_all_limits(setting, lean, attempt, clock)


def _by_arcs(setting: Setting, chosen: Route, clock: Clock) -> Solution:
    """Minimum time by switching times; UNDECIDED where they are not found, or a limit left out is broken."""
    ahead = replace(setting, problem=forwards(setting.problem))
    lean = without(ahead, nonaffine_limits(ahead.problem))
    chain = as_chain(lean.problem)
    assert chain is not None
    try:
        return conclude(setting, chosen, fastest(lean, chain, clock), clock, local=True)
    except (Impossible, Unresolved) as reason:
        impossible, text = isinstance(reason, Impossible), str(reason)
        status = Verdict.IMPOSSIBLE if impossible else Verdict.UNDECIDED
        explanation = {"continuous": True, "text": [text]} if impossible else {}
        timings = clock.timings()
        return Solution(status, setting.problem, chosen, explanation=explanation, timings=timings, message=text)


def _is_affine(problem: Problem) -> bool:
    return all(is_affine(problem, term.minimize) for term in problem.objective.all_terms)


def _coasting(setting: Setting) -> Attempt | None:
    """The top derivative left at zero, where that meets every prescribed state and costs nothing: no norm is less."""
    problem, duration, sizes = setting.problem, setting.problem.move.fixed_time, setting.sizes
    states = prescribed(problem, setting.mesh)
    start = np.zeros(problem.order)
    places = {value for _, i, value in states if i == 0}
    start[0] = min(places, default=0.0)  # where a free start may stand still
    for node, i, value in states:
        start[i] = value if node == 0 else start[i]
    if duration is None or (not np.any(start[1:]) and len(places) > 1):  # at rest it goes nowhere
        return None
    chain = setting.scheme.rollout(start, np.zeros(setting.mesh.intervals), setting.mesh.steps * duration)
    if any(abs(chain[i][node] - value) > 1e-12 * sizes.derivative[i] for node, i, value in states):
        return None
    still = Trajectory(
        problem, setting.mesh, setting.scheme, sizes, duration, problem.move.start_position or 0.0, tuple(chain)
    )
    if still.measure(problem.objective) or _may_earn(problem):
        return None
    return Attempt(Outcome(Claim.OPTIMAL, "coasting"), still, value=0.0, bound=0.0)


def _may_earn(problem: Problem) -> bool:
    """Whether the objective can be negative from an end to one of the same velocity: braking a load that has grown
    heavier gives back more than speeding it up has taken."""
    load = problem.load
    recovers = load.recovery > 0 and (bool(load.curves) or not isinstance(load.inertia, float))
    return recovers and any(term.minimize == "electrical_energy" for term in problem.objective.terms)


def _convex(setting: Setting, lean: Setting, chosen: Route, clock: Clock) -> tuple[Solution, Attempt]:
    """One convex program, and a second one where it leaves a tie."""
    duration = setting.problem.move.fixed_time
    assert duration is not None
    solver = "osqp" if chosen.solver == "osqp" else "auto"
    attempt = priced(lean, convex(lean, duration, to(setting.problem.objective), clock, solver), clock)
    return first_solved(setting, _convex_candidates(lean, attempt, chosen, clock), clock), attempt


def _convex_candidates(lean: Setting, first: Attempt, chosen: Route, clock: Clock) -> Iterator[tuple[Attempt, Route]]:
    """The tie-broken answer and the first one; where neither passes, or a limit is exceeded by rounding, the answer
    with the limits drawn in a little, and what the rungs make of it that were not needed."""
    yield break_tie(lean, first, chosen, clock)
    yield first, chosen
    if first.trajectory is None or lean.problem.transcription.solver in ALONE:
        return
    inner = convex(drawn_in(lean, _DRAWN), first.trajectory.duration, to(lean.problem.objective), clock)
    if inner.trajectory is not None:
        yield replace(inner, bound=first.bound, notes=first.notes), chosen
    for rung in rungs(lean)[1:] if first.gap <= ENOUGH else ():
        other = convex(lean, first.trajectory.duration, to(lean.problem.objective), clock, rung)
        if other.trajectory is not None:
            yield priced(lean, other, clock), chosen


def _shortest(setting: Setting, lean: Setting, chosen: Route, clock: Clock) -> tuple[Solution, Attempt]:
    """The least time, and the smoothest move in it if the edge of feasibility leaves room to find it."""
    attempt = minimum_time(lean, clock)
    return first_solved(setting, _shortest_candidates(lean, attempt, chosen, clock), clock), attempt


def _shortest_candidates(
    lean: Setting, attempt: Attempt, chosen: Route, clock: Clock
) -> Iterator[tuple[Attempt, Route]]:
    """The smoothest move in the least time; one a little off the edge, where there is room to keep the limits to the
    last digit; and the move that the search ended with."""
    if attempt.trajectory is None:
        yield attempt, chosen
        return
    duration = attempt.trajectory.duration
    move = lean.problem.move.model_copy(update={"time": duration})
    at_time = replace(lean, problem=lean.problem.model_copy(update={"move": move}))
    smooth = convex(at_time, duration, to(smoothest(lean.problem)), clock)
    first = attempt, chosen
    if smooth.trajectory is not None:
        tied = replace(attempt, trajectory=replace(smooth.trajectory, problem=lean.problem))
        first = tied, tied_route(chosen, lean, attempt, tied, "time")
    yield first
    later = duration * (1 + _LATER)
    inner = convex(drawn_in(at_time, _DRAWN), later, to(smoothest(lean.problem)), clock)
    if inner.trajectory is not None:
        yield replace(attempt, trajectory=replace(inner.trajectory, problem=lean.problem), value=later), first[1]
    if smooth.trajectory is not None:
        yield attempt, chosen


def _by_descent(
    setting: Setting, lean: Setting, chosen: Route, clock: Clock, start: Trajectory | None
) -> tuple[Solution, Attempt]:
    """Power or energy: a descent by convex programs, or by Ipopt where it does not settle, and a relaxation's bound."""
    relaxed, answer = optimum(lean, clock, start)
    if relaxed.trajectory is None:
        return conclude(setting, chosen, relaxed, clock), relaxed
    candidates = []
    if answer.trajectory is None:
        chosen = Route("pyomo", "ipopt", f"{answer.outcome.raw_status}; Ipopt from the relaxation's answer")
        answer = priced(lean, nonconvex(lean, to(setting.problem.objective), clock, relaxed.trajectory), clock)
        answer = replace(answer, bound=relaxed.bound)
    else:
        at_answer = linearised(lean, answer.trajectory)
        notes = answer.notes | {"starts": 1, "agreed": 1}
        if setting.problem.transcription.tighten:
            relaxed = tighten(lean, relaxed, answer.value, clock)
        answer = replace(priced(at_answer, replace(answer, notes=notes), clock), bound=relaxed.bound)
        candidates.append(break_tie(at_answer, answer, chosen, clock))
    return first_solved(setting, [*candidates, (answer, chosen)], clock, local=True), answer


def _with_all_limits(setting: Setting, lean: Setting, attempt: Attempt, clock: Clock) -> Solution:
    """Where the answer without the nonconvex limits breaks them: a local optimum with them. Its bound stays valid."""
    limits = ", ".join(nonaffine_limits(setting.problem))
    chosen = Route("pyomo", "ipopt", f"the {limits} limit is active, and nonconvex")
    local = from_several_starts(setting, clock)
    if local.trajectory is None and has_power_bound(setting.problem) and (found := explain_power(setting, clock)):
        text, timings = found["text"][0], clock.timings()
        status = Verdict.IMPOSSIBLE_ON_GRID
        return Solution(status, setting.problem, chosen, explanation=found, timings=timings, message=text)
    bound = max(attempt.bound, relax(setting, clock).bound if has_power_bound(setting.problem) else -np.inf)
    return _kept(setting, chosen, replace(local, bound=bound), clock)


def _local(setting: Setting, chosen: Route, clock: Clock, start: Trajectory | None) -> Solution:
    """Ipopt from several moves within the limits that are convex; if there is none, the move is impossible."""
    problem = setting.problem
    answer = from_several_starts(setting, clock, start)
    if answer.trajectory is None and isinstance(problem.move.time, tuple) and problem.can_wait:
        kinematic = without(setting, nonaffine_limits(problem))
        longest = convex(kinematic, problem.move.time[1], to(smoothest(problem)), clock)
        if longest.outcome.claim is Claim.INFEASIBLE:  # and then so is every shorter time
            answer = longest
    bounded = has_power_bound(problem) or (_is_affine(problem) and not nonaffine_limits(problem))
    if answer.trajectory is not None and bounded and problem.move.fixed_time is not None:
        answer = replace(answer, bound=relax(setting, clock).bound)
    return _kept(setting, chosen, answer, clock)


def _kept(setting: Setting, chosen: Route, answer: Attempt, clock: Clock) -> Solution:
    """The conclusion of a local answer. What a load over position makes is held at samples only: where the check finds
    a limit exceeded between them, the limits are drawn in by as much, and Ipopt goes on from there."""
    solution = conclude(setting, chosen, answer, clock, local=True)
    share, rounds = 0.0, _ROUNDS if setting.problem.load.curves else 0
    for _ in range(rounds):
        excess = solution.audit.get("excess", 0.0)
        if answer.trajectory is None or excess <= KEPT or clock.over:
            break
        share += 1.05 * excess
        goal = to(setting.problem.objective)
        inner = nonconvex(drawn_in(setting, share, sampled=True), goal, clock, answer.trajectory)
        if inner.trajectory is None:
            break
        inner = replace(inner, bound=answer.bound, notes=answer.notes)
        found = conclude(setting, chosen, inner, clock, local=True)
        if not found.status.solved and solution.status.solved:
            break
        answer, solution = inner, found
    return solution
