"""Why a move is impossible, in an engineer's words, with cures that work.

Each number comes from the optimum of a convex program on the asked mesh: the least time, the farthest distance, for
every limit the value that would do alone, the common factor on all. Cures are rounded to the feasible side by a
millionth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any, Final

import numpy as np

import norms
from trajopt import units
from trajopt.attempt import Attempt, Clock, convex, nonconvex
from trajopt.fields import Limit, Table
from trajopt.model import Claim
from trajopt.objective import Lowered
from trajopt.outer import is_impossible
from trajopt.power import descend, relax
from trajopt.problem import FREE, TOTALS, Objective, Problem, Term
from trajopt.scaling import sizes_of
from trajopt.switching import Chain, Impossible, Unresolved, feasible_durations, shortest
from trajopt.switching_times import as_chain
from trajopt.time_search import farthest, feasible_times, minimum_time
from trajopt.transcribe import Setting, Transcript, without

ROUND: Final = 1e-6  # relative: how far a cure is moved to the feasible side


def explain(setting: Setting, clock: Clock) -> dict[str, Any]:
    """Plain data for JSON, with ``text``: the same in sentences. Expects a problem of fixed time, infeasible on its
    mesh; ``continuous`` says whether it is so on any mesh."""
    duration = setting.problem.move.fixed_time
    assert duration is not None
    found: dict[str, Any] = {"continuous": is_impossible(setting, duration, clock)}
    found |= _times(setting, clock)
    found["reachable"] = _reachable(setting, clock)
    sides = _sides(setting.problem)
    found["limits"] = {name: _alone(setting, duration, name, widen, clock) for name, widen in sides.items()}
    found |= _together(setting, duration, clock)
    found["text"] = _sentences(setting.problem, found)
    return found


def tested(problem: Problem, found: dict[str, Any], works: Callable[[Problem], bool]) -> dict[str, Any]:
    """An explanation without the cures after which no move was found: convex programs promise them, and do not know
    the limits that make the problem, as it is or as it would be, nonconvex."""
    limits = dict(found.get("limits", {}))
    for name, cure in limits.items():
        if cure["value"] is not None and not cure["varies"] and not works(problem.with_limit(name, cure["value"])):
            limits[name] = cure | {"value": None, "factor": None}
    found = found | {"limits": limits}
    if (least := found.get("least_time")) is not None:
        move = problem.move.model_copy(update={"time": least})
        if not works(problem.model_copy(update={"move": move})):
            found |= {"least_time": None}
    return found | {"text": _sentences(at_longest(problem), found)}


def at_longest(problem: Problem) -> Problem:
    """The problem in the longest time of its range, which is what is explained."""
    time = problem.move.time
    move = problem.move.model_copy(update={"time": time[1] if isinstance(time, tuple) else time})
    return problem.model_copy(update={"move": move})


def _kinematic(problem: Problem) -> dict[str, Limit]:
    return {name: limit for name, limit in problem.limits.given.items() if name not in ("power", "brake_energy")}


def _sides(problem: Problem) -> dict[str, list[str]]:
    """What can be widened: a symmetric limit as a whole, else each side by itself."""
    sides: dict[str, list[str]] = {}
    for name, limit in _kinematic(problem).items():
        both = [f"{name}.{side}" for side in ("min", "max") if getattr(limit, side) is not None]
        if limit.symmetric:
            sides[name] = both
        else:
            sides |= {side: [side] for side in both}
    return sides


def _nonzero(problem: Problem) -> list[str]:
    """The sides of limits that a factor moves: those that are nowhere zero."""
    return [
        f"{name}.{side}"
        for name, limit in _kinematic(problem).items()
        for side in ("min", "max")
        if (bound := getattr(limit, side)) is not None and all(bound.value if isinstance(bound, Table) else [bound])
    ]


def _times(setting: Setting, clock: Clock) -> dict[str, Any]:
    """The least time on this mesh and, where its switching times are found, in continuous time; where the axis cannot
    wait at an end, every interval of possible times."""
    problem = setting.problem
    if problem.move.via or any(limit.varies for limit in problem.limits.given.values()) or has_free_ends(problem):
        return {"least_time": None}
    move = problem.move.model_copy(update={"time": FREE})
    free = replace(setting, problem=problem.model_copy(update={"move": move}))  # the objective decides the order
    free = replace(free, sizes=sizes_of(free.problem))
    timed = Objective(terms=(Term(minimize="time"),))
    chain = as_chain(free.problem.model_copy(update={"objective": timed}))
    found: dict[str, Any] = {"least_time_continuous": None if chain is None else _shortest(chain)}
    if problem.can_wait:
        attempt = minimum_time(free, clock)
        return found | {"least_time": attempt.trajectory.duration * (1 + ROUND) if attempt.trajectory else None}
    possible = possible_times(free, clock)
    return found | {"least_time": possible[0][0] if possible else None, "possible_times": possible}


def possible_times(setting: Setting, clock: Clock) -> list[tuple[float, float | None]]:
    """The intervals of durations in which a move with moving ends is possible on its mesh, s."""
    timed = Objective(terms=(Term(minimize="time"),))
    chain = as_chain(setting.problem.model_copy(update={"objective": timed}))
    return feasible_times(setting, clock, [] if chain is None or chain.order > 3 else _borders(chain))


def _shortest(chain: Chain) -> float | None:
    try:
        return shortest(chain).duration
    except (Impossible, Unresolved):
        return None


def _borders(chain: Chain) -> list[float]:
    """The finite borders of the durations that are possible in continuous time, s."""
    try:
        return [t for interval in feasible_durations(chain) for t in interval if np.isfinite(t)]
    except (Impossible, Unresolved):
        return []


def explain_power(setting: Setting, clock: Clock) -> dict[str, Any] | None:
    """Why a power limit cannot be kept, where the cone bound of the least peak power lies above it; None elsewhere."""
    problem = setting.problem
    limit = problem.limits.power
    if limit is None or problem.move.fixed_time is None:
        return None
    peak = Objective(terms=(Term(minimize="power", norm=norms.Linf()),))
    free = without(setting, ["power"])
    free = replace(free, problem=free.problem.model_copy(update={"objective": peak}))
    relaxed, most = relax(free, clock), max(abs(limit.lowest), abs(limit.highest))
    if relaxed.trajectory is None or relaxed.bound <= most * (1 + ROUND):
        return None
    start = descend(free, relaxed.trajectory, clock).trajectory
    found: dict[str, Any] = {"continuous": False, "least_peak_power": {"bound": relaxed.bound}}
    text = [
        f"limits.power allows {most:g} W: within the other limits every move on this mesh of"
        f" {problem.transcription.intervals} intervals needs {relaxed.bound:.6g} W at its peak"
    ]
    sides = [side for side in ("power.min", "power.max") if getattr(limit, side.partition(".")[2]) is not None]
    best = None if start is None else nonconvex(setting, _least_widening, clock, start, widen=sides)
    if best is not None and best.trajectory is not None and limit.symmetric:
        enough = most * (1 + best.value) * (1 + ROUND)
        found["limits"] = {"power": {"now": most, "unit": "W", "value": enough, "never": False}}
        text.append(f"power {most:g} -> {enough:.7g} W alone is enough")
    return found | {"text": text}


def has_free_ends(problem: Problem) -> bool:
    return FREE in (problem.move.start.position, problem.move.end.position)


def _reachable(setting: Setting, clock: Clock) -> list[float] | None:
    """[nearest, farthest] displacement of the end in the asked time, m or rad, each moved inwards by a millionth; None
    where no end can be reached, or where the start or the end is free."""
    move = setting.problem.move
    if has_free_ends(setting.problem) or move.fixed_time is None:
        return None
    ends = [farthest(setting, move.fixed_time, sign, clock) for sign in (-1.0, 1.0)]
    if any(attempt.trajectory is None for attempt in ends):
        return None
    low, high = ends[0].value, -ends[1].value
    inwards = ROUND * max(abs(low), abs(high))
    return [low + inwards, high - inwards] if low + inwards < high - inwards else None


def _widening(setting: Setting, duration: float, sides: list[str], clock: Clock, size: float = 1.0) -> Attempt:
    """The least widening of some sides, together, that makes the move possible; ``size``: how much it may be."""
    return convex(setting, duration, partial(_least_widening, size=size), clock, widen=sides, widen_size=size)


def _least_widening(transcript: Transcript, size: float = 1.0) -> Lowered:
    return Lowered(next(iter(transcript.widen.values())) * (1 / size), size, None)


def _alone(setting: Setting, duration: float, name: str, widen: list[str], clock: Clock) -> dict[str, Any]:
    """What one limit would have to be, all others as they are; ``value`` None where no value is enough (``never``, by a
    certificate) or none was found in the time."""
    quantity, _, side = name.partition(".")
    limit = setting.problem.limits.given[quantity]
    now = limit.lowest if side == "min" else limit.highest
    without_it = without(setting, [quantity]).problem
    roomy = replace(setting, sizes=sizes_of(without_it, setting.problem.order))
    size = roomy.sizes.of(quantity)
    attempt = _widening(roomy, duration, widen, clock, max(size / abs(now), 1.0) if now else 1.0)
    unit = units.kinds(setting.problem.rotary)[quantity].unit
    known: dict[str, Any] = {"now": now, "unit": unit, "varies": limit.varies, "value": None, "factor": None}
    known["never"] = attempt.outcome.claim is Claim.INFEASIBLE
    if attempt.trajectory is None:
        return known
    by = attempt.value * (1 + ROUND) + ROUND * 1e-3
    own = abs(now) if now else size
    return known | {"value": now + by * own * (-1 if side == "min" else 1), "factor": 1 + by if now else None}


def _together(setting: Setting, duration: float, clock: Clock) -> dict[str, Any]:
    """By how much all limits would have to give way together, and which of them stand in the way when."""
    sides = _nonzero(setting.problem)
    if not sides:
        return {"all_limits_factor": None, "conflict": []}
    together = _widening(setting, duration, sides, clock)
    factor = (1 + together.value) * (1 + ROUND) if np.isfinite(together.value) else None
    return {"all_limits_factor": factor, "conflict": _conflict(together, duration)}


def _conflict(together: Attempt, duration: float) -> list[dict[str, Any]]:
    """When which limit stands in the way: where the certificate of the widening puts its weight."""
    conflict = []
    weights = {name: np.abs(p.per_unit * p.own) for name, p in together.outcome.prices.items() if "." in name}
    largest = max((float(np.max(w)) for w in weights.values() if len(w)), default=0.0)
    for name, weight in weights.items():
        at = together.outcome.prices[name].at[weight > 1e-3 * largest] if largest else np.empty(0)
        if len(at):
            at = np.array([0.0, 1.0]) if name.partition(".")[0] in TOTALS else at
            conflict.append({"limit": name, "from": float(at.min() * duration), "to": float(at.max() * duration)})
    return conflict


def _sentences(problem: Problem, found: dict[str, Any]) -> list[str]:
    move, intervals = problem.move, problem.transcription.intervals
    text = [
        f"in {move.fixed_time:.6g} s this move is impossible within the limits"
        + (" (in continuous time: no mesh helps)" if found["continuous"] else f" on this mesh of {intervals} intervals")
    ]
    text += [*_time_text(found, intervals), *_blocked_text(found.get("possible_times", []))]
    if found["reachable"] is not None:
        text.append(_reach_text(problem, *found["reachable"]))
    for name, cure in found["limits"].items():
        shown = problem.shown(name)
        if cure["value"] is not None and cure["varies"]:
            text.append(f"{shown} at all times {cure['factor']:.7g} times as wide alone is enough")
        elif cure["value"] is not None:
            text.append(f"{shown} {cure['now']:g} -> {cure['value']:.7g} {cure['unit']} alone is enough")
    never = [problem.shown(name) for name, cure in found["limits"].items() if cure["never"]]
    if never:
        text.append(f"no value of {' or '.join(never)} alone is enough")
    if not problem.limits.given:
        text.append("there is no limit: these intervals are too few for the states; raise transcription.intervals")
    if found["all_limits_factor"]:
        text.append(f"or all limits together by {100 * (found['all_limits_factor'] - 1):.4g} %")
    for c in found["conflict"]:
        text.append(f"{problem.shown(c['limit'])} stands in the way from {c['from']:.4g} s to {c['to']:.4g} s")
    return text


def _time_text(found: dict[str, Any], intervals: int) -> list[str]:
    """The least time on the mesh, and how far it could fall on finer ones."""
    least, ideal = found["least_time"], found.get("least_time_continuous")
    if least is None:
        return []
    finer = f" on this mesh of {intervals} intervals, {ideal:.7g} s in continuous time" if ideal is not None else ""
    return [f"the least time is {least:.7g} s{finer}"]


def _blocked_text(possible: list[tuple[float, float | None]]) -> list[str]:
    """The times in which a move with moving ends is impossible, above the least one."""
    text = [f"times from {a:.6g} s to {b:.6g} s are blocked" for (_, a), (b, _) in pairwise(possible)]
    last = possible[-1][1] if possible else None
    return text if last is None else [*text, f"times above {last:.6g} s are blocked"]


def _reach_text(problem: Problem, low: float, high: float) -> str:
    """What distances the asked time allows, for a target outside them."""
    move, unit = problem.move, units.kinds(problem.rotary)["position"].unit
    target = float(move.end.position) - (move.start_position or 0.0)  # type: ignore[arg-type]
    outermost, innermost = (high, low) if target >= 0 else (low, high)
    if abs(target) > abs(outermost) and outermost * target > 0:
        return f"in the asked time the axis can go at most {outermost:.6g} {unit}"
    if (target < low or target > high) and innermost * target > 0:
        return f"in the asked time the axis must go at least {innermost:.6g} {unit}"
    return f"in the asked time the axis can go {low:.6g} to {high:.6g} {unit}"
