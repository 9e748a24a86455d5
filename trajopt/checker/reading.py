"""Reading plain data into a case without trust: whatever is not as a result file has it is Malformed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any, Final

import numpy as np

from trajopt.checker.case import (
    DERIVATIVES,
    ELECTRICAL,
    LOADED,
    POWERS,
    TOTALS,
    Array,
    Case,
    Curve,
    Mode,
    Motor,
    Via,
)  # fmt: skip
from trajopt.checker.splines import DEGREE, Spline
from trajopt.checker.values import (
    LARGEST_NUMBER,
    Malformed,
    all_finite,
    is_solved,
    mapping,
    nonnegative,
    number,
    shown,
    vector,
    whole,
)

FORMAT: Final = "trajopt result 1"
_MOTOR: Final = (
    "torque_constant", "resistance", "switching", "eddy", "hysteresis", "hysteresis_exponent", "recovery",
)  # fmt: skip
_LIMITED: Final = (*DERIVATIVES, *LOADED, *ELECTRICAL, *TOTALS)

_ROUNDING: Final = 1e-9  # of its span: a table that ends so little before the move covers it
_NUMBERS: Final = ("objective", "duration", "metrics", "trajectory")
_REQUIRED: Final = ("format", "trajopt", "status", "problem_hash", "problem", *_NUMBERS)


def read(result: Mapping[str, Any], notes: list[str]) -> Case | None:
    """The result as a case, None when its status is one without a solution; what is beyond us goes to ``notes``."""
    result = mapping(result, "the result")
    found = is_solved(result, _REQUIRED, _NUMBERS)
    if result["format"] != FORMAT:
        raise Malformed(f"format is {shown(result['format'])}, not {FORMAT!r}")
    if not found:
        return None
    try:
        return _solved(result, mapping(result["problem"], "problem"), notes)
    except RecursionError:
        raise Malformed("nested too deeply") from None


def stated(problem: Mapping[str, Any], notes: list[str]) -> dict[str, Any]:
    """What a case takes from its problem alone. Raises Malformed."""
    all_finite(problem, "problem")
    known = ("move", "limits", "load", "vibration", "objective", "transcription", "title", "source", "moral", "rotary")
    notes += [f"problem.{key}" for key in problem if key not in known]
    grid = mapping(problem.get("transcription"), "problem.transcription")
    move = mapping(problem.get("move"), "problem.move", ("time", "start", "end", "via", "dwell"))
    load = mapping(problem.get("load", {}), "problem.load", ("inertia", "force", "coulomb", "viscous", *_MOTOR))
    motor = _motor(load)
    mixes = _mixes(motor)
    limits = _limits(problem.get("limits", {}), mixes)
    goal = mapping(problem.get("objective"), "problem.objective", ("terms", "ceilings"))
    terms, ceilings = _terms(goal.get("terms")), _ceilings(goal.get("ceilings"))
    inertia, force = _inertia(load.get("inertia")), None
    if load.get("force") is not None:
        force = _spline(load["force"], "load.force")
    for spline in (inertia, force):
        if isinstance(spline, Spline):
            _within(spline, limits, grid.get("scheme"))
    mentioned = {*limits, *(name for name, _, _ in (*terms, *ceilings))}
    if inertia is None and mentioned - {*DERIVATIVES, "time"}:
        raise Malformed("a limit or an objective of force or power needs load.inertia")
    if motor is None and mentioned & {*ELECTRICAL, "brake_energy", "copper_loss", "electrical_energy"}:
        raise Malformed("a limit or an objective of the motor needs load.torque_constant and load.resistance")
    return {
        "limits": limits, "inertia": inertia, "force": force,
        "coulomb": nonnegative(load.get("coulomb", 0.0), "load.coulomb"),
        "viscous": number(load.get("viscous", 0.0), "load.viscous"),
        "motor": motor, "mixes": mixes, "dwell": nonnegative(move.get("dwell", 0.0), "move.dwell"),
        "terms": terms, "ceilings": ceilings, "move_time": _move_time(move.get("time")),
        "intervals": whole(grid.get("intervals"), "intervals"),
        "vibration": _vibration(problem.get("vibration", ())), "rotary": problem.get("rotary") is True,
    }  # fmt: skip


def ends(problem: Mapping[str, Any], order: int) -> tuple[dict[int, float], dict[int, float]]:
    """The prescribed states at the start and at the end, by derivative."""
    move = mapping(problem.get("move"), "problem.move")
    start = _state(move.get("start", {}), "move.start", order, {"position": 0.0}, 0.0)
    return start, _state(move.get("end"), "move.end", order, {}, 0.0)


def _solved(result: Mapping[str, Any], problem: Mapping[str, Any], notes: list[str]) -> Case:
    parts = stated(problem, notes)
    move, scheme = problem["move"], problem["transcription"].get("scheme")
    mentioned = {*parts["limits"], *(name for name, *_ in (*parts["terms"], *parts["ceilings"]))}
    order = _order(move, mentioned, scheme)
    time, signal = _trajectory(result["trajectory"], scheme, order, notes)
    start, end = ends(problem, order)
    return Case(
        scheme=scheme, order=order, time=time, signal=signal, start=start, end=end, **parts,
        via=_via(move.get("via", ()), order),
        objective=number(result["objective"], "objective"), duration=number(result["duration"], "duration"),
        metrics={
            str(name): number(value, f"metrics.{name}")
            for name, value in mapping(result["metrics"], "metrics").items() if value is not None
        },
        **certificate_of(result.get("certificate")),
    )  # fmt: skip


def _curve(value: Any, where: str) -> Curve:
    if not isinstance(value, Mapping):
        return Curve((0.0,), (number(value, where),))
    table = mapping(value, where, ("time", "value"))
    times, values = vector(table.get("time"), f"{where}.time"), vector(table.get("value"), f"{where}.value")
    if len(times) != len(values) or len(times) == 0 or not np.all(np.diff(times) > 0):
        raise Malformed(f"{where} is no table: as many values as times, and times must increase")
    return Curve(tuple(times.tolist()), tuple(values.tolist()))


def _inertia(value: Any) -> Curve | Spline | None:
    if isinstance(value, Mapping) and "position" in value:
        return _spline(value, "load.inertia")
    return None if value is None else _curve(value, "load.inertia")


def _spline(value: Any, where: str) -> Spline:
    table = mapping(value, where, ("position", "value"))
    position, values = (vector(table.get(key), f"{where}.{key}") for key in ("position", "value"))
    if len(position) != len(values) or len(position) <= DEGREE or not np.all(np.diff(position) > 0):
        raise Malformed(f"{where} is no table: {DEGREE + 1} rows or more, and positions must increase")
    return Spline(position, values)


def _within(spline: Spline, limits: Mapping[str, tuple[Curve | None, Curve | None]], scheme: Any) -> None:
    """A load over position is known within its table only, and between the nodes of the exact scheme."""
    low, high = limits.get("position", (None, None))
    first, last = float(spline.position[0]), float(spline.position[-1])
    room = _ROUNDING * (last - first)
    if low is None or high is None or min(low.value) < first - room or max(high.value) > last + room:
        raise Malformed("a load over position needs limits.position within its table")
    if scheme != "exact":
        raise Malformed("a load over position needs the exact scheme")


def _motor(load: Mapping[str, Any]) -> Motor | None:
    found = {key: nonnegative(load[key], f"load.{key}") for key in _MOTOR if load.get(key) is not None}
    if not (found.get("torque_constant") and found.get("resistance")):
        if any(found.get(key) for key in _MOTOR[:5]):
            raise Malformed("a motor needs load.torque_constant and load.resistance")
        return None
    exponent, recovery = found.get("hysteresis_exponent", 2.0), found.get("recovery", 0.0)
    if not 1 < exponent <= 2 or recovery > 1:
        raise Malformed(f"hysteresis_exponent {exponent!r} and recovery {recovery!r} are not those of a motor")
    constant, resistance, switching, eddy, hysteresis = (found.get(key, 0.0) for key in _MOTOR[:5])
    return Motor(constant, resistance, switching, eddy, hysteresis, exponent, recovery)


def _mixes(motor: Motor | None) -> dict[str, tuple[Fraction, Fraction]]:
    """What is a·force + b·velocity: the current F/Kt, and the voltage R F/Kt + Kt v."""
    found = {"force": (Fraction(1), Fraction(0))}
    if motor is not None:
        constant, resistance = Fraction(motor.constant), Fraction(motor.resistance)
        found |= {"current": (1 / constant, Fraction(0)), "voltage": (resistance / constant, constant)}
    return found


def _limits(
    value: Any, mixes: dict[str, tuple[Fraction, Fraction]]
) -> dict[str, tuple[Curve | None, Curve | None]]:
    """(lower, upper) by name; an envelope as a limit on each of its sides, which join ``mixes``."""
    found: dict[str, tuple[Curve | None, Curve | None]] = {}
    for name, limit in mapping(value, "problem.limits", (*_LIMITED, "envelope")).items():
        if name == "envelope":
            for side, mix, level in _sides(limit):
                mixes[side], found[side] = mix, (Curve((0.0,), (-level,)), Curve((0.0,), (level,)))
            continue
        sides = mapping(limit, f"limits.{name}", ("min", "max"))
        low, high = (
            None if sides.get(side) is None else _curve(sides[side], f"limits.{name}.{side}") for side in ("min", "max")
        )
        if name in TOTALS and (low is not None or high is None or len(high.value) > 1):
            raise Malformed(f"limits.{name} must be one number, from above")
        found[name] = (low, high)
    return found


def _sides(value: Any) -> Iterator[tuple[str, tuple[Fraction, Fraction], float]]:
    """The sides of a torque-speed envelope: plus-minus (force + slope·velocity) below a level, and the last speed."""
    table = mapping(value, "limits.envelope", ("speed", "force"))
    speed, force = (vector(table.get(key), f"limits.envelope.{key}").tolist() for key in ("speed", "force"))
    slopes = [
        (Fraction(strong) - Fraction(weak)) / (Fraction(fast) - Fraction(slow)) if fast > slow else Fraction(-1)
        for slow, fast, strong, weak in zip(speed, speed[1:], force, force[1:], strict=False)
    ]
    falls = all(slope >= 0 for slope in slopes) and bool(slopes) and len(speed) == len(force)
    if not falls or speed[0] != 0 or min(force) < 0 or force[0] <= 0:
        raise Malformed("limits.envelope is none: speeds must increase from 0, forces fall and stay positive")
    for k, slope in enumerate(slopes):
        level = float(Fraction(force[k]) + slope * Fraction(speed[k]))
        yield f"envelope {k + 1} forwards", (Fraction(1), slope), level
        if slope:
            yield f"envelope {k + 1} backwards", (Fraction(1), -slope), level
    yield "envelope speed", (Fraction(0), Fraction(1)), speed[-1]


def _terms(value: Any) -> tuple[tuple[str, str | None, float], ...]:
    """(quantity, norm or None, weight) of each term."""
    found = []
    for term in value if isinstance(value, list | tuple) else ():
        term = mapping(term, "an objective term", ("minimize", "norm", "weight"))
        name, norm = _measured(term.get("minimize"), term.get("norm"))
        found.append((name, norm, nonnegative(term.get("weight", 1.0), "weight")))
    if not found:
        raise Malformed("problem.objective.terms is missing or empty")
    return tuple(found)


def _ceilings(value: Any) -> tuple[tuple[str, str | None, float], ...]:
    """(quantity, norm or None, most) of each ceiling."""
    if not isinstance(value, list | tuple | None):
        raise Malformed("problem.objective.ceilings is not a list")
    found = []
    for ceiling in value or ():
        ceiling = mapping(ceiling, "a ceiling", ("of", "norm", "at_most"))
        name, norm = _measured(ceiling.get("of"), ceiling.get("norm"))
        found.append((name, norm, nonnegative(ceiling.get("at_most"), "at_most")))
    return tuple(found)


def _measured(name: Any, norm: Any) -> tuple[str, str | None]:
    """What an objective measures, and by which norm."""
    if name not in (*DERIVATIVES, *LOADED, *ELECTRICAL, *POWERS, "time"):
        raise Malformed(f"the objective names {shown(name)}, which this checker does not know")
    if (norm is None) != (name in (*POWERS, "time")) or not isinstance(norm, str | None):
        raise Malformed(f"the norm of {name} is {shown(norm)}")
    return name, norm


def _order(move: Mapping[str, Any], mentioned: set[str], scheme: Any) -> int:
    """Which derivative the problem makes the top one: the highest mentioned, a state's own being one below the top."""
    if scheme not in ("exact", "euler"):
        raise Malformed(f"problem.transcription.scheme is {shown(scheme)}")
    via = move.get("via", ())
    for state in (move.get("start", {}), move.get("end", {}), *(via if isinstance(via, list | tuple) else ())):
        mentioned = mentioned | {f"{key} in a state" for key in mapping(state, "a state") if state[key] is not None}
    if mentioned & {"snap", "jerk in a state"}:
        return 4
    return 3 if scheme == "euler" or mentioned & {"jerk", "acceleration in a state"} else 2


def _state(value: Any, where: str, order: int, missing: dict[str, float], default: float | None) -> dict[int, float]:
    """The prescribed derivatives below ``order``: number of the derivative -> value."""
    state = mapping(value, where, (*DERIVATIVES[:4], "time") if where == "move.via" else DERIVATIVES[:4])
    found = {}
    for i, name in enumerate(DERIVATIVES[:order]):
        given = state.get(name)
        given = missing.get(name, default) if given is None else given
        if given is not None and given != "free":
            found[i] = number(given, f"{where}.{name}")
    if where == "move.end" and state.get("position") is None:
        raise Malformed("move.end.position is missing")
    return found


def _via(value: Any, order: int) -> tuple[Via, ...]:
    if not isinstance(value, list | tuple):
        raise Malformed("move.via is not a list")
    return tuple(
        Via(number(state.get("time"), "move.via.time"), _state(state, "move.via", order, {}, None)) for state in value
    )


def _vibration(value: Any) -> tuple[Mode, ...]:
    if not isinstance(value, list | tuple):
        raise Malformed("vibration is not a list")
    found = []
    for mode in value:
        mode = mapping(mode, "a vibration", ("frequency", "damping", "residual", "robust"))
        given = mode.get("frequency")
        points = tuple(number(x, "frequency") for x in (given if isinstance(given, list | tuple) else (given,)))
        damping = nonnegative(mode.get("damping", 0.0), "damping")
        if not 1 <= len(points) <= 2 or min(points) <= 0 or damping >= 1:
            raise Malformed("a vibration needs a frequency > 0, or a band of two, and a damping below 1")
        residual = nonnegative(mode.get("residual", 0.0), "residual")
        found.append(Mode(points, damping, residual, mode.get("robust") is True))
    return tuple(found)


def _move_time(value: Any) -> float | tuple[float, float] | None:
    """A fixed time, a pair, or None for free."""
    if value == "free":
        return None
    if isinstance(value, list | tuple):
        if len(value) != 2:
            raise Malformed("move.time is no pair")
        return number(value[0], "move.time"), number(value[1], "move.time")
    return number(value, "move.time")


def _trajectory(value: Any, scheme: Any, order: int, notes: list[str]) -> tuple[Array, tuple[Array, ...]]:
    found = mapping(value, "trajectory")
    if found.get("scheme") != scheme:
        raise Malformed(f"trajectory.scheme is {shown(found.get('scheme'))}, the problem asks for {scheme}")
    if found.get("order") != order or isinstance(found.get("order"), bool):
        raise Malformed(f"trajectory.order is {shown(found.get('order'))}, the problem needs {order}")
    time = vector(found.get("time"), "trajectory.time")
    if len(time) < 2 or time[0] != 0 or not np.all(np.diff(time) > 0):
        raise Malformed("trajectory.time must start at 0 and increase")
    if time[-1] < 1 / LARGEST_NUMBER:
        raise Malformed(f"the move takes {float(time[-1])!r} s, absurdly short")
    signal = tuple(vector(found.get(name), f"trajectory.{name}") for name in DERIVATIVES[: order + 1])
    for i, values in enumerate(signal):
        if len(values) != (wanted := len(time) - (i == order)):
            raise Malformed(f"trajectory.{DERIVATIVES[i]} has {len(values)} values where {wanted} belong")
    known = ("scheme", "order", "time", *DERIVATIVES[: order + 1])
    notes += [f"trajectory.{key}" for key in found if key not in known]
    return time, signal


def certificate_of(value: Any) -> dict[str, Any]:
    if value is None:
        return {"lower_bound": None, "gap": None, "has_certificate": False}
    found = mapping(value, "certificate")
    numbers = {
        key: None if found.get(key) is None else number(found[key], f"certificate.{key}")
        for key in ("lower_bound", "gap")
    }
    return {**numbers, "has_certificate": True}
