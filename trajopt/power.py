"""Power and energy with a global bound: sequential convex programs, and a relaxation (`trajopt.lifted`).

Programs with the power linearised at the last move descend to a local optimum: every point between two feasible moves
is feasible. Where the relaxation is a linear or quadratic program but for its squares, the descent comes first, from a
neighbour's move, the optimum in continuous time or a guess, and tangents at its answer stand in for the squares:
several times as fast, and bounding nearly as well, as the best moves of both are nearly one. Elsewhere the relaxation
is a cone program, and the descent starts from its answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from trajopt import motor, signals
from trajopt.attempt import Attempt, Clock, convex, to
from trajopt.lifted import Lifted, Touch
from trajopt.model import Claim, Outcome
from trajopt.objective import Lowered, lower
from trajopt.problem import Load, Objective, Problem
from trajopt.quantities import Quantities
from trajopt.rebuild import rebuild
from trajopt.routing import beyond_quadratic
from trajopt.signals import OnFloats, Signal
from trajopt.ties import determines_profile
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Setting, Transcript, without

_STEPS: Final = 30
_ENOUGH: Final = 1e-9  # relative: a smaller gain ends the descent; so does a program whose value was as it foretold
_NEARLY: Final = 1e-7  # and where the program that breaks the tie descends once more
_TIGHT: Final = 5e-9  # relative gap of the relaxation: it lies further below every move than that
_TOUCHING: Final = 1e-8  # and with tangents
_HUMP: Final = 0.75  # of a parabola of velocity, the rest is steady: measured, a program less than with either
_ROUNDS: Final = 6  # of tangents
_CLOSE: Final = 1e-8  # relative gap to an answer: no better bound is wanted
_WORTH: Final = 0.02  # of a gap: a bound that could rise by less is not raised
_WIDE: Final = 5e-3  # relative gap: wider ones may come from a descent that started badly


def optimum(setting: Setting, clock: Clock, start: Trajectory | None = None) -> tuple[Attempt, Attempt]:
    """The relaxation with its bound, and the answer of a descent, from ``start`` where the descent goes first; the
    relaxation twice where it has no trajectory."""
    if _is_quadratic(setting.problem) and (found := _between_tangents(setting, clock, start)) is not None:
        return found
    relaxed = relax(setting, clock)
    return relaxed, relaxed if relaxed.trajectory is None else descend(setting, relaxed.trajectory, clock)


def relax(setting: Setting, clock: Clock, touch: Sequence[Touch] = (), answer: float | None = None) -> Attempt:
    """The relaxation: its ``bound`` holds for every move on the mesh; its trajectory meets all but the power.

    ``touch``: where tangents stand in for the squares: a bound then belongs to the value of an ``answer``, without one
    it is but a step on the way to it."""
    duration, setting = setting.problem.move.fixed_time, without(setting, ["brake_energy"])
    assert duration is not None
    relaxed = replace(setting, quantities=partial(Lifted, touch=tuple(touch)))

    def goal(transcript: Transcript) -> Lowered:
        cost = lower(transcript, setting.problem.objective)
        return cost if answer is None else cost.over(answer)

    enough = _TOUCHING if touch else _TIGHT
    return convex(relaxed, duration, goal, clock, enough=enough, step=bool(touch) and answer is None)


def _is_quadratic(problem: Problem) -> bool:
    """Whether the relaxation is a linear or quadratic program but for its squares, and it is known where to."""
    electrical = any(term.minimize == "electrical_energy" for term in problem.objective.all_terms)
    placed = isinstance(problem.move.end.position, float)
    return problem.order == 3 and placed and not electrical and not beyond_quadratic(problem)


def _between_tangents(setting: Setting, clock: Clock, start: Trajectory | None) -> tuple[Attempt, Attempt] | None:
    """As `optimum`, by tangents; None where the bound stays far off, or a program fails."""
    start = _guess(setting) if start is None else start
    if setting.problem.objective.ceilings:  # with power linearised so far off they could not be kept
        relaxed = relax(setting, clock, [Touch.at(start)])
        if relaxed.trajectory is None:
            return (relaxed, relaxed) if relaxed.outcome.claim is Claim.INFEASIBLE else None
        start = relaxed.trajectory
    answer = descend(setting, start, clock, feasible=False)
    following, touch = answer.trajectory, list[Touch]()
    while following is not None and len(touch) < _ROUNDS:
        touch.append(Touch.at(following))
        relaxed = relax(setting, clock, touch, answer.value)
        following = relaxed.trajectory
        gap = answer.value - relaxed.bound
        if gap <= _CLOSE * abs(answer.value) or _missed(relaxed, touch) <= _WORTH * gap:
            return (relaxed, answer) if gap <= _WIDE * abs(answer.value) else None
    return None


def _guess(setting: Setting) -> Trajectory:
    """What the power is linearised at first: a move between the gentlest one and a steady one, at which energy is
    linear. It need not keep states and limits."""
    problem, mesh = setting.problem, setting.mesh
    move, duration = problem.move, problem.move.fixed_time
    first, last = (state.fixed(problem.order)[1] for state in (move.start, move.end))
    assert isinstance(move.end.position, float) and duration is not None
    origin = move.start_position or 0.0
    steady = {term.label for term in problem.objective.terms} <= {"energy", "power l1"}
    missing = (move.end.position - origin) / duration - (first + last) / 2
    hump = 0.0 if steady else 6 * _HUMP * missing
    start = np.array([0.0, first + missing - hump / 6, (last - first + hump) / duration])
    jerk = np.full(mesh.intervals, -2 * hump / duration**2)
    chain = setting.scheme.rollout(start, jerk, mesh.steps * duration)
    return Trajectory(problem, mesh, setting.scheme, setting.sizes, duration, origin, tuple(chain))


def _missed(relaxed: Attempt, touch: Sequence[Touch]) -> float:
    """About how far the bound would rise with tangents at the relaxation's own move, SI: by how far each row would move
    there, times its multiplier."""
    if relaxed.trajectory is None:
        return np.inf
    rows, here = relaxed.outcome.prices["squares"], Touch.at(relaxed.trajectory)
    apart = [here.middles - there.middles for there in touch] + [here.nodes - there.nodes for there in touch]
    far = np.concatenate([x[1:-1] for x in apart])[: len(rows.own)]  # nodes are squared for viscous friction only
    return relaxed.slope * float(rows.per_unit @ np.square(far / rows.own))


def descend(setting: Setting, start: Trajectory, clock: Clock, feasible: bool = True) -> Attempt:
    """From a move, ``feasible`` or not, to a local optimum by programs with linearised power; the attempt's prices are
    those of the last one. The outcome claims FAILED where the descent does not settle."""
    objective, duration = setting.problem.objective, start.duration
    enough = _ENOUGH if determines_profile(setting.problem) else _NEARLY
    here, penalty = start, 0.0
    attempt = Attempt(Outcome(Claim.FAILED, "no step"))
    for step in range(_STEPS):
        attempt = convex(replace(setting, quantities=_linearised_at(here)), duration, to(objective), clock, step=True)
        if attempt.trajectory is None:
            return attempt
        penalty = max(penalty, _penalty(attempt))
        value = _cost(objective, here, penalty) if feasible or step else np.inf
        there, best = _search_line(setting, here, attempt.trajectory, value, penalty)
        settled = min(value - best, abs(best - attempt.value)) <= enough * abs(best)
        if best <= value:
            here = there
        if settled:
            value = here.measure(objective)
            return replace(attempt, trajectory=here, value=value, bound=-np.inf, notes={"programs": step + 1})
    return Attempt(Outcome(Claim.FAILED, f"the descent did not settle in {_STEPS} programs"))


def linearised(setting: Setting, trajectory: Trajectory) -> Setting:
    """The setting with power linearised at a trajectory, for the prices of an answer."""
    return replace(setting, quantities=_linearised_at(trajectory))


def _cost(objective: Objective, trajectory: Trajectory, penalty: float) -> float:
    """The true objective and, by an exact penalty per part of a ceiling, what exceeds ceilings: only a linearised power
    keeps them on the way."""
    shares = [trajectory.measure(Objective(terms=(c.term,))) / c.at_most for c in objective.ceilings or ()]
    return trajectory.measure(objective) + penalty * sum(max(share - 1, 0.0) for share in shares)


def _penalty(attempt: Attempt) -> float:
    """Twice the largest price of a ceiling, SI objective per part of it: enough for the penalty to be exact."""
    rows = [rows for name, rows in attempt.outcome.prices.items() if name.endswith(".at_most")]
    return 2 * max((float(np.abs(r.per_unit @ r.own)) * attempt.slope for r in rows), default=0.0)


def _search_line(
    setting: Setting, here: Trajectory, there: Trajectory, value: float, penalty: float
) -> tuple[Trajectory, float]:
    """The best of some points on the way from ``here`` to ``there``, by `_cost`."""
    objective = setting.problem.objective
    best, found = there, _cost(objective, there, penalty)
    share = 0.5
    while found > value and share > 1e-4:
        top = here.chain[-1] + share * (there.chain[-1] - here.chain[-1])
        start = np.array([x[0] for x in here.chain[:-1]])
        best = rebuild(setting.problem, setting.mesh, setting.scheme, setting.sizes, here.duration, start, top)
        found, share = _cost(objective, best, penalty), share / 2
    return best, found


def _linearised_at(reference: Trajectory) -> Any:
    """Quantities whose power is linearised at a trajectory; of electrical power what is not convex."""
    known = reference.transcript.quantities
    at = known.ends("force", "acceleration", "velocity", "current") if known.problem.load.motor else []
    forces = known.ends("force", "velocity")

    class Linearised(Quantities):
        def _power(self) -> Signal:
            pairs = zip(self.ends("force", "velocity"), forces, strict=True)
            return signals.sampled([_product_at(self.model, x, x0) for x, x0 in pairs], self.signal("force"))

        def _electrical_power(self) -> Signal:
            here = self.ends("force", "acceleration", "velocity", "current")
            return signals.sampled([self._drawn(x, x0) for x, x0 in zip(here, at, strict=True)], self.signal("force"))

        def _drawn(self, here: Any, there: Any) -> Any:
            (_, a, v, u), (_, a0, v0, u0) = here, there
            load, model, way = self.problem.load, self.model, self.problem.one_way
            power = model.times(load.inertia, _product_at(model, (a, v), (a0, v0)))
            power = power + motor.heat(model, load, u, self.sizes.current)
            if load.viscous:
                size = self.sizes.derivative[1]
                power = power + model.times(load.viscous * size**2, model.squares(v * (1 / size)))
            if load.coulomb:
                power = power + model.times(way * load.coulomb, v)
            return power + _iron_at(model, load, way, (u, v), (u0, v0))

    return Linearised


def _product_at(model: Any, pair: Any, at: Any) -> Any:
    """A product linearised."""
    (x, y), (x0, y0) = pair, at
    return model.times(x0, y) + model.times(y0, x) - x0 * y0


def _iron_at(model: Any, load: Load, way: int, pair: Any, at: Any) -> Any:
    """The losses in iron, linearised in current and velocity."""
    (u, v), (u0, v0) = pair, at
    raised, slope = OnFloats().raised(u0, load.hysteresis_exponent, 1.0)
    value = load.eddy * (v0 * u0) ** 2 + load.hysteresis * np.abs(v0) * raised
    by_current = 2 * load.eddy * v0**2 * u0 + load.hysteresis * np.abs(v0) * slope
    by_velocity = 2 * load.eddy * u0**2 * v0 + load.hysteresis * way * raised
    return value + model.times(by_current, u - u0) + model.times(by_velocity, v - v0)


