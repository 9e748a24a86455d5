"""Contradictions that can be seen without solving: quantity, value, relation, unit and remedy, in one line each."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from trajopt import units
from trajopt.fields import Limit, Table
from trajopt.problem import DERIVATIVES, ELECTRICAL, LOADED, MOST_INTERVALS, MOTOR, Problem, State
from trajopt.rating import refuse_weak_motor

if TYPE_CHECKING:
    from trajopt.axes.problem import AxesProblem
    from trajopt.plant.problem import PlantProblem

SYMBOLS: Final = ("q", "v", "a", "j", "s")
CLAMPED = 1e-9  # a boundary state outside its limit by this fraction of the limit is a rounding, not a contradiction


def refuse_contradictions(problem: Problem) -> None:
    """Raise ValueError for a problem that cannot be meant as it stands."""
    _time(problem)
    _load(problem)
    _curves(problem)
    _via(problem)
    _vibration(problem)
    for where, state in _states(problem):
        _within_limits(problem, where, state)
    _doomed(problem)
    _one_sided_snap(problem)
    refuse_weak_motor(problem)


def warnings(problem: Problem | PlantProblem | AxesProblem) -> list[str]:
    """What looks like a slip but may be meant, one line each: a unit off by 1000, a step too coarse for the jerk. The
    plain numbers of a plant give none away."""
    if not isinstance(problem, Problem):
        moves = getattr(problem, "moves", ())
        return [f"{move.title}: {warning}" for move in moves for warning in warnings(move)]
    return [*_clamped(problem), *_wrong_units(problem), *_degrees(problem), *_coarse(problem), *_heavy(problem)]


def _clamped(problem: Problem) -> list[str]:
    """Boundary states that lie outside a limit by a rounding, and are taken as on it."""
    found = []
    for where, state in _states(problem):
        for i, value in state.fixed(problem.order, None).items():
            limit = getattr(problem.limits, DERIVATIVES[i])
            if limit is None:
                continue
            low, high = at_time(limit, _when(problem, where, state))
            if not low <= value <= high:
                side = "min" if value < low else "max"
                name = f"{where}.{DERIVATIVES[i]}"
                found.append(f"{name}: {value!r} is outside its limit by a rounding; taken as its {side}")
    return found


def _heavy(problem: Problem) -> list[str]:
    count = problem.transcription.intervals
    if count <= 20_000:
        return []
    return [f"transcription.intervals: {count} take about {15e-6 * count:.2g} GB of memory; 200 are usual"]


def _states(problem: Problem) -> list[tuple[str, State]]:
    via = [(f"move.via[{i}]", state) for i, state in enumerate(problem.move.via)]
    return [("move.start", problem.move.start), ("move.end", problem.move.end), *via]


def _when(problem: Problem, where: str, state: State) -> float:
    """The time of a boundary or via state, s; of a free end zero."""
    times = {"move.start": 0.0, "move.end": problem.move.fixed_time or 0.0}
    return times.get(where, float(getattr(state, "time", 0.0)))


def _time(problem: Problem) -> None:
    timed = any(term.minimize == "time" for term in problem.objective.terms)
    fixed = problem.move.fixed_time is not None
    if timed and fixed:
        raise ValueError(
            f"objective.minimize: time is fixed by move.time = {problem.move.fixed_time:g} s;"
            ' minimizing it needs move.time = "free"'
        )
    if problem.move.time == "free" and not timed:
        raise ValueError('move.time: "free" needs a time term in the objective, or a range such as ["0.5 s", "2 s"]')
    if fixed:
        return
    if problem.move.time == "free" and len(problem.objective.terms) == 1:
        if not (limited := set(problem.limits.given) - {"position"}):
            raise ValueError('limits: nothing bounds the move: least time needs one such as acceleration = "5 m/s^2"')
        if limited == {"velocity"} and (side := _unbounded_side(problem)):
            remedy = 'give it, or a limit such as acceleration = "5 m/s^2"'
            raise ValueError(f"limits.velocity.{side}: is missing, and the least time is 0 s without it; {remedy}")
    if problem.move.time == "free" and _stays(problem):
        raise ValueError("move.end: the move ends in the state in which it starts: it takes no time; give move.time")
    if any(limit.varies for limit in problem.limits.given.values()) or problem.move.via:
        raise ValueError('move.time: limits by time and via states need a fixed move.time such as "1 s"')
    if isinstance(problem.load.inertia, Table):
        raise ValueError('move.time: an inertia that varies in time needs a fixed move.time such as "1 s"')


def _unbounded_side(problem: Problem) -> str:
    """The side of the velocity limit, missing, towards which the end lies; none of free ends."""
    velocity, start, end = problem.limits.velocity, problem.move.start_position, problem.move.end.position
    if velocity is None or start is None or not isinstance(end, float):
        return ""
    return "max" if end > start and velocity.max is None else "min" if end < start and velocity.min is None else ""


def _stays(problem: Problem) -> bool:
    """Whether the move ends in the very state in which it starts."""
    start, end = (state.fixed(problem.order) for state in (problem.move.start, problem.move.end))
    return start == end and start.keys() == set(range(problem.order))


def _load(problem: Problem) -> None:
    load = problem.load
    named = {f"objective {term.minimize}": term.minimize for term in problem.objective.all_terms}
    named |= {f"limits.{name}": name for name in problem.limits.given}
    needs = [where for where, name in named.items() if name in (*LOADED, *ELECTRICAL)]
    if needs and load.inertia is None:
        remedy = 'write inertia = "4e-4 kg m^2"' if problem.rotary else 'write mass = "10 kg"'
        raise ValueError(f"load.{'inertia' if problem.rotary else 'mass'}: is missing; {needs[0]} needs it; {remedy}")
    needs = [where for where, name in named.items() if name in ELECTRICAL]
    given = load.model_dump(exclude_defaults=True)
    needs += [f"load.{key}" for key in MOTOR if key in given]
    for key in MOTOR[:2]:
        if needs and getattr(load, key) is None:
            example = units.kinds(problem.rotary)[key].example
            raise ValueError(f'load.{key}: is missing; {needs[0]} needs it; write {key} = "{example}"')


def _curves(problem: Problem) -> None:
    """A load over position must be known wherever the move is asked to be."""
    kinds = units.kinds(problem.rotary)
    if problem.load.curves and problem.transcription.scheme == "euler":
        raise ValueError('transcription.scheme: a load over position needs "exact"')
    for name, curve in problem.load.curves.items():
        low, high = curve.span
        origin = {} if problem.move.start_position is None else {"move.start.position": problem.move.start_position}
        given = {f"{where}.position": state.position for where, state in _states(problem)} | origin
        for where, place in given.items():
            if isinstance(place, float) and not low - curve.room <= place <= high + curve.room:
                unit = kinds["position"].unit
                raise ValueError(
                    f"load.{problem.shown(name)}: its table runs from {low:.6g} to {high:.6g} {unit}, too short for"
                    f" {where} = {place:.6g} {unit}; extend it, and see that its positions are in {unit}"
                )


def _via(problem: Problem) -> None:
    times = [state.time for state in problem.move.via]
    duration = problem.move.fixed_time
    if duration is None or not times:
        return
    for i, (earlier, later) in enumerate(zip(times, times[1:], strict=False), 1):
        if later <= earlier:
            raise ValueError(f"move.via[{i}].time: times must increase, got {earlier:g} s and then {later:g} s")
    late = next((i for i, time in enumerate(times) if time >= duration), None)
    if late is not None:
        raise ValueError(f"move.via[{late}].time: {times[late]:g} s must be before move.time = {duration:g} s")
    if problem.transcription.scheme == "euler":
        steps = [t / duration * problem.transcription.intervals for t in times]
        off = next((i for i, step in enumerate(steps) if abs(step - round(step)) > 1e-9), None)
        if off is not None:
            raise ValueError(
                f"move.via[{off}].time: {times[off]:g} s must be a multiple of the euler step"
                f" {duration / problem.transcription.intervals:g} s; change it or transcription.intervals"
            )


def _vibration(problem: Problem) -> None:
    if not problem.vibration:
        return
    if problem.transcription.scheme == "euler":
        raise ValueError('vibration: needs transcription.scheme = "exact"')
    only_time = [term.minimize for term in problem.objective.terms] == ["time"]
    if problem.move.fixed_time is None and not only_time:
        raise ValueError('vibration: needs a fixed move.time such as "1 s", or time as the only objective')


def _within_limits(problem: Problem, where: str, state: State) -> None:
    time = _when(problem, where, state)
    default = None if where.startswith("move.via") else 0.0
    for i, value in state.fixed(problem.order, default).items():
        name = DERIVATIVES[i]
        limit = getattr(problem.limits, name)
        if limit is None:
            continue
        lower, upper = at_time(limit, time)
        if not _reach(lower, upper, -CLAMPED) <= value <= _reach(upper, lower, CLAMPED):
            unit = units.kinds(problem.rotary)[name].unit
            origin = "" if getattr(state, name) is not None else " (the default)"
            raise ValueError(
                f"{where}.{name}: {value:.9g} {unit}{origin} is outside limits.{name} {_interval(lower, upper)} {unit};"
                " widen the limit or move the state inside"
            )


def _reach(side: float, other: float, by: float) -> float:
    """A side of a limit moved by a fraction of its size (of the other side's, where it is zero)."""
    size = abs(side) or (abs(other) if math.isfinite(other) else 0.0)
    return side + by * size if math.isfinite(side) else side


def _interval(lower: float, upper: float) -> str:
    if math.isinf(lower):
        return f"(at most {upper:.9g})"
    return f"(at least {lower:.9g})" if math.isinf(upper) else f"[{lower:.9g}, {upper:.9g}]"


def at_time(limit: Limit, time: float) -> tuple[float, float]:
    """The lower and upper limit at ``time`` in s, infinite where there is none."""
    if not limit.varies:
        return limit.lowest, limit.highest
    lower, upper = limit.at(np.array([time]))
    return (-math.inf if lower is None else float(lower[0])), (math.inf if upper is None else float(upper[0]))


def _doomed(problem: Problem) -> None:
    """Refuse a boundary state that must leave a limit, however hard the axis brakes: v0 + a0|a0|/(2 jmax) > vmax.

    The same for a position with its velocity and for an acceleration with its jerk. The end is the start of the move
    run backwards, where the odd derivatives change sign.
    """
    start, end = (state.fixed(problem.order) for _, state in _states(problem)[:2])
    ends = [("move.start", start, end, 1.0)]
    if problem.transcription.scheme == "exact":  # the Euler sums of the last steps lag behind the integral
        ends.append(("move.end", end, start, -1.0))
    for where, here, there, direction in ends:
        for i in range(problem.order - 1):
            limits = [getattr(problem.limits, DERIVATIVES[k]) for k in (i, i + 2)]
            if i not in here or i + 1 not in here or any(limit is None or limit.varies for limit in limits):
                continue
            for sign in (1.0, -1.0):  # against the upper limit, then mirrored against the lower
                _brake(problem, where, i, here, there.get(i + 1), direction, sign)


def _one_sided_snap(problem: Problem) -> None:
    """Refuse a snap limit of one sign that the jerks at both ends contradict."""
    snap, (start, end) = problem.limits.snap, (state.fixed(4) for _, state in _states(problem)[:2])
    if snap is None or 3 not in start or 3 not in end or snap.lowest < 0 < snap.highest:
        return
    change = end[3] - start[3]
    stays = not change and not any(state.get(i, 1.0) for state in (start, end) for i in (1, 2, 3))
    moves = 0 in start and 0 in end and start[0] != end[0]
    if (stays and moves) or (change < 0 <= snap.lowest) or (change > 0 >= snap.highest):
        only = "grow" if snap.lowest >= 0 else "fall"
        raise ValueError(
            f"limits.snap: {_interval(snap.lowest, snap.highest)} lets the jerk only {only}, and it must go from"
            f" {start[3]:.6g} to {end[3]:.6g}{' by way of others' if stays else ''}; give it a limit of either sign"
        )


def _brake(
    problem: Problem, where: str, i: int, here: dict[int, float], there: float | None, direction: float, sign: float
) -> None:
    """Raise ValueError when derivative ``i`` must pass its limit on the side ``sign`` although ``i + 2`` brakes."""
    limit, brakes = (at_time(getattr(problem.limits, DERIVATIVES[k]), 0.0) for k in (i, i + 2))
    other, upper = limit if sign > 0 else (-limit[1], -limit[0])
    brake = -brakes[0] if sign > 0 else brakes[1]
    value, rate = sign * here[i], direction * sign * here[i + 1]
    if rate <= 0 or math.isinf(brake) or math.isinf(upper):
        return
    shortest = problem.move.fixed_time or (problem.move.time[0] if isinstance(problem.move.time, tuple) else 0.0)
    to_stop = rate / brake if brake > 0 else math.inf
    if there is not None:  # a prescribed rate at the other end takes a while to reach, too
        fall = rate - direction * sign * there
        shortest = max(shortest, 0.0 if fall <= 0 else fall / brake if brake > 0 else math.inf)
    time = min(to_stop, shortest)
    peak = value + rate * time - brake * time**2 / 2 if math.isfinite(time) else math.inf
    if peak <= _reach(upper, other, CLAMPED):
        return
    names, symbol = DERIVATIVES[i : i + 3], SYMBOLS[i : i + 3]
    unit = [units.kinds(problem.rotary)[name].unit for name in names]
    side, verb = "max" if sign > 0 else "min", "leave" if direction > 0 else "have come from outside"
    room = f"{symbol[0]}max-{symbol[0]}0" if sign > 0 else f"{symbol[0]}0-{symbol[0]}min"
    least = (
        f"needs {symbol[2]}max >= {symbol[1]}0^2/(2({room})) = {rate**2 / (2 * (upper - value)):.6g} {unit[2]}"
        if upper - value > 0 else f"no {names[2]} limit is enough"
    )
    raise ValueError(
        f"{where}.{names[0]}: {here[i]:.9g} {unit[0]} with {names[1]} {here[i + 1]:.9g} {unit[1]} must {verb}"
        f" limits.{names[0]} ({side} {sign * upper:.9g} {unit[0]}):"
        f" {least}, limits.{names[2]} allows {brake:.9g} {unit[2]}; raise it or lower the {names[1]}"
    )


def _wrong_units(problem: Problem) -> list[str]:
    stroke, duration = _stroke(problem), _longest(problem)
    if not stroke:
        return []
    kinds, found = units.kinds(problem.rotary), []
    prefix = "deg or mrad" if problem.rotary else "mm"
    times = {}  # the least time that each limit alone asks for
    for i, (factor, most) in enumerate(((1.0, 1e4), (4.0, 1e5), (32.0, 1e7)), 1):
        name = DERIVATIVES[i]
        limit = getattr(problem.limits, name)
        highest = math.inf if limit is None else max(abs(limit.lowest), abs(limit.highest))
        if not 0 < highest < math.inf:
            continue
        times[name] = (factor * stroke / highest) ** (1 / i)
        shown = f"limits.{name}: {highest:g} {kinds[name].unit}"
        if duration is not None and highest * duration**i / stroke > most:
            found.append(
                f"{shown} is {highest * duration**i / stroke:.0f} times what {stroke:g} {kinds['position'].unit} in"
                f" {duration:g} s takes on average; unit mistake? ({prefix} instead of {kinds['position'].unit})"
            )
    for name, least in times.items():
        scale = duration if duration is not None else max((t for n, t in times.items() if n != name), default=least)
        if least > 1e4 * scale:
            found.append(
                f"limits.{name}: makes the least time {_span(least)}, against {_span(scale)}"
                f" {'of move.time' if duration is not None else 'by the other limits'}; unit mistake?"
            )
    return found


def _degrees(problem: Problem) -> list[str]:
    """Tables over angles of many turns, where the move takes a small part of one."""
    stroke, found = _stroke(problem), []
    for name, curve in problem.load.curves.items():
        span = curve.span[1] - curve.span[0]
        if problem.rotary and 0 < stroke < 2 * math.pi < 30 * stroke < span:
            found.append(
                f"load.{problem.shown(name)}: its table spans {span:g} rad, {span / stroke:.0f} times the move; degrees"
                " taken for radians?"
            )
    return found


def _coarse(problem: Problem) -> list[str]:
    acceleration, jerk, duration = problem.limits.acceleration, problem.limits.jerk, _longest(problem)
    if acceleration is None or jerk is None or duration is None:
        return []
    ramp = max(abs(acceleration.lowest), abs(acceleration.highest)) / max(abs(jerk.lowest), abs(jerk.highest))
    count = problem.transcription.intervals
    if not 0 < ramp < math.inf or duration / count <= ramp * (1 + 1e-9):
        return []
    wanted = math.ceil(duration / ramp * (1 - 1e-9))
    remedy = f"write intervals = {wanted} or more"
    if wanted > MOST_INTERVALS:
        remedy = "leave limits.jerk out: it hardly acts"
    return [
        f"transcription.intervals: a step of {duration / count:.3g} s is longer than the {ramp:.3g} s in which"
        f" limits.jerk reaches limits.acceleration; {remedy}"
    ]


def _stroke(problem: Problem) -> float:
    """How far apart the positions asked for lie, in m or rad."""
    states = (problem.move.start, problem.move.end, *problem.move.via)
    given = [x for x in (state.position for state in states) if isinstance(x, float)]
    given += [] if problem.move.start_position is None else [problem.move.start_position]
    return max(given) - min(given) if given else 0.0


def _longest(problem: Problem) -> float | None:
    """The longest duration allowed in s; None when it is free."""
    time = problem.move.time
    return time if isinstance(time, float) else time[1] if isinstance(time, tuple) else None


def _span(seconds: float) -> str:
    return f"{seconds / 3600:.2g} h" if seconds >= 3600 else f"{seconds:.2g} s"
