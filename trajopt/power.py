"""Power and energy with a global bound: a cone program that relaxes them, then sequential convex programs.

On the exact scheme with jerk constant on intervals, w_k = v_k + a_k h/2 (the middle Bernstein coefficient of velocity)
gives the power at the nodes exactly as m a_k v_k = m (w_k² - w_(k-1)²)/(2h). The relaxation puts q_k >= w_k²/2 in the
place of the squares, anchored at the prescribed ends, and below the chord of what w_k can reach: q_k <= top_k w_k/2.
Power is then affine, and the optimum a lower bound for every move on the mesh. From its answer, programs with the power
linearised at the last one descend to a local optimum: every point between two feasible moves is feasible.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from trajopt.attempt import Attempt, Clock, convex, to
from trajopt.mesh import Floats
from trajopt.model import Claim, Outcome
from trajopt.problem import Problem
from trajopt.quantities import Quantities
from trajopt.rebuild import rebuild
from trajopt.signals import Signal
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Setting, prescribed

_STEPS: Final = 30
_ENOUGH: Final = 1e-10  # relative: a smaller gain ends the descent


def relax(setting: Setting, clock: Clock) -> Attempt:
    """The relaxation: its ``bound`` holds for every move on the mesh; its trajectory meets all but the power."""
    duration = setting.problem.move.fixed_time
    assert duration is not None
    return convex(replace(setting, quantities=Lifted), duration, to(setting.problem.objective), clock)


def descend(setting: Setting, start: Trajectory, clock: Clock) -> Attempt:
    """From a feasible move to a local optimum by programs with linearised power; the attempt's prices are those of the
    last one. The outcome claims FAILED where the descent does not settle."""
    objective, duration = setting.problem.objective, start.duration
    here, value = start, start.measure(objective)
    attempt = Attempt(Outcome(Claim.FAILED, "no step"))
    for step in range(_STEPS):
        attempt = convex(replace(setting, quantities=_linearised_at(here)), duration, to(objective), clock)
        if attempt.trajectory is None:
            return attempt
        there, best = _search_line(setting, here, attempt.trajectory, value)
        settled = value - best <= _ENOUGH * abs(best)
        if best <= value:
            here, value = there, best
        if settled:
            return replace(attempt, trajectory=here, value=value, bound=-np.inf, notes={"programs": step + 1})
    return Attempt(Outcome(Claim.FAILED, f"the descent did not settle in {_STEPS} programs"))


def linearised(setting: Setting, trajectory: Trajectory) -> Setting:
    """The setting with power linearised at a trajectory, for the prices of an answer."""
    return replace(setting, quantities=_linearised_at(trajectory))


def _search_line(setting: Setting, here: Trajectory, there: Trajectory, value: float) -> tuple[Trajectory, float]:
    """The best of some points on the way from ``here`` to ``there``, by the true objective."""
    objective = setting.problem.objective
    best, found = there, there.measure(objective)
    share = 0.5
    while found > value and share > 1e-4:
        top = here.chain[-1] + share * (there.chain[-1] - here.chain[-1])
        start = np.array([x[0] for x in here.chain[:-1]])
        best = rebuild(setting.problem, setting.mesh, setting.scheme, setting.sizes, here.duration, start, top)
        found, share = best.measure(objective), share / 2
    return best, found


def _linearised_at(reference: Trajectory) -> Any:
    """Quantities whose power is linearised at a trajectory."""
    force, velocity = reference.signal("force").nodes, reference.signal("velocity").nodes

    class Linearised(Quantities):
        def _power(self) -> Signal:
            times = self.model.times
            change = times(force, self.signal("velocity").nodes) + times(velocity, self.signal("force").nodes)
            return Signal(change - force * velocity, ())

    return Linearised


@dataclass(frozen=True)
class Lifted(Quantities):
    """Quantities whose power is relaxed (see the module). Its variables join the model when power is first asked."""

    def _power(self) -> Signal:
        kept = getattr(self.model, "lifted_power", None)
        if kept is None:
            kept = self.model.lifted_power = Signal(self._nodes(), ())
        return kept

    def _nodes(self) -> Any:
        """(N+1,) power at the nodes, affine in the chain and the lifted squares."""
        load, way, model = self.problem.load, self.problem.one_way, self.model
        mass, step, last = load.inertia, float(self.steps[0]), self.mesh.intervals
        velocity = self.signal("velocity")
        ends = {(node, i): x for node, i, x in prescribed(self.problem, self.mesh)}
        assert isinstance(mass, float)
        speeds = (ends[0, 1] + ends[0, 2] * step / 2, ends[last, 1] - ends[last, 2] * step / 2)
        squares = self._squares(way * velocity.pieces[1], _reach(self, step), speeds)
        first, final = (np.array([mass * ends[k, 1] * ends[k, 2]]) for k in (0, last))
        power = model.concatenate([first, model.times(mass / step, squares[1:] - squares[:-1]), final])
        if load.viscous:
            nodes = self._squares(way * velocity.nodes, _node_reach(self, step), (ends[0, 1], ends[last, 1]))
            power = power + model.times(2 * load.viscous, nodes)
        if load.coulomb:
            power = power + model.times(way * load.coulomb, velocity.nodes)
        return power

    def _squares(self, speed: Any, top: Floats, ends: tuple[float, float]) -> Any:
        """What stands for speed²/2: its value at the ends; between them variables from speed²/2 to the chord
        top·speed/2, each scaled by its own top."""
        model, known = self.model, np.flatnonzero(np.isfinite(top[1:-1]))
        top = np.where(np.isfinite(top), top, self.sizes.derivative[1])[1:-1]
        share = model.times(1 / top, speed[1:-1])
        free = np.full(len(top), np.inf)
        q = model.vector(len(top), 1.0, -free, free)
        model.nonpositive(model.squares(share) - q)
        if len(known):
            model.nonpositive(q[known] - share[known])
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
    limit, way = quantities.problem.limits.velocity, quantities.problem.one_way
    assert limit is not None
    return limit.highest if way > 0 else -limit.lowest


def _greedy(quantities: Quantities, step: float, backwards: bool) -> tuple[Floats, Floats]:
    """(N+1,) speed and acceleration of the move that speeds up as hard as it can from one end, time running away from
    it: no other is faster anywhere, since each derivative grows with the one above it."""
    problem, way = quantities.problem, quantities.problem.one_way
    state = (problem.move.end if backwards else problem.move.start).fixed(3)
    turn = -1.0 if backwards else 1.0
    hardest = [_outwards(problem, name, way * sign) for name, sign in (("acceleration", turn), ("jerk", 1.0))]
    start, count = way * turn * state[2], quantities.mesh.intervals
    acceleration = np.full(count + 1, max(hardest[0], start))
    if np.isfinite(hardest[1]):
        acceleration = np.minimum(start + hardest[1] * step * np.arange(count + 1), acceleration)
    speed = way * state[1] + np.concatenate([[0.0], np.cumsum((acceleration[1:] + acceleration[:-1]) * step / 2)])
    return speed, acceleration


def _outwards(problem: Problem, name: str, sign: float) -> float:
    """The largest value of a derivative in a direction."""
    limit = getattr(problem.limits, name)
    return np.inf if limit is None else float(limit.highest if sign > 0 else -limit.lowest)
