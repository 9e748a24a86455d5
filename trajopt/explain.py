"""Why a move is impossible, in an engineer's words, with cures that work.

Each number comes from the optimum of a convex program on the asked mesh: the least time, the farthest distance, for
every limit the value that would do alone, the common factor on all. Cures are rounded to the feasible side by a
millionth.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from trajopt import units
from trajopt.attempt import Attempt, Clock, convex
from trajopt.envelope import Envelope
from trajopt.fields import Limit, Table
from trajopt.model import Claim
from trajopt.objective import Lowered
from trajopt.outer import is_impossible
from trajopt.problem import FREE, TOTALS, Problem
from trajopt.routing import waits_at_an_end
from trajopt.scaling import sizes_of
from trajopt.time_search import farthest, feasible_times, minimum_time
from trajopt.transcribe import Setting, Transcript

ROUND: Final = 1e-6  # relative: how far a cure is moved to the feasible side
_ENOUGH: Final = 1e6  # no limit is widened by more than this many times its own value


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
    together = _widening(setting, duration, _nonzero(setting.problem), clock)
    found["all_limits_factor"] = (1 + together.value) * (1 + ROUND) if np.isfinite(together.value) else None
    found["conflict"] = _conflict(together, duration)
    found["text"] = _sentences(setting.problem, found)
    return found


def _kinematic(problem: Problem) -> dict[str, Limit]:
    return {name: limit for name, limit in problem.limits.given().items() if name not in ("power", "brake_energy")}


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
    """The least time, and where the axis cannot wait at an end, every interval of possible times."""
    problem = setting.problem
    if problem.move.via or any(limit.varies for limit in problem.limits.given().values()) or _free_ends(problem):
        return {"least_time": None}
    freed = problem.move.model_copy(update={"time": FREE})
    free = replace(setting, problem=problem.model_copy(update={"move": freed}))
    free = replace(free, sizes=sizes_of(free.problem))
    if waits_at_an_end(problem):
        attempt = minimum_time(free, clock)
        return {"least_time": attempt.trajectory.duration * (1 + ROUND) if attempt.trajectory else None}
    possible = feasible_times(free, clock)
    return {"least_time": possible[0][0] if possible else None, "possible_times": possible}


def _free_ends(problem: Problem) -> bool:
    return FREE in (problem.move.start.position, problem.move.end.position)


def _reachable(setting: Setting, clock: Clock) -> list[float] | None:
    """[nearest, farthest] displacement of the end in the asked time, m or rad, each moved inwards by a millionth; None
    where no end can be reached, or where the start or the end is free."""
    move = setting.problem.move
    if _free_ends(setting.problem) or move.fixed_time is None:
        return None
    ends = [farthest(setting, move.fixed_time, sign, clock) for sign in (-1.0, 1.0)]
    if any(attempt.trajectory is None for attempt in ends):
        return None
    low, high = ends[0].value, -ends[1].value
    inwards = ROUND * max(abs(low), abs(high))
    return [low + inwards, high - inwards] if low + inwards < high - inwards else None


def _widening(setting: Setting, duration: float, sides: list[str], clock: Clock) -> Attempt:
    """The least widening of some sides, together, that makes the move possible."""

    def goal(transcript: Transcript) -> Lowered:
        return Lowered(next(iter(transcript.widen.values())), 1.0, None)

    return convex(setting, duration, goal, clock, widen=sides)


def _alone(setting: Setting, duration: float, name: str, widen: list[str], clock: Clock) -> dict[str, Any]:
    """What one limit would have to be, all others as they are; ``value`` None where no value is enough (``never``, by a
    certificate) or none was found in the time."""
    attempt = _widening(setting, duration, widen, clock)
    quantity, _, side = name.partition(".")
    limit = setting.problem.limits.given()[quantity]
    now = limit.lowest if side == "min" else limit.highest
    unit = units.kinds(setting.problem.rotary)[quantity].unit
    known: dict[str, Any] = {"now": now, "unit": unit, "varies": limit.varies, "value": None, "factor": None}
    never = attempt.outcome.claim is Claim.INFEASIBLE or attempt.bound > _ENOUGH
    if never or attempt.trajectory is None:
        return known | {"never": never}
    known["never"] = False
    by = attempt.value * (1 + ROUND) + ROUND * 1e-3
    own = abs(now) if now else setting.sizes.of(quantity)
    return known | {"value": now + by * own * (-1 if side == "min" else 1), "factor": 1 + by if now else None}


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
    move = problem.move
    text = [
        f"in {move.fixed_time:.6g} s this move is impossible within the limits"
        + (" (in continuous time: no mesh helps)" if found["continuous"] else " on this mesh")
    ]
    if found["least_time"] is not None:
        text.append(f"the least time is {found['least_time']:.7g} s")
    for (_, above), (below, _) in zip(
        found.get("possible_times", []), found.get("possible_times", [])[1:], strict=False
    ):
        text.append(f"times from {above:.6g} s to {below:.6g} s are blocked")
    if found["reachable"] is not None:
        text.append(_reach_text(problem, *found["reachable"]))
    enough = [(n, c) for n, c in found["limits"].items() if c["value"] is not None and not c["varies"]]
    text += [f"{n} {c['now']:g} -> {c['value']:.7g} {c['unit']} alone is enough" for n, c in enough]
    never = [name for name, cure in found["limits"].items() if cure["never"]]
    if never:
        text.append(f"no value of {' or '.join(never)} alone is enough")
    if found["all_limits_factor"]:
        text.append(f"or all limits together by {100 * (found['all_limits_factor'] - 1):.4g} %")
    text += [f"{c['limit']} stands in the way from {c['from']:.4g} s to {c['to']:.4g} s" for c in found["conflict"]]
    return text


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


def widened(problem: Problem, name: str, value: float) -> Problem:
    """The problem with one limit (or one side of it, ``velocity.max``) set to a cure's value."""
    quantity, _, side = name.partition(".")
    limit = getattr(problem.limits, quantity)
    changed: Limit | Envelope
    if isinstance(limit, Envelope):
        changed = limit.scaled(value / limit.force[0])
    else:
        assert not isinstance(limit.max, Table)
        sides = {"min": -value, "max": value} if not side else {"min": limit.min, "max": limit.max, side: value}
        changed = Limit(**sides)
    limits = problem.limits.model_copy(update={quantity: changed})
    return problem.replace(limits=limits)
