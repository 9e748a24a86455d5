"""Minimum time of a chain of integrators, exactly: the arcs of `trajopt.switching` as a trajectory with a certificate.

The mesh takes the switching times among its nodes. That no shorter move exists is proven apart from how it was found.
Up to third order, where the axis can wait at an end: with those nodes the relaxation of `trajopt.outer`, which every
continuous move satisfies, is infeasible at a duration shorter by a billionth. Fourth order: by the costates of the arcs
(`trajopt.switching.certificate`). For ends that both move, by enumeration of all extremals.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import factorial, inf, isfinite
from typing import Any, Final

import numpy as np

from trajopt.attempt import Attempt, Clock
from trajopt.fields import Limit
from trajopt.mesh import Floats, Mesh
from trajopt.model import Claim, Outcome
from trajopt.outer import is_impossible
from trajopt.prices import ranked
from trajopt.problem import DERIVATIVES, Problem, State
from trajopt.switching import Arcs, Chain, Impossible, Unresolved, feasible_durations, shortest
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Setting

_SHORTER: Final = (1e-9, 1e-8, 1e-7, 1e-6)  # relative: the first that is proven impossible bounds the least time
_STEP: Final = 1e-5  # of a limit, for its price
_SAME: Final = 1e-14  # of the duration: times closer than this are one
_BESIDE: Final = 8  # uniform nodes beside the switches, for the proof


def as_chain(problem: Problem) -> Chain | None:
    """The chain of integrators that a problem of minimum time is; None where it is more than that.

    Its duration is free, if only in a range. It takes constant limits on derivatives up to a limited top one, given
    states at both ends, and a force limit where the force is an acceleration in disguise.
    """
    move, limits = problem.move, problem.limits.given
    kinematic = limits.keys() <= {*DERIVATIVES, "force"}
    more = move.via or problem.vibration or problem.transcription.scheme != "exact" or not kinematic
    timed = move.fixed_time is None and [term.minimize for term in problem.objective.terms] == ["time"]
    if more or problem.objective.ceilings or not timed or any(limit.varies for limit in limits.values()):
        return None
    accelerations = _acceleration(problem)
    states = [state.fixed(problem.order) for state in (move.start, move.end)]
    if accelerations is None or any(len(state) < problem.order for state in states):
        return None
    bounds = [_pair(limits.get(name)) for name in DERIVATIVES[: problem.order + 1]]
    bounds[2] = accelerations
    low, high = bounds[-1]
    if not -inf < low < 0 < high < inf:
        return None
    start, end = (tuple(state[i] for i in range(problem.order)) for state in states)
    return Chain(problem.order, tuple(bounds), start, end)


def _pair(limit: Limit | None) -> tuple[float, float]:
    return (-inf, inf) if limit is None else (limit.lowest, limit.highest)


def _acceleration(problem: Problem) -> tuple[float, float] | None:
    """The acceleration limits, with those that a force limit means; None where it depends on the velocity."""
    load, way, force = problem.load, problem.one_way, problem.limits.force
    low, high = _pair(problem.limits.acceleration)
    if force is None:
        return low, high
    if load.viscous or load.curves or not isinstance(load.inertia, float) or (load.coulomb and not way):
        return None
    drag = way * load.coulomb
    low, high = max(low, (force.lowest - drag) / load.inertia), min(high, (force.highest - drag) / load.inertia)
    return (low, high) if low < 0 < high else None


def forwards(problem: Problem) -> Problem:
    """The problem with velocities of one direction only, where that costs no time: friction and a force limit between
    two rests, up to third order.

    A move that turns back within the limits can be replaced by one that does not and is nowhere slower: before each
    turn it brakes to a rest as soft as the jerk limit allows, waits, and later sets off from there to meet it again.
    """
    move, load = problem.move, problem.load
    ends = [state.fixed(problem.order) for state in (move.start, move.end)]
    rests = all(set(range(problem.order)) <= state.keys() and not any(map(state.get, range(1, 4))) for state in ends)
    plain = not load.coulomb or problem.limits.force is None or problem.one_way or problem.order > 3
    if plain or not rests or move.fixed_time is not None or ends[0][0] == ends[1][0]:
        return problem
    low, high = _pair(problem.limits.velocity)
    sides = {"min": 0.0, "max": high} if ends[1][0] > ends[0][0] else {"min": low, "max": 0.0}
    velocity = Limit(**{side: x for side, x in sides.items() if isfinite(x)})
    limits = problem.limits.model_copy(update={"velocity": velocity})
    return problem.model_copy(update={"limits": limits})


def next_possible(chain: Chain, low: float, high: float) -> tuple[float, float] | None:
    """A part of a range of durations in which the least possible one lies, and above it none that is not, for a chain
    up to third order without position limits; None if the range holds none at all."""
    last = 0.0
    for begin, end in feasible_durations(chain):
        if begin > high:
            return None
        if begin <= low <= end:
            return low, min(high, end)
        if begin > low:
            return max(low, (last + begin) / 2), min(high, (begin + min(end, 2 * begin)) / 2)
        last = end
    return None


def floor(problem: Problem) -> float | None:
    """A lower bound on a least time, in continuous time: that of the chain without its snap limit; None where that is
    not known."""
    limits = problem.limits.model_copy(update={"snap": None})
    states = {which: _without_jerk(getattr(problem.move, which)) for which in ("start", "end")}
    easier = problem.model_copy(update={"limits": limits, "move": problem.move.model_copy(update=states)})
    chain = as_chain(easier) if problem.order == 4 else None
    try:
        return None if chain is None else shortest(chain).duration
    except (Impossible, Unresolved):
        return None


def _without_jerk(state: State) -> State:
    return state.model_copy(update={"jerk": None})


def fastest(setting: Setting, chain: Chain, clock: Clock) -> Attempt:
    """The shortest move, with a lower bound on its duration and its structure.

    Raises `trajopt.switching.Impossible` and `Unresolved`.
    """
    wanted = setting.problem.transcription
    arcs = shortest(chain, wanted.min_dwell, wanted.touches)
    _refuse_out_of_range(setting.problem, arcs)
    trajectory = _trajectory(setting, chain, arcs)
    bound, about = _bound(setting, chain, arcs, clock)
    notes = {"structure": _structure(arcs, bound), "bounds": about, "prices": _prices(setting.problem, chain, arcs)}
    return Attempt(Outcome(Claim.OPTIMAL, "switching times"), trajectory, arcs.duration, bound, notes=notes)


def _refuse_out_of_range(problem: Problem, arcs: Arcs) -> None:
    """Raise Impossible or Unresolved for a least time outside the range that is asked for."""
    time = problem.move.time
    if not isinstance(time, tuple) or time[0] <= arcs.duration <= time[1]:
        return
    text = f"the least time is {arcs.duration:.7g} s, outside {time[0]:g} s to {time[1]:g} s"
    raise (Impossible if arcs.lowest > time[1] and not problem.can_wait else Unresolved)(text)


def _trajectory(setting: Setting, chain: Chain, arcs: Arcs) -> Trajectory:
    """The move over a mesh with nodes at the switches, its states taken from the arcs.

    Times of switches are rounded, and over a long cruise even 1e-14 s of snap adds up: the top derivative is what leads
    from node to node, not that of the arcs.
    """
    mesh = _with(setting.mesh.fractions, np.array(arcs.switches) / arcs.duration)
    time = mesh.fractions * arcs.duration
    begins = np.array([0.0, *arcs.switches])
    which = np.clip(np.searchsorted(begins, time * (1 + _SAME) + _SAME * arcs.duration, side="right") - 1, 0, None)
    nodes = [int(np.argmin(np.abs(time - t))) for t in begins]
    found = np.empty((chain.order, len(time)))
    states = [*_states(chain, arcs)]
    for k, state in enumerate(states):
        inside = which == k
        since = time[inside] - time[nodes[k]]
        full = np.append(state, arcs.tops[k])
        for i in range(chain.order):
            found[i, inside] = sum(since**r / factorial(r) * x for r, x in enumerate(full[i:]))
    found[:, -1] = chain.end
    top = np.diff(found[-1]) / np.diff(time)
    found[0] -= chain.start[0]
    kept = (setting.problem, mesh, setting.scheme, setting.sizes, arcs.duration)
    return Trajectory(*kept, chain.start[0], (*found, top))


def _states(chain: Chain, arcs: Arcs) -> Iterator[Floats]:
    """(order,) the state at the beginning of every arc; on a plateau exactly on its limit, and still above it."""
    state = np.array(chain.start)
    for duration, top, active in zip(arcs.durations, arcs.tops, arcs.active, strict=True):
        name, _, side = active.partition(".")
        i = DERIVATIVES.index(name)
        if i < chain.order:
            state[i], state[i + 1 :] = chain.limits[i][side == "max"], 0.0
        yield state.copy()
        full = np.append(state, top)
        terms = [full[i:] * [duration**r / factorial(r) for r in range(len(full) - i)] for i in range(chain.order)]
        state = np.array([float(np.sum(term)) for term in terms])


def _with(uniform: Floats, switches: Floats) -> Mesh:
    """The uniform nodes with those at the switches; a uniform one within a thousandth of a step of a switch goes."""
    if not len(switches):
        return Mesh(uniform)
    far = np.min(np.abs(uniform[:, None] - switches[None, :]), axis=1) > 1e-3 / (len(uniform) - 1)
    far[[0, -1]] = True
    return Mesh(np.unique(np.concatenate([uniform[far], switches])))


def _bound(setting: Setting, chain: Chain, arcs: Arcs, clock: Clock) -> tuple[float, str]:
    """A lower bound on the least duration, and for what moves it holds."""
    if chain.order == 4:  # chattering: too many switches for the relaxation, but its own multipliers prove it
        return max(arcs.lowest, 0.0), "every move in continuous time"
    mesh = _with(np.linspace(0.0, 1.0, _BESIDE + 1), np.array(arcs.switches) / arcs.duration)
    for share in _SHORTER if setting.problem.can_wait else ():
        shorter = arcs.duration * (1 - share)
        move = setting.problem.move.model_copy(update={"time": shorter})
        problem = setting.problem.model_copy(update={"move": move})
        if is_impossible(replace(setting, problem=problem, mesh=mesh), shorter, clock):
            return shorter, "every move in continuous time"
    return max(arcs.lowest, 0.0), "every move in continuous time, by enumeration of the extremals"


def _prices(problem: Problem, chain: Chain, arcs: Arcs) -> list[dict[str, Any]]:
    """What each limit that the arcs run on or touch costs, by two shortest moves beside this one.

    From rest to rest one of them follows from the others. A move that takes λ times as long has limits λ^-i times as
    large, so that Σ i·(limit)·(price) = -duration; not where friction takes its part of a force.
    """
    acting = {}  # name -> (its value, number of the derivative)
    met = {*arcs.active, *(name for _, name in arcs.touches)}
    for quantity, limit in problem.limits.given.items():
        known_as = "acceleration" if quantity == "force" else quantity
        sides = [side for side in ("min", "max") if f"{known_as}.{side}" in met]
        for name in [quantity] if limit.symmetric and sides else [f"{quantity}.{side}" for side in sides]:
            acting[name] = limit.lowest if name.endswith(".min") else limit.highest, DERIVATIVES.index(known_as)
    scales = not any((*chain.start[1:], *chain.end[1:], problem.transcription.min_dwell))
    scales = scales and not (problem.load.coulomb and "force" in problem.limits.given)
    spared = next((name for name, (now, i) in acting.items() if scales and now and i), None)
    found: dict[str, tuple[float, float]] = {}
    for name, (now, _) in sorted(acting.items(), key=lambda item: item[0] == spared):
        limit = problem.limits.given[name.partition(".")[0]]
        step = _STEP * (abs(now) or max(abs(limit.lowest), abs(limit.highest)))
        if name == spared:
            own = -(arcs.duration + sum(acting[other][1] * found[other][1] for other in found)) / acting[name][1]
            found[name] = (own / now, own)
            continue
        times = [_duration(_moved(problem, name, now + way * step), arcs) for way in (1, -1)]
        if arcs.duration in times:  # one that is not found
            spared = None
        per_unit = (times[0] - times[1]) / (2 * step)
        found[name] = (per_unit, per_unit * now)
    return ranked(problem, found, arcs.duration)


def _moved(problem: Problem, name: str, value: float) -> Problem:
    """The problem with a limit a little off; not validated, for a boundary state may lie on it."""
    quantity, _, side = name.partition(".")
    limit = getattr(problem.limits, quantity)
    sides = {"min": -value, "max": value} if not side else {"min": limit.min, "max": limit.max, side: value}
    limits = problem.limits.model_copy(update={quantity: Limit.model_construct(**sides)})
    return problem.model_copy(update={"limits": limits})


def _duration(problem: Problem, arcs: Arcs) -> float:
    """The least duration of a neighbouring problem, s."""
    chain, wanted = as_chain(problem), problem.transcription
    try:
        return arcs.duration if chain is None else shortest(chain, wanted.min_dwell, wanted.touches).duration
    except (Impossible, Unresolved):
        return arcs.duration


def _structure(arcs: Arcs, bound: float) -> dict[str, Any]:
    """The arcs for the result: when, on which limit; touches; the bracket; what an ordinary S-curve would lose."""
    ends = [0.0, *arcs.switches, arcs.duration]
    rows = zip(ends, ends[1:], arcs.active, arcs.tops, strict=False)
    found: dict[str, Any] = {
        "arcs": [{"from": a, "to": b, "limit": limit, "top": top} for a, b, limit, top in rows],
        "touches": [{"time": t, "limit": limit} for t, limit in arcs.touches],
        "bracket": [bound, arcs.duration],
    }
    if arcs.ordinary is not None:
        found["s_curve"] = {"duration": arcs.ordinary, "loss": arcs.ordinary / arcs.duration - 1}
    if arcs.chatters:
        found["chatters"] = True
    return found
