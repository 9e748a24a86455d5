"""Reading plain data into a case without trust: whatever is not as a result file has it is Malformed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
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

FORMAT: Final = "trajopt result 1"
WITH_SOLUTION: Final = ("SOLVED", "SOLVED_LOCAL")
WITHOUT_SOLUTION: Final = (
    "IMPOSSIBLE", "IMPOSSIBLE_ON_GRID", "UNDECIDED", "LIMIT", "BAD_INPUT", "CRASHED", "INTERRUPTED",
)  # fmt: skip
LARGEST_NUMBER: Final = 1e60
_MOTOR: Final = (
    "torque_constant", "resistance", "switching", "eddy", "hysteresis", "hysteresis_exponent", "recovery",
)  # fmt: skip
_LIMITED: Final = (*DERIVATIVES, *LOADED, *ELECTRICAL, *TOTALS)

_ROUNDING: Final = 1e-9  # of its span: a table that ends so little before the move covers it
_NUMBERS: Final = ("objective", "duration", "metrics", "trajectory")
_REQUIRED: Final = ("format", "trajopt", "status", "problem_hash", "problem", *_NUMBERS)


class Malformed(ValueError):
    """The data is not what a result file holds."""


def read(result: Mapping[str, Any], notes: list[str]) -> Case | None:
    """The result as a case, None when its status is one without a solution; what is beyond us goes to ``notes``."""
    result = _mapping(result, "the result")
    for key in _REQUIRED:
        if key not in result:
            raise Malformed(f"{key} is missing")
    if result["format"] != FORMAT:
        raise Malformed(f"format is {shown(result['format'])}, not {FORMAT!r}")
    status = result["status"]
    if status in WITHOUT_SOLUTION:
        for key in _NUMBERS:
            if result[key] is not None:
                raise Malformed(f"{status} must carry no numbers, but {key} is not null")
        return None
    if status not in WITH_SOLUTION:
        raise Malformed(f"unknown status {shown(status)}")
    try:
        return _solved(result, _mapping(result["problem"], "problem"), notes)
    except RecursionError:
        raise Malformed("nested too deeply") from None


def stated(problem: Mapping[str, Any], notes: list[str]) -> dict[str, Any]:
    """What a case takes from its problem alone. Raises Malformed."""
    _finite(problem, "problem")
    known = ("move", "limits", "load", "vibration", "objective", "transcription", "title", "source", "moral", "rotary")
    notes += [f"problem.{key}" for key in problem if key not in known]
    grid = _mapping(problem.get("transcription"), "problem.transcription")
    move = _mapping(problem.get("move"), "problem.move", ("time", "start", "end", "via", "dwell"))
    load = _mapping(problem.get("load", {}), "problem.load", ("inertia", "force", "coulomb", "viscous", *_MOTOR))
    motor = _motor(load)
    mixes = _mixes(motor)
    limits = _limits(problem.get("limits", {}), mixes)
    goal = _mapping(problem.get("objective"), "problem.objective", ("terms", "ceilings"))
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
        "coulomb": _nonnegative(load.get("coulomb", 0.0), "load.coulomb"),
        "viscous": _number(load.get("viscous", 0.0), "load.viscous"),
        "motor": motor, "mixes": mixes, "dwell": _nonnegative(move.get("dwell", 0.0), "move.dwell"),
        "terms": terms, "ceilings": ceilings, "move_time": _move_time(move.get("time")),
        "intervals": _whole(grid.get("intervals"), "intervals"),
        "vibration": _vibration(problem.get("vibration", ())), "rotary": problem.get("rotary") is True,
    }  # fmt: skip


def ends(problem: Mapping[str, Any], order: int) -> tuple[dict[int, float], dict[int, float]]:
    """The prescribed states at the start and at the end, by derivative."""
    move = _mapping(problem.get("move"), "problem.move")
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
        objective=_number(result["objective"], "objective"), duration=_number(result["duration"], "duration"),
        metrics={
            str(name): _number(value, f"metrics.{name}")
            for name, value in _mapping(result["metrics"], "metrics").items() if value is not None
        },
        **_certificate(result.get("certificate")),
    )  # fmt: skip


def shown(value: Any) -> str:
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # more digits, or nesting, than Python prints
        text = f"a {type(value).__name__} beyond printing"
    return text if len(text) <= 60 else text[:57] + "..."


def _mapping(value: Any, where: str, known: Iterable[str] | None = None) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise Malformed(f"{where} is missing or not an object")
    for key in value if known is not None else ():
        if key not in (known or ()):
            raise Malformed(f"{where} has {shown(key)}, which this checker does not know")
    return value


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise Malformed(f"{where} is {shown(value)}, not a number")
    if not abs(value) <= LARGEST_NUMBER:
        raise Malformed(f"{where} is {shown(value)}, not finite or absurdly large")
    return float(value)


def _nonnegative(value: Any, where: str) -> float:
    if (number := _number(value, where)) < 0:
        raise Malformed(f"{where} is {number!r}, negative")
    return number


def _whole(value: Any, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise Malformed(f"{where} is {shown(value)}, not a whole number")
    return value


def _finite(value: Any, where: str) -> None:
    """Every number anywhere in the problem is finite."""
    if value is None or isinstance(value, str | bool):
        return
    if isinstance(value, int | float):
        _number(value, where)
    elif isinstance(value, Mapping):
        for key, item in value.items():
            _finite(item, f"{where}.{key}")
    elif isinstance(value, list | tuple):
        for item in value:
            _finite(item, where)


def _vector(values: Any, where: str) -> Array:
    if not isinstance(values, list | tuple):
        raise Malformed(f"{where} is missing or not a list")
    if not set(map(type, values)) <= {float, int}:
        wrong = next(x for x in values if type(x) not in (float, int))
        raise Malformed(f"{where} holds {shown(wrong)}, not a number")
    try:
        found = np.array(values, dtype=np.float64)
    except OverflowError:
        raise Malformed(f"{where} holds an absurdly large number") from None
    if not np.all(np.abs(found) <= LARGEST_NUMBER):
        raise Malformed(f"{where} holds a number that is not finite or absurdly large")
    return found


def _curve(value: Any, where: str) -> Curve:
    if not isinstance(value, Mapping):
        return Curve((0.0,), (_number(value, where),))
    table = _mapping(value, where, ("time", "value"))
    times, values = _vector(table.get("time"), f"{where}.time"), _vector(table.get("value"), f"{where}.value")
    if len(times) != len(values) or len(times) == 0 or not np.all(np.diff(times) > 0):
        raise Malformed(f"{where} is no table: as many values as times, and times must increase")
    return Curve(tuple(times.tolist()), tuple(values.tolist()))


def _inertia(value: Any) -> Curve | Spline | None:
    if isinstance(value, Mapping) and "position" in value:
        return _spline(value, "load.inertia")
    return None if value is None else _curve(value, "load.inertia")


def _spline(value: Any, where: str) -> Spline:
    table = _mapping(value, where, ("position", "value"))
    position, values = (_vector(table.get(key), f"{where}.{key}") for key in ("position", "value"))
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
    found = {key: _nonnegative(load[key], f"load.{key}") for key in _MOTOR if load.get(key) is not None}
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
    for name, limit in _mapping(value, "problem.limits", (*_LIMITED, "envelope")).items():
        if name == "envelope":
            for side, mix, level in _sides(limit):
                mixes[side], found[side] = mix, (Curve((0.0,), (-level,)), Curve((0.0,), (level,)))
            continue
        sides = _mapping(limit, f"limits.{name}", ("min", "max"))
        low, high = (
            None if sides.get(side) is None else _curve(sides[side], f"limits.{name}.{side}") for side in ("min", "max")
        )
        if name in TOTALS and (low is not None or high is None or len(high.value) > 1):
            raise Malformed(f"limits.{name} must be one number, from above")
        found[name] = (low, high)
    return found


def _sides(value: Any) -> Iterator[tuple[str, tuple[Fraction, Fraction], float]]:
    """The sides of a torque-speed envelope: plus-minus (force + slope·velocity) below a level, and the last speed."""
    table = _mapping(value, "limits.envelope", ("speed", "force"))
    speed, force = (_vector(table.get(key), f"limits.envelope.{key}").tolist() for key in ("speed", "force"))
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
        term = _mapping(term, "an objective term", ("minimize", "norm", "weight"))
        name, norm = _measured(term.get("minimize"), term.get("norm"))
        found.append((name, norm, _nonnegative(term.get("weight", 1.0), "weight")))
    if not found:
        raise Malformed("problem.objective.terms is missing or empty")
    return tuple(found)


def _ceilings(value: Any) -> tuple[tuple[str, str | None, float], ...]:
    """(quantity, norm or None, most) of each ceiling."""
    if not isinstance(value, list | tuple | None):
        raise Malformed("problem.objective.ceilings is not a list")
    found = []
    for ceiling in value or ():
        ceiling = _mapping(ceiling, "a ceiling", ("of", "norm", "at_most"))
        name, norm = _measured(ceiling.get("of"), ceiling.get("norm"))
        found.append((name, norm, _nonnegative(ceiling.get("at_most"), "at_most")))
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
        mentioned = mentioned | {f"{key} in a state" for key in _mapping(state, "a state") if state[key] is not None}
    if mentioned & {"snap", "jerk in a state"}:
        return 4
    return 3 if scheme == "euler" or mentioned & {"jerk", "acceleration in a state"} else 2


def _state(value: Any, where: str, order: int, missing: dict[str, float], default: float | None) -> dict[int, float]:
    """The prescribed derivatives below ``order``: number of the derivative -> value."""
    state = _mapping(value, where, (*DERIVATIVES[:4], "time") if where == "move.via" else DERIVATIVES[:4])
    found = {}
    for i, name in enumerate(DERIVATIVES[:order]):
        given = state.get(name)
        given = missing.get(name, default) if given is None else given
        if given is not None and given != "free":
            found[i] = _number(given, f"{where}.{name}")
    if where == "move.end" and state.get("position") is None:
        raise Malformed("move.end.position is missing")
    return found


def _via(value: Any, order: int) -> tuple[Via, ...]:
    if not isinstance(value, list | tuple):
        raise Malformed("move.via is not a list")
    return tuple(
        Via(_number(state.get("time"), "move.via.time"), _state(state, "move.via", order, {}, None)) for state in value
    )


def _vibration(value: Any) -> tuple[Mode, ...]:
    if not isinstance(value, list | tuple):
        raise Malformed("vibration is not a list")
    found = []
    for mode in value:
        mode = _mapping(mode, "a vibration", ("frequency", "damping", "residual", "robust"))
        given = mode.get("frequency")
        points = tuple(_number(x, "frequency") for x in (given if isinstance(given, list | tuple) else (given,)))
        damping = _nonnegative(mode.get("damping", 0.0), "damping")
        if not 1 <= len(points) <= 2 or min(points) <= 0 or damping >= 1:
            raise Malformed("a vibration needs a frequency > 0, or a band of two, and a damping below 1")
        residual = _nonnegative(mode.get("residual", 0.0), "residual")
        found.append(Mode(points, damping, residual, mode.get("robust") is True))
    return tuple(found)


def _move_time(value: Any) -> float | tuple[float, float] | None:
    """A fixed time, a pair, or None for free."""
    if value == "free":
        return None
    if isinstance(value, list | tuple):
        if len(value) != 2:
            raise Malformed("move.time is no pair")
        return _number(value[0], "move.time"), _number(value[1], "move.time")
    return _number(value, "move.time")


def _trajectory(value: Any, scheme: Any, order: int, notes: list[str]) -> tuple[Array, tuple[Array, ...]]:
    found = _mapping(value, "trajectory")
    if found.get("scheme") != scheme:
        raise Malformed(f"trajectory.scheme is {shown(found.get('scheme'))}, the problem asks for {scheme}")
    if found.get("order") != order or isinstance(found.get("order"), bool):
        raise Malformed(f"trajectory.order is {shown(found.get('order'))}, the problem needs {order}")
    time = _vector(found.get("time"), "trajectory.time")
    if len(time) < 2 or time[0] != 0 or not np.all(np.diff(time) > 0):
        raise Malformed("trajectory.time must start at 0 and increase")
    if time[-1] < 1 / LARGEST_NUMBER:
        raise Malformed(f"the move takes {float(time[-1])!r} s, absurdly short")
    signal = tuple(_vector(found.get(name), f"trajectory.{name}") for name in DERIVATIVES[: order + 1])
    for i, values in enumerate(signal):
        if len(values) != (wanted := len(time) - (i == order)):
            raise Malformed(f"trajectory.{DERIVATIVES[i]} has {len(values)} values where {wanted} belong")
    known = ("scheme", "order", "time", *DERIVATIVES[: order + 1])
    notes += [f"trajectory.{key}" for key in found if key not in known]
    return time, signal


def _certificate(value: Any) -> dict[str, Any]:
    if value is None:
        return {"lower_bound": None, "gap": None, "has_certificate": False}
    found = _mapping(value, "certificate")
    numbers = {
        key: None if found.get(key) is None else _number(found[key], f"certificate.{key}")
        for key in ("lower_bound", "gap")
    }
    return {**numbers, "has_certificate": True}
