"""Local optima by Ipopt from several starts: what there is where no convex program gives the answer."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import norms
from trajopt.attempt import Attempt, Clock, NonconvexProgram, convex, smoothest, to, unlimited
from trajopt.model import Claim, Outcome
from trajopt.prices import priced
from trajopt.problem import DERIVATIVES, Objective, Term
from trajopt.routing import is_time_search, nonaffine_limits
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Setting, without

_COARSE: Final = 50  # intervals, on which starts for a fine mesh are tried


def from_several_starts(setting: Setting, clock: Clock, given: Trajectory | None = None) -> Attempt:
    """The best of the local optima that Ipopt finds, with its prices, and a note on how many starts there were and how
    many agreed; where a start is ``given`` and leads to one, from that alone. Starts for a fine mesh are tried on a
    coarse one, and the best of what comes of them goes on."""
    fine, notes = setting.mesh.intervals >= 2 * _COARSE and setting.scheme.terms > 1, {}
    if given is None and fine:
        coarse = best_of_starts(_on_mesh(setting, _COARSE), clock)
        given, notes = coarse.trajectory, coarse.notes
    if given is not None:
        program = NonconvexProgram(setting, to(setting.problem.objective), clock)
        answer = program.run(given, "ipopt-warm")
        if answer.trajectory is not None:
            return priced(setting, replace(answer, notes=notes or {"starts": 1, "agreed": 1}), clock)
    return priced(setting, best_of_starts(setting, clock), clock)


def _on_mesh(setting: Setting, intervals: int) -> Setting:
    """The setting on another number of intervals."""
    transcription = setting.problem.transcription.model_copy(update={"intervals": intervals})
    coarse = Setting.of(setting.problem.model_copy(update={"transcription": transcription}))
    return replace(coarse, quantities=setting.quantities)


def best_of_starts(setting: Setting, clock: Clock) -> Attempt:
    """The best of what comes of all starts on this mesh, with that note; without a trajectory where nothing does."""
    program = NonconvexProgram(setting, to(setting.problem.objective), clock)
    found: list[Attempt] = []
    failed: list[Attempt] = []
    for start in starts(setting, clock):
        if start.trajectory is None:
            failed.append(start)
            break
        attempt = program.run(start.trajectory)
        (failed if attempt.trajectory is None else found).append(attempt)
        if clock.over:
            break
    if not found:
        return failed[0]
    best = min(found, key=lambda attempt: attempt.value)
    agreed = sum(a.value <= best.value + 1e-6 * abs(best.value) for a in found)
    return replace(best, notes={"starts": len(found) + len(failed), "agreed": agreed})


def starts(setting: Setting, clock: Clock) -> Iterator[Attempt]:
    """Moves to start from: the smoothest within the convex limits, and compromises between that and the slowest and the
    gentlest, which alone are steps where no limit holds them; where the duration is free, the smoothest without limits
    at several durations."""
    problem, duration = setting.problem, setting.problem.move.fixed_time
    lean = without(setting, nonaffine_limits(problem))
    if duration is None:
        for factor in (1.0, 1.6):
            still = unlimited(setting, factor * _first_duration(setting))
            yield Attempt(Outcome(Claim.OPTIMAL, "unlimited"), still)
        return
    smooth = smoothest(problem).terms[0].model_copy(update={"weight": 1 / setting.sizes.derivative[problem.order]})
    yield convex(lean, duration, to(smoothest(problem)), clock)
    for i in (1, 2):
        peak = Term(minimize=DERIVATIVES[i], norm=norms.Linf(), weight=1 / setting.sizes.derivative[i])
        yield convex(lean, duration, to(Objective(terms=(peak, smooth))), clock)


def _first_duration(setting: Setting) -> float:
    """A duration to start from, in s: the middle of the range, or somewhat more than the limits allow at least."""
    if isinstance(setting.problem.move.time, tuple):
        return setting.sizes.duration
    return (1.2 if is_time_search(setting.problem) else 1.5) * setting.sizes.duration
