"""Power relaxed: squares of velocity become variables, between the squares or tangents to them and a chord.

On the exact scheme with jerk constant on intervals, w_k = v_k + a_k h/2 (the middle Bernstein coefficient of velocity)
gives the power at the nodes exactly as m a_k v_k = m (w_k² - w_(k-1)²)/(2h). The relaxation puts q_k >= w_k²/2 in the
place of the squares, anchored at the prescribed ends, and below the chord of what w_k can reach: q_k <= top_k w_k/2.
Power is then affine, and the optimum a lower bound for every move on the mesh. Where acceleration is constant on
intervals, squares of the velocity at the nodes do the same for the mean of the power at both ends of an interval,
m (v_(k+1)² - v_k²)/(2h), from which the ends themselves lie m h a_k²/2 off to either side: b_k >= m h a_k²/2 stands for
that. Losses of a motor that are convex in force add to it; those that are not are left out. Tangents may stand in for
the squares, q_k >= u_k w_k - u_k²/2 at the speeds u of known moves: then nothing of this needs a cone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from trajopt import motor, signals
from trajopt.mesh import Floats
from trajopt.motor import implied
from trajopt.problem import Problem
from trajopt.quantities import Quantities
from trajopt.signals import Signal
from trajopt.trajectory import Trajectory
from trajopt.transcribe import prescribed


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


@dataclass(frozen=True)
class Lifted(Quantities):
    """Quantities whose power is relaxed (see the module). Its variables join the model when power is first asked.

    ``reach``: (lower, upper) bounds on the speeds that are squared, where better ones than those of the limits are
    known: the chord then runs between the squares of both. ``touch``: moves whose tangents stand in for the squares.
    """

    reach: tuple[Floats, Floats] | None = None
    touch: tuple[Touch, ...] = ()

    def _power(self) -> Signal:
        return self._nodes() if self.problem.order == 3 else self._ends()

    def _electrical_power(self) -> Signal:
        model, load = self.model, self.problem.load
        heats = [motor.heat(model, load, u, self.sizes.current) for (u,) in self.ends("current")]
        mechanical = self.signal("power")
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
