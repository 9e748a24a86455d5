"""Units of problem files: a number, a space, a unit such as ``m/s^2``; read by a table, nothing is evaluated.

A unit is a product of powers: names joined by spaces, ``*`` or ``·``; ``/`` divides by the *one* name that follows
(``N m s/rad``); ``^`` takes a whole number. ``1/s`` is written ``1/s``.
"""

from __future__ import annotations

import math
import re
from typing import Any, Final, NamedTuple

Dimension = tuple[int, int, int, int, int]  # powers of m, kg, s, rad, A

_BASE: Final[dict[str, tuple[float, Dimension]]] = {
    "1": (1.0, (0, 0, 0, 0, 0)),
    "m": (1.0, (1, 0, 0, 0, 0)),
    "in": (0.0254, (1, 0, 0, 0, 0)),
    "g": (1e-3, (0, 1, 0, 0, 0)),
    "t": (1e3, (0, 1, 0, 0, 0)),
    "s": (1.0, (0, 0, 1, 0, 0)),
    "min": (60.0, (0, 0, 1, 0, 0)),
    "h": (3600.0, (0, 0, 1, 0, 0)),
    "Hz": (1.0, (0, 0, -1, 0, 0)),
    "rad": (1.0, (0, 0, 0, 1, 0)),
    "deg": (math.pi / 180, (0, 0, 0, 1, 0)),
    "rev": (2 * math.pi, (0, 0, 0, 1, 0)),
    "rpm": (2 * math.pi / 60, (0, 0, -1, 1, 0)),
    "N": (1.0, (1, 1, -2, 0, 0)),
    "J": (1.0, (2, 1, -2, 0, 0)),
    "W": (1.0, (2, 1, -3, 0, 0)),
    "A": (1.0, (0, 0, 0, 0, 1)),
    "V": (1.0, (2, 1, -3, 0, -1)),
    "ohm": (1.0, (2, 1, -3, 0, -2)),
}
_PREFIX: Final = {"n": 1e-9, "u": 1e-6, "\u00b5": 1e-6, "\u03bc": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6}
_PREFIXED: Final = ("m", "g", "s", "Hz", "rad", "N", "J", "W", "A", "V", "ohm")
UNITS: Final = _BASE | {
    prefix + name: (factor * _BASE[name][0], _BASE[name][1])
    for prefix, factor in _PREFIX.items()
    for name in _PREFIXED
    if prefix + name not in _BASE
}
_VALUE: Final = re.compile(
    r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)(?![0-9.,_])\s*(.*?)\s*", re.DOTALL
)
_FACTOR: Final = re.compile("(?P<by>\\s*[*·/]\\s*|\\s+)?(?P<name>[A-Za-z\u00b5\u03bc]+|1)(?:\\^(?P<power>-?[0-9]))?")
_LONGEST: Final = 100
_SLIPS: Final = {  # what people write instead, and what would do
    ",": "write a decimal point, not a comma",
    "\u2212": "write a plain minus sign",
    "°": "write deg",
    "²": "write ^2",
    "³": "write ^3",
    "\u03a9": "write ohm",
    "\u2126": "write ohm",
}
_WORDS: Final = {
    "sec": "s",
    "msec": "ms",
    "second": "s",
    "seconds": "s",
    "meter": "m",
    "metre": "m",
    "inch": "in",
    "degree": "deg",
    "degrees": "deg",
    "minutes": "min",
    "hour": "h",
}
LARGEST: Final = 1e30  # SI; beyond it, and below its inverse, a number is a slip of the pen


class UnitError(ValueError):
    """A text that is no quantity of the kind asked for; the message says why and what would do."""


class Kind(NamedTuple):
    """What a field measures: its name in messages, its dimension, the SI unit and an example."""

    name: str
    dimension: Dimension
    unit: str
    example: str


def _derivatives(base: str, angle: int) -> dict[str, Kind]:
    length = 1 - angle
    names = ("position", "velocity", "acceleration", "jerk", "snap")
    power = ("", "/s", "/s^2", "/s^3", "/s^4")
    return {
        name: Kind(name, (length, 0, -order, angle, 0), base + power[order], f"0.5 {base}{power[order]}")
        for order, name in enumerate(names)
    }


_COMMON: Final = {
    "time": Kind("time", (0, 0, 1, 0, 0), "s", "0.5 s"),
    "power": Kind("power", (2, 1, -3, 0, 0), "W", "100 W"),
    "frequency": Kind("frequency", (0, 0, -1, 0, 0), "Hz", "8 Hz"),
    "energy": Kind("energy", (2, 1, -2, 0, 0), "J", "1 J"),
    "current": Kind("current", (0, 0, 0, 0, 1), "A", "5 A"),
    "voltage": Kind("voltage", (2, 1, -3, 0, -1), "V", "48 V"),
    "resistance": Kind("resistance", (2, 1, -3, 0, -2), "ohm", "3 ohm"),
    "switching": Kind("switching loss", (2, 1, -3, 0, -1), "W/A", "4 W/A"),
    "electrical_power": Kind("electrical power", (2, 1, -3, 0, 0), "W", "100 W"),
    "electrical_energy": Kind("electrical energy", (2, 1, -2, 0, 0), "J", "1 J"),
    "copper_loss": Kind("copper loss", (2, 1, -2, 0, 0), "J", "1 J"),
    "brake_energy": Kind("braking energy", (2, 1, -2, 0, 0), "J", "1 J"),
}
LINEAR: Final = (
    _COMMON
    | _derivatives("m", 0)
    | {
        "inertia": Kind("mass", (0, 1, 0, 0, 0), "kg", "10 kg"),
        "force": Kind("force", (1, 1, -2, 0, 0), "N", "50 N"),
        "rms_force": Kind("RMS force", (1, 1, -2, 0, 0), "N", "20 N"),
        "envelope": Kind("force at standstill", (1, 1, -2, 0, 0), "N", "50 N"),
        "viscous": Kind("viscous friction", (0, 1, -1, 0, 0), "N s/m", "2 N s/m"),
        "torque_constant": Kind("force constant", (1, 1, -2, 0, -1), "N/A", "40 N/A"),
        "eddy": Kind("eddy-current loss", (0, 1, -1, 0, -2), "W s^2/m^2/A^2", "1e-4 W s^2/m^2/A^2"),
        "hysteresis": Kind("hysteresis loss", (1, 1, -2, 0, 0), "W s/m", "5e-3 W s/m"),
    }
)
ROTARY: Final = (
    _COMMON
    | _derivatives("rad", 1)
    | {
        "inertia": Kind("inertia", (2, 1, 0, 0, 0), "kg m^2", "4e-4 kg m^2"),
        "force": Kind("torque", (2, 1, -2, 0, 0), "N m", "1.5 N m"),
        "rms_force": Kind("RMS torque", (2, 1, -2, 0, 0), "N m", "0.6 N m"),
        "envelope": Kind("torque at standstill", (2, 1, -2, 0, 0), "N m", "1.5 N m"),
        "viscous": Kind("viscous friction", (2, 1, -1, 0, 0), "N m s", "2e-4 N m s/rad"),
        "torque_constant": Kind("torque constant", (2, 1, -2, 0, -1), "N m/A", "0.57 N m/A"),
        "eddy": Kind("eddy-current loss", (2, 1, -1, 0, -2), "ohm s^2", "1e-4 ohm s^2"),
        "hysteresis": Kind("hysteresis loss", (2, 1, -2, 0, 0), "W s", "5e-3 W s/rad"),
    }
)
_WITHOUT_ANGLE: Final = (
    "inertia", "force", "rms_force", "envelope", "viscous", "power", "energy", "brake_energy", "torque_constant",
    "eddy", "hysteresis",
)  # fmt: skip


def parse(text: str) -> tuple[float, Dimension, str]:
    """Read ``"0.5 m/s"`` as (value in SI, dimension, unit as written).

    Raises UnitError for anything that is not one finite number and one known unit.
    """
    if len(text) > _LONGEST:
        raise UnitError(f"a text of {len(text)} characters is no quantity")
    if re.match(r"\s*[+-]?(nan|inf)", text, re.IGNORECASE):
        raise UnitError(f"{shown(text)} is not finite; leave the key out where there is no limit")
    match = _VALUE.fullmatch(text)
    if match is None:
        raise UnitError(f"{shown(text)} is not a number and a unit{_slip(text)}")
    number, unit = float(match[1]), match[2]
    if not unit:
        raise UnitError(f"{shown(text)} has no unit")
    factor, dimension = 1.0, (0, 0, 0, 0, 0)
    for sign, name, power in _factors(unit, text):
        if name not in UNITS:
            raise UnitError(f"{shown(text)}: unknown unit {name!r}{_nearest(name)}")
        scale, powers = UNITS[name]
        factor *= scale ** (sign * power)
        dimension = tuple(d + sign * power * p for d, p in zip(dimension, powers, strict=True))  # type: ignore[assignment]
    value = number * factor
    zero = not re.search("[1-9]", re.split("[eE]", match[1])[0])
    if not math.isfinite(value) or not (zero or 1 / LARGEST <= abs(value) <= LARGEST):
        raise UnitError(f"{shown(text)} is out of range (1e-30 to 1e30 in SI)")
    return value, dimension, unit


def _factors(unit: str, text: str) -> list[tuple[int, str, int]]:
    """Split ``N m s/rad`` into (sign, name, power)."""
    found: list[tuple[int, str, int]] = []
    at = 0
    while at < len(unit):
        match = _FACTOR.match(unit, at)
        by = match["by"].strip() if match and match["by"] else None
        if match is None or (by is None if found else by not in (None, "/")):
            raise UnitError(f"{shown(text)}: {shown(unit)} is not a unit{_slip(unit) or '; write for example m/s^2'}")
        found.append((-1 if by == "/" else 1, match["name"], int(match["power"] or 1)))
        at = match.end()
    return found


def _slip(text: str) -> str:
    return next((f"; {remedy}" for slip, remedy in _SLIPS.items() if slip in text), "")


def _nearest(name: str) -> str:
    """``(did you mean 'N m'?)``: another spelling of a unit, or two units written as one."""
    word = _WORDS.get(name.lower())
    pairs = [f"{name[:i]} {name[i:]}" for i in range(1, len(name)) if {name[:i], name[i:]} <= UNITS.keys()]
    same = [known for known in UNITS if known.lower() == name.lower()]
    found = [word] if word else pairs or same
    return f" (did you mean {found[0]!r}?)" if found else ""


def to_si(text: str, kind: str, rotary: bool = False) -> float:
    """The SI value of ``text``, which must measure ``kind`` (a key of LINEAR or ROTARY).

    Raises UnitError naming what was found, what is needed and an example.
    """
    wanted = (ROTARY if rotary else LINEAR)[kind]
    try:
        value, dimension, unit = parse(text)
    except UnitError as error:
        raise UnitError(f"{error}; {article(wanted.name)} is needed, for example {wanted.example!r}") from None
    if kind in _WITHOUT_ANGLE:  # a radian is a pure number in torque, inertia, friction, power and loss
        dimension = (*dimension[:3], 0, dimension[4])
    if dimension != wanted.dimension:
        other = (LINEAR if rotary else ROTARY)[kind].dimension
        hint = f" (the load, or else the end position, makes this a {'rotary' if rotary else 'linear'} axis)"
        raise UnitError(
            f"{shown(text)} is in {unit}; {article(wanted.name)} is needed, for example {wanted.example!r}"
            + (hint if dimension == other else "")
        )
    return value


def shown(value: Any) -> str:
    """``value`` as messages show it: its repr, cut at 60 characters."""
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than Python prints
        return "a number of thousands of digits"
    return text if len(text) <= 60 else f"{text[:57]}..."


def article(name: str) -> str:
    """``a mass``, ``an inertia``."""
    return f"{'an' if name[0] in 'aei' else 'a'} {name}"


def kinds(rotary: bool) -> dict[str, Kind]:
    """The kinds of an axis, by name."""
    return ROTARY if rotary else LINEAR
