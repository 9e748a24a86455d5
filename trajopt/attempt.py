"""One program solved once: a problem on a mesh, transcribed, run, and read back as a trajectory or a verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from time import perf_counter
from typing import Any, Final

import numpy as np

import norms
from trajopt.lagrangian import Lagrangian
from trajopt.mesh import LARGE, Floats, Mesh
from trajopt.model import Claim, Outcome
from trajopt.objective import Lowered, lower
from trajopt.problem import DERIVATIVES, Objective, Problem, Term
from trajopt.rebuild import rebuild
from trajopt.scaling import Sizes, resized
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Setting, Transcript, transcribe, transcribe_again

ENOUGH: Final = 1e-9  # gap: no further rung of the ladder is climbed
_STEP: Final = 1e-7  # and of a step on the way


class Clock:
    """Seconds left of a wall-time limit, and where the time went."""

    def __init__(self, seconds: float | None = None) -> None:
        self._started = perf_counter()
        self._seconds = seconds
        self.spent: dict[str, float] = {}

    def left(self) -> float | None:
        """Seconds until the limit, at least a hundredth; None without a limit."""
        return None if self._seconds is None else max(self._seconds - (perf_counter() - self._started), 0.01)

    @property
    def over(self) -> bool:
        """Whether the limit has passed."""
        return self._seconds is not None and perf_counter() - self._started >= self._seconds

    def charge(self, what: str, since: float) -> None:
        """Add the time since ``since`` to an account."""
        self.spent[what] = self.spent.get(what, 0.0) + perf_counter() - since

    def timings(self) -> dict[str, float]:
        """All accounts, and the total, in s."""
        return {**self.spent, "total": perf_counter() - self._started}


@dataclass(frozen=True)
class Attempt:
    """What came of one run: the outcome, the trajectory read from it, and the value and bound of the objective, SI."""

    outcome: Outcome
    trajectory: Trajectory | None = None
    value: float = np.nan
    bound: float = -np.inf
    slope: float = np.nan  # SI objective per unit of the program's
    notes: dict[str, Any] = field(default_factory=dict)  # prices; starts and agreed; programs
    size: float = 1.0  # of the objective, SI
    forgiven: float = 0.0  # see `trajopt.model.Outcome.forgiven`; SI
    convex: bool = True
    laid: tuple[Setting, Transcript] | None = field(default=None, repr=False)  # of a convex program, with its model

    @property
    def gap(self) -> float:
        """(value - bound)/|value|, for a value near zero over a hundred-thousandth of the objective's size."""
        return (self.value - self.bound) / max(abs(self.value), 1e-5 * self.size) if np.isfinite(self.bound) else np.inf

    def rows_of(self, setting: Setting, duration: float) -> Transcript | None:
        """The transcript of the convex program, if it is one of just this setting and duration (s)."""
        known = self.laid
        return known[1] if known is not None and known[0] is setting and known[1].duration == duration else None


Goal = Callable[[Transcript], Lowered]


def convex(
    setting: Setting,
    duration: float,
    goal: Goal,
    clock: Clock,
    solver: str = "auto",
    widen: Sequence[str] = (),
    widen_size: float = 1.0,
    enough: float = ENOUGH,
    step: bool = False,
    again: Attempt | None = None,
) -> Attempt:
    """Solve a convex program at a fixed duration; ``goal`` lowers its objective. Climbs the ladder of solvers and their
    settings until a run is optimal within a gap that is ``enough`` by our own bound, or infeasible by a checked
    certificate; each rung has the sizes of the best move so far. ``solver``: one rung, alone; a ``step`` on the
    way needs no close bound, and none where the first solvers claim the optimum.

    The sides of limits named in ``widen`` are moved outwards together, by one new nonnegative variable of size
    ``widen_size`` (see `trajopt.transcribe.transcribe`).

    ``again``: an attempt whose rows are taken as they are, if they are those of this setting and duration: a goal that
    brings no others finds the program built. Its answer is taken to be near: rows far from it are left out first.
    """
    from trajopt.convex_solvers import QUADRATIC, RESCUES
    from trajopt.model_cvxpy import ConvexModel

    enough = (max(enough, _STEP) if step else enough) * rounding(setting.mesh)
    best: Attempt | None = None
    stated: Sizes | None = None  # for which the model has been built
    for rung in (solver,) if solver != "auto" else rungs(setting):
        if rung in RESCUES and best is not None and best.gap <= 1e-6:
            break
        if stated is not setting.sizes:
            since, stated = perf_counter(), setting.sizes
            model = ConvexModel()
            if (known := None if again is None else again.rows_of(setting, duration)) is not None:
                transcript, model = known, known.model
            elif widen:
                by = model.vector(1, widen_size, np.zeros(1), np.full(1, np.inf), name="widening")[0]
                transcript = transcribe(setting, model, duration, dict.fromkeys(widen, by))
            else:
                transcript = transcribe_again(setting, model, duration)
                model = transcript.model
            lowered = goal(transcript)
            model.minimize(lowered.expression)
            clock.charge("model", since)
        if best is not None and not model.takes(rung):
            continue
        since, believed = perf_counter(), step and rung in QUADRATIC
        outcome = model.run(rung, clock.left(), np.inf if believed else enough, near=again is not None)
        clock.charge("solve", since + outcome.proof)
        clock.charge("bound", perf_counter() - outcome.proof)
        attempt = replace(_read(setting, transcript, lowered, outcome), laid=(setting, transcript))
        twice = best is not None and outcome.claim is best.outcome.claim is Claim.UNBOUNDED  # once may be rounding
        accepted = believed and outcome.claim is Claim.OPTIMAL
        if accepted or attempt.gap <= enough or outcome.claim is Claim.INFEASIBLE or twice:
            return attempt
        bound = max(attempt.bound, best.bound if best is not None else -np.inf)  # of one program, all of them
        nothing = best is None or best.outcome.claim is Claim.FAILED  # of what failed the last one went farthest
        closer = attempt.trajectory is not None and (best is None or best.trajectory is None or attempt.gap < best.gap)
        if best is None or nothing or closer:
            best = attempt
        best = replace(best, bound=bound)
        if clock.over:
            break
        if best.trajectory is not None and not widen:  # as large as the move is; a widening is told in the first sizes
            setting = replace(setting, sizes=resized(setting.sizes, setting.problem, best.trajectory.chain))
    assert best is not None
    return best


def rounding(mesh: Mesh) -> float:
    """By how much more than on a small mesh a solver may miss an optimum: rounding grows with the rows."""
    return max(1.0, mesh.intervals / 200)


def rungs(setting: Setting) -> Sequence[str]:
    """The solvers and settings that a program goes to in turn: those of PIQP or Clarabel where asked for, else all; on
    a large mesh without the first, which often fails there."""
    from trajopt.convex_solvers import LADDER, QUADRATIC

    own = {"piqp": QUADRATIC, "clarabel": tuple(rung for rung in LADDER if rung not in QUADRATIC)}
    found = own.get(setting.problem.transcription.solver, LADDER)
    return found[1:] if found[0] == QUADRATIC[0] and setting.mesh.intervals > LARGE else found


def nonconvex(setting: Setting, goal: Goal, clock: Clock, start: Trajectory, widen: Sequence[str] = ()) -> Attempt:
    """A local optimum by Ipopt, from one start; see `NonconvexProgram`."""
    return NonconvexProgram(setting, goal, clock, widen).run(start)


class NonconvexProgram:
    """The nonconvex program of a setting, built once, for any number of starts; the duration is free where the problem
    leaves it free. ``widen`` as for `convex`."""

    def __init__(self, setting: Setting, goal: Goal, clock: Clock, widen: Sequence[str] = ()) -> None:
        from trajopt.model_pyomo import NonconvexModel

        since = perf_counter()
        self._setting, self._clock, self._model = setting, clock, NonconvexModel()
        model, duration, self._free = self._model, setting.problem.move.fixed_time, None
        if duration is None:
            self._free = free_duration(setting, model, setting.sizes.duration)
        by = model.vector(1, 1.0, np.zeros(1), np.full(1, np.inf), name="widening")[0] if widen else None
        widened = dict.fromkeys(widen, by)
        self._transcript = transcribe(setting, model, duration if self._free is None else self._free[0], widened)
        self._lowered = goal(self._transcript)
        model.minimize(self._lowered.expression)
        clock.charge("model", since)

    def run(self, start: Trajectory, rung: str = "ipopt") -> Attempt:
        """A local optimum by Ipopt, from a starting trajectory, on whatever mesh that is; ``rung``: one of
        `trajopt.model_pyomo.RUNGS`."""
        since, model = perf_counter(), self._model
        model.afresh()
        if self._free is not None:
            model.start(self._free, np.array([start.duration]))
        for x, values in zip(self._transcript.chain, _at_nodes(start, self._setting.mesh), strict=True):
            model.start(x, values)
        outcome = model.run(rung, self._clock.left())
        self._clock.charge("solve", since)
        return _read(self._setting, self._transcript, self._lowered, outcome)


def _at_nodes(start: Trajectory, mesh: Mesh) -> Sequence[Floats]:
    """The chain of a trajectory on another mesh: what it passes at the nodes, and from one to the next."""
    if start.mesh is mesh:
        return start.chain
    times = mesh.fractions * start.duration
    found = list(start.at(np.minimum(times, start.duration)).values())[: start.order]
    found[0] = found[0] - start.origin
    return [*found, np.diff(found[-1]) / np.diff(times)]


def free_duration(setting: Setting, model: Any, start: float) -> Any:
    """(1,) a duration that the model chooses, within its range, scaled, and started at ``start`` s."""
    time, size = setting.problem.move.time, setting.sizes.duration
    shortest, longest = time if isinstance(time, tuple) else (0.01 * size, np.inf)
    free = model.vector(1, size, np.array([shortest]), np.array([longest]))
    model.start(free, np.array([start]))
    return free


def lagrangian(setting: Setting, duration: float, goal: Goal, attempt: Attempt) -> float:
    """The Lagrangian, at the attempt's primal and dual vector, of its program with another duration."""
    assert attempt.outcome.pair is not None and attempt.trajectory is not None
    model = Lagrangian(attempt.outcome.pair, attempt.convex)
    model.minimize(goal(transcribe(replace(setting, sizes=attempt.trajectory.sizes), model, duration)).expression)
    return model.value


def _read(setting: Setting, transcript: Transcript, lowered: Lowered, outcome: Outcome) -> Attempt:
    if outcome.claim not in (Claim.OPTIMAL, Claim.INACCURATE):
        return Attempt(outcome)
    model = transcript.model
    duration = transcript.duration if isinstance(transcript.duration, float) else model.value(transcript.duration)
    start = np.array([np.ravel(model.value(x[0]))[0] for x in transcript.chain[:-1]])
    top = model.value(transcript.chain[-1])
    if not (np.all(np.isfinite(start)) and np.all(np.isfinite(top))):
        return Attempt(Outcome(Claim.FAILED, outcome.raw_status + ", with non-finite values"))
    trajectory = rebuild(setting.problem, setting.mesh, setting.scheme, setting.sizes, float(duration), start, top)
    return Attempt(
        outcome,
        trajectory,
        lowered.si(outcome.value),
        lowered.si(outcome.bound),
        lowered.slope(outcome.value),
        size=lowered.scale,
        forgiven=lowered.slope(outcome.value) * outcome.forgiven,
        convex=model.convex,
    )


def to(objective: Objective) -> Goal:
    """The goal of minimising an objective."""
    return lambda transcript: lower(transcript, objective)


def smoothest(problem: Problem) -> Objective:
    """The L2 norm of the top derivative: strictly convex, so that its minimiser is one and the same everywhere."""
    return _least(DERIVATIVES[problem.order])


@cache
def _least(name: str) -> Objective:
    return Objective(terms=(Term(minimize=name, norm=norms.L2()),))


def unlimited(setting: Setting, duration: float) -> Trajectory:
    """The smoothest move between the prescribed states without any limit: a start for local solvers."""
    top = np.zeros(setting.mesh.intervals)
    start = np.zeros(setting.problem.order)
    return rebuild(setting.problem, setting.mesh, setting.scheme, setting.sizes, duration, start, top)
