"""Power and energy with a global bound: a cone program that relaxes them, then sequential convex programs.

On the exact scheme with jerk constant on intervals, w_k = v_k + a_k h/2 (the middle Bernstein coefficient of velocity)
gives the power at the nodes exactly as m a_k v_k = m (w_k² - w_(k-1)²)/(2h). The relaxation puts q_k >= w_k²/2 in the
place of the squares, anchored at the prescribed ends, and below the chord of what w_k can reach: q_k <= top_k w_k/2.
Power is then affine, and the optimum a lower bound for every move on the mesh. Where acceleration is constant on
intervals, squares of the velocity at the nodes do the same for the mean of the power at both ends of an interval,
m (v_(k+1)² - v_k²)/(2h), from which the ends themselves lie m h a_k²/2 off to either side: b_k >= m h a_k²/2 stands for
that. Losses of a motor that are convex in force add to it; those that are not are left out. From the answer of the
relaxation, programs with the power linearised at the last one descend to a local optimum: every point between two
feasible moves is feasible.

Where nothing else needs cones, the descent comes first, from a guess, and tangents at its answer stand in for the
squares, q_k >= u_k w_k - u_k²/2 at its speeds u: linear and quadratic programs, several times as fast. They bound it
nearly as well as the squares do, since the best moves of both are nearly one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np

from trajopt import motor, signals
from trajopt.attempt import Attempt, Clock, convex, to
from trajopt.mesh import Floats
from trajopt.model import Claim, Outcome
from trajopt.motor import implied
from trajopt.objective import Lowered, lower
from trajopt.problem import Load, Objective, Problem
from trajopt.quantities import Quantities
from trajopt.rebuild import rebuild
from trajopt.routing import beyond_quadratic
from trajopt.signals import OnFloats, Signal
from trajopt.ties import determines_profile
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Setting, Transcript, prescribed, without

_STEPS: Final = 30
_ENOUGH: Final = 1e-9  # relative: a smaller gain ends the descent; so does a program whose value was as it foretold
_NEARLY: Final = 1e-7  # and where the program that breaks the tie descends once more
_TIGHT: Final = 5e-9  # relative gap of the relaxation: it lies further below every move than that
_TOUCHING: Final = 1e-7  # and with tangents
_HUMP: Final = 0.75  # of a parabola of velocity, the rest is steady: measured, a program less than with either
_ROUNDS: Final = 6  # of tangents
_CLOSE: Final = 1e-8  # relative gap to an answer: no better bound is wanted
_WORTH: Final = 0.02  # of a gap: a bound that could rise by less is not raised
_WIDE: Final = 5e-3  # relative gap: wider ones may come from a descent that started badly


@dataclass(frozen=True)
class Touch:
    """The speeds of a move at which tangents touch the squares: (N+1,) at the nodes, (N,) those called w above."""

    nodes: Floats
    middles: Floats

    @classmethod
    def at(cls, trajectory: Trajectory) -> Touch:
        """Those of a trajectory."""
        way, steps = trajectory.problem.one_way, trajectory.mesh.steps * trajectory.duration
        velocity, acceleration = trajectory.chain[1:3]
        return cls(way * velocity, way * (velocity[:-1] + acceleration[:-1] * steps / 2))


def optimum(setting: Setting, clock: Clock) -> tuple[Attempt, Attempt]:
    """The relaxation with its bound, and the answer of a descent; the relaxation twice where it has no trajectory."""
    if _is_quadratic(setting.problem) and (found := _between_tangents(setting, clock)) is not None:
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
    """Whether the relaxation is a linear or quadratic program but for its squares."""
    electrical = any(term.minimize == "electrical_energy" for term in problem.objective.all_terms)
    return problem.order == 3 and not electrical and not beyond_quadratic(problem)


def _between_tangents(setting: Setting, clock: Clock) -> tuple[Attempt, Attempt] | None:
    """As `optimum`, by tangents; None where the bound stays far off, or a program fails."""
    start = _guess(setting)
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


@dataclass(frozen=True)
class Lifted(Quantities):
    """Quantities whose power is relaxed (see the module). Its variables join the model when power is first asked.

    ``reach``: (lower, upper) bounds on the speeds that are squared, where better ones than those of the limits are
    known: the chord then runs between the squares of both. ``touch``: moves whose tangents stand in for the squares.
    """

    reach: tuple[Floats, Floats] | None = None
    touch: tuple[Touch, ...] = ()

    def _power(self) -> Signal:
        kept = getattr(self.model, "lifted_power", None)
        if kept is None:
            known = self._nodes() if self.problem.order == 3 else self._ends()
            kept = self.model.lifted_power = known
        return kept

    def _electrical_power(self) -> Signal:
        model, load = self.model, self.problem.load
        heats = [motor.heat(model, load, u, self.sizes.current) for (u,) in self.ends("current")]
        mechanical = self._power()
        if mechanical.degree == 0:  # the mean of both ends alone is known
            return Signal(None, (sum(heats[1:], heats[0]) * (1 / len(heats)) + mechanical.pieces[0],))
        powers = [heat + power for heat, power in zip(heats, mechanical.stations, strict=True)]
        return signals.sampled(powers, mechanical)

    def _ends(self) -> Signal:
        """Power at both ends of every interval, affine in the chain, the lifted squares and the spread b; or the mean
        of both, where no more is asked for."""
        way, model, mass, step = self.problem.one_way, self.model, self.problem.load.inertia, float(self.steps[0])
        velocity = self.signal("velocity").nodes
        states = {(node, i): x for node, i, x in prescribed(self.problem, self.mesh)}
        ends = states[0, 1], states[self.mesh.intervals, 1]
        assert isinstance(mass, float)
        squares = self._squares(way * velocity, _node_reach(self, step), ends, self.reach)
        model.lifted_squares = (way * velocity, squares)
        mean = model.times(mass / step, squares[1:] - squares[:-1])
        friction = self._friction(velocity, squares)
        if not self._is_felt():
            return Signal(None, (mean + (friction[:-1] + friction[1:]) * 0.5,))
        spread = self._spread(mass / step, squares, ends)
        return Signal(None, (mean - spread + friction[:-1], mean + spread + friction[1:]))

    def _is_felt(self) -> bool:
        """Whether power matters at an instant; an integral of it feels the mean alone, but where its sign turns."""
        limited = self.problem.limits.power is not None
        return limited or any(term.minimize == "power" for term in self.problem.objective.terms)

    def _spread(self, factor: float, squares: Any, ends: tuple[float, float]) -> Any:
        """(N,) variables from m h a²/2 upwards, half the change of power over an interval; ``factor``: m/h. On one from
        or to rest they are at least the power at its other end, halved."""
        model, sizes, count = self.model, self.sizes.derivative, self.mesh.intervals
        spread = model.vector(count, 1.0, np.zeros(count), np.full(count, np.inf))
        model.nonpositive(model.squares(self.chain[2] * (1 / sizes[2])) - spread)
        spread = model.times(factor * float(self.steps[0]) ** 2 / 2 * sizes[2] ** 2, spread)
        beside = (squares[1:2], spread[:1]), (squares[-2:-1], spread[-1:])
        for velocity, (there, here) in zip(ends, beside, strict=True):
            if velocity == 0:
                model.nonpositive(factor * there - here, factor * sizes[1] ** 2)
        return spread

    def _friction(self, velocity: Any, squares: Any) -> Any:
        """(N+1,) the power of friction, from the velocity and its lifted squares."""
        load, model = self.problem.load, self.model
        power: Any = np.zeros(self.mesh.intervals + 1)
        if load.viscous:
            power = power + model.times(2 * load.viscous, squares)
        if load.coulomb:
            power = power + model.times(self.problem.one_way * load.coulomb, velocity)
        return power

    def _nodes(self) -> Signal:
        """Power at the nodes, affine in the chain and the lifted squares."""
        load, way, model = self.problem.load, self.problem.one_way, self.model
        mass, step, last = load.inertia, float(self.steps[0]), self.mesh.intervals
        velocity = self.signal("velocity")
        ends = {(node, i): x for node, i, x in prescribed(self.problem, self.mesh)}
        assert isinstance(mass, float)
        speeds = (ends[0, 1] + ends[0, 2] * step / 2, ends[last, 1] - ends[last, 2] * step / 2)
        middles = [touch.middles for touch in self.touch]
        squares = self._squares(way * velocity.pieces[1], _reach(self, step), speeds, self.reach, middles)
        model.lifted_squares = (way * velocity.pieces[1], squares)
        first, final = (np.array([mass * ends[k, 1] * ends[k, 2]]) for k in (0, last))
        power = model.concatenate([first, model.times(mass / step, squares[1:] - squares[:-1]), final])
        nodes: Any = None
        if load.viscous:
            touch = [touch.nodes for touch in self.touch]
            speeds = (ends[0, 1], ends[last, 1])
            nodes = self._squares(way * velocity.nodes, _node_reach(self, step), speeds, None, touch)
        return Signal(power + self._friction(velocity.nodes, nodes), ())

    def _squares(
        self,
        speed: Any,
        top: Floats,
        ends: tuple[float, float],
        reach: tuple[Floats, Floats] | None = None,
        touch: Sequence[Floats] = (),
    ) -> Any:
        """What stands for speed²/2: its value at the ends; between them variables from speed²/2, or its tangents at the
        speeds of ``touch``, to the chord top·speed/2, or that between the bounds of ``reach``, each scaled by its own
        top."""
        low = np.zeros(len(top))
        if reach is not None:
            low, top = np.maximum(reach[0], 0.0), np.minimum(top, reach[1])
        model, known = self.model, np.flatnonzero(np.isfinite(top[1:-1]))
        top = np.where(np.isfinite(top), top, self.sizes.derivative[1])[1:-1]
        share = model.times(1 / top, speed[1:-1])
        free = np.full(len(top), np.inf)
        q = model.vector(len(top), 1.0, -free, free)
        for there in touch:
            at = there[1:-1] / top
            model.nonpositive(model.times(2 * at, share) - at**2 - q, name="squares", at=at, own=top)
        if not touch:
            model.nonpositive(model.squares(share) - q)
        if len(known):
            least = (low[1:-1] / top)[known]
            model.nonpositive(q[known] - model.times(1 + least, share[known]) + least)
        inner = model.times(top**2 / 2, q)
        return model.concatenate([np.array([ends[0] ** 2 / 2]), inner, np.array([ends[1] ** 2 / 2])])


def _reach(quantities: Quantities, step: float) -> Floats:
    """(N,) the largest w_k that the limits allow, from either end."""
    nodes = [_greedy(quantities, step, backwards) for backwards in (False, True)]
    forward = nodes[0][0][:-1] + nodes[0][1][:-1] * step / 2
    backward = (nodes[1][0][:-1] + nodes[1][1][:-1] * step / 2)[::-1]
    return np.minimum(np.minimum(forward, backward), _fastest(quantities))


def _node_reach(quantities: Quantities, step: float) -> Floats:
    """(N+1,) the largest speed that the limits allow at the nodes, from either end."""
    forward, backward = (_greedy(quantities, step, backwards)[0] for backwards in (False, True))
    return np.minimum(np.minimum(forward, backward[::-1]), _fastest(quantities))


def _fastest(quantities: Quantities) -> float:
    return _outwards(implied(quantities.problem), "velocity", quantities.problem.one_way)


def _greedy(quantities: Quantities, step: float, backwards: bool) -> tuple[Floats, Floats]:
    """(N+1,) speed and acceleration of the move that speeds up as hard as it can from one end, time running away from
    it: no other is faster anywhere, since each derivative grows with the one above it."""
    problem, way = implied(quantities.problem), quantities.problem.one_way
    state = (problem.move.end if backwards else problem.move.start).fixed(problem.order)
    turn = -1.0 if backwards else 1.0
    hardest = [_outwards(problem, name, way * sign) for name, sign in (("acceleration", turn), ("jerk", 1.0))]
    count = quantities.mesh.intervals
    start = way * turn * state.get(2, 0.0)
    acceleration = np.full(count + 1, max(hardest[0], start))
    if problem.order == 3 and np.isfinite(hardest[1]):
        acceleration = np.minimum(start + hardest[1] * step * np.arange(count + 1), acceleration)
    speed = way * state[1] + np.concatenate([[0.0], np.cumsum((acceleration[1:] + acceleration[:-1]) * step / 2)])
    return speed, acceleration


def _outwards(problem: Problem, name: str, sign: float) -> float:
    """The largest value of a derivative in a direction."""
    limit = getattr(problem.limits, name)
    return np.inf if limit is None else float(limit.highest if sign > 0 else -limit.lowest)
