"""Bad problem files and overrides as data: what is wrong, and the words that the one-line refusal must contain."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

LINEAR: Final = """
[move]
time = "1 s"
start = { position = "0 m" }
end = { position = "0.25 m" }

[limits]
velocity = "0.5 m/s"
acceleration = "4.9 m/s^2"
jerk = "98 m/s^3"

[load]
mass = "10 kg"

[objective]
minimize = "jerk"
norm = "l2"
"""
ROTARY: Final = """
[move]
time = "1 s"
end = { position = "90 deg" }

[limits]
velocity = "300 deg/s"
torque = "2 N m"

[load]
inertia = "4e-4 kg m^2"

[objective]
minimize = "energy"
"""
MOTOR: Final = """
[move]
time = "0.4 s"
end = { position = "5 rad" }

[limits]
velocity = ["0 rad/s", "100 rad/s"]
acceleration = "275 rad/s^2"

[load]
inertia = "4.142e-4 kg m^2"
coulomb = "0.02 N m"
viscous = "2e-4 N m s/rad"
torque_constant = "0.57 N m/A"
resistance = "3 ohm"

[objective]
minimize = "electrical_energy"
"""


@dataclass(frozen=True)
class Bad:
    """One bad input: a TOML text with overrides, and the words that the refusal must contain."""

    name: str
    words: tuple[str, ...]
    text: str = LINEAR
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class BadFile:
    """One bad file: ``make`` puts it at a path, and the refusal must contain ``words``."""

    name: str
    words: tuple[str, ...]
    make: Callable[[Path], object]


@dataclass(frozen=True)
class Field:
    """A field that takes a quantity: its SI unit, and a unit of another quantity."""

    name: str
    unit: str
    other: str
    signed: bool = False  # zero and negative values are meaningful
    zero: bool = False
    text: str = LINEAR

    @property
    def key(self) -> str:
        """A name for test ids."""
        return f"{self.name}-{self.unit}".replace(" ", "")


FIELDS: Final = (
    Field("move.time", "s", "m"),
    Field("move.start.position", "m", "m/s", signed=True),
    Field("move.end.position", "m", "kg", signed=True),
    Field("move.start.velocity", "m/s", "m/s^2", signed=True),
    Field("move.end.acceleration", "m/s^2", "N", signed=True),
    Field("move.end.jerk", "m/s^3", "m/s", signed=True),
    Field("limits.position", "m", "rad"),
    Field("limits.velocity", "m/s", "kg"),
    Field("limits.acceleration", "m/s^2", "m/s"),
    Field("limits.jerk", "m/s^3", "m/s^2"),
    Field("limits.snap", "m/s^4", "1/s^4"),
    Field("limits.force", "N", "N m"),
    Field("limits.power", "W", "J"),
    Field("load.mass", "kg", "N"),
    Field("load.coulomb", "N", "N s", zero=True),
    Field("load.viscous", "N s/m", "N m s", zero=True),
    Field("limits.velocity", "rad/s", "m/s", text=ROTARY),
    Field("limits.torque", "N m", "N", text=ROTARY),
    Field("load.inertia", "kg m^2", "A", text=ROTARY),
    Field("load.viscous", "N m s/rad", "N s/m", zero=True, text=ROTARY),
    Field("limits.current", "A", "V", text=MOTOR),
    Field("limits.voltage", "V", "A", text=MOTOR),
    Field("load.torque_constant", "N m/A", "N/A", text=MOTOR),
    Field("load.force_constant", "N/A", "N m/A"),
    Field("load.resistance", "ohm", "A", text=MOTOR),
    Field("load.switching", "W/A", "W", zero=True, text=MOTOR),
    Field("load.eddy", "ohm s^2", "ohm", zero=True, text=MOTOR),
    Field("load.eddy", "W s^2/m^2/A^2", "ohm s^2", zero=True),
    Field("load.hysteresis", "W s/rad", "W", zero=True, text=MOTOR),
    Field("load.hysteresis", "W s/m", "W s", zero=True),
)


def _faults(field: Field) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """(name, TOML value, words) for every kind of fault that a quantity can have."""
    unit = field.unit
    example = ("for example",)
    yield "no-unit", "0.5", ("no unit", *example)
    yield "no-unit-text", '"0.5"', ("has no unit", *example)
    yield "other-unit", f'"0.5 {field.other}"', ("is needed", *example)
    yield "unknown-unit", '"0.5 furlong"', ("unknown unit 'furlong'", *example)
    yield "nan", f'"nan {unit}"', ("not finite",)
    yield "bare-nan", "nan", ("finite",)
    yield "inf", f'"-inf {unit}"', ("not finite", "leave the key out")
    yield "1e400", f'"1e400 {unit}"', ("out of range", "1e30")
    yield "1e308", f'"1e308 {unit}"', ("out of range", "1e30")
    yield "1e-400", f'"1e-400 {unit}"', ("out of range", "1e-30")
    yield "boolean", "true", ("True is not", *example)
    yield "empty", '""', ("not a number and a unit", *example)
    yield "code", "\"__import__('os')\"", ("not a number and a unit", *example)
    yield "power-tower", '"9**9**9 mm"', ("is not a unit", *example)
    yield "shell", f'"1 {unit}; rm"', ("is not a unit", *example)
    yield "digits", f'"\uff11 {unit}"', ("not a number and a unit", *example)
    yield "comma", f'"0,5 {unit}"', ("decimal point",)
    yield "long", f'"{"1" * 200} {unit}"', ("characters", *example)
    if not field.signed:
        yield "negative", f'"-1 {unit}"', (("0 or more",) if field.zero else ("> 0",))
    if not field.signed and not field.zero:
        yield "zero", f'"0 {unit}"', ("> 0", "got '0")
        yield "negative-zero", f'"-0.0 {unit}"', ("> 0", "got '-0.0")
    if field.name.startswith("limits"):
        yield "one-of-a-pair", f'["1 {unit}"]', ("pair [min, max]", "1 values")
        yield "three", f'["1 {unit}", "2 {unit}", "3 {unit}"]', ("pair [min, max]", "3 values")
        yield "min-above-max", f'["1 {unit}", "-1 {unit}"]', ("min must be below max", "swap")
        yield "equal", f'["1 {unit}", "1 {unit}"]', ("min must be below max",)
        yield "unknown-side", f'{{ maxx = "1 {unit}" }}', ("unknown key", "did you mean 'max'")
        yield "no-side", "{}", ("give min, max or both",)
        yield "no-times", f'{{ value = ["1 {unit}", "2 {unit}"] }}', ("time", "is missing", "write")
        yield "fewer-times", f'{{ time = ["0 s", "1 s"], value = ["1 {unit}"] }}', ("as many values as times",)
        yield "times-fall", f'{{ time = ["1 s", "0 s"], value = ["1 {unit}", "2 {unit}"] }}', ("must increase", "'1 s'")
    else:
        yield "list", f'["1 {unit}"]', ("pair [min, max]" if field.name == "move.time" else "is not a",)
        yield "date", "1979-05-27", ("is not a", *example)
    if field.name.startswith("move"):
        yield "not-free", '"fre"', ('or "free"',)


def _by_field() -> Iterator[Bad]:
    for field in FIELDS:
        for name, value, words in _faults(field):
            yield Bad(f"{field.key}-{name}", (f"{field.name}", *words), field.text, (f"{field.name}={value}",))


def _set(name: str, *overrides: str, words: tuple[str, ...], text: str = LINEAR) -> Bad:
    return Bad(name, words, text, overrides)


def _without(section: str, text: str = LINEAR) -> str:
    """``text`` without a section."""
    parts = text.split("\n[")
    return "\n[".join(part for part in parts if not part.startswith(f"{section}]"))


def _vibrations() -> Iterator[Bad]:
    for name, mode, words in (
        ("without-frequency", "damping = 0.1", ("vibration[0].frequency: is missing", "8 Hz")),
        ("frequency-unit", 'frequency = "8 m"', ("vibration[0].frequency", "a frequency is needed", "8 Hz")),
        ("frequency-zero", 'frequency = "0 Hz"', ("vibration[0].frequency: must be > 0",)),
        ("band-falls", 'frequency = ["9 Hz", "8 Hz"], residual = "1 um"', ("a band needs min < max",)),
        ("band-of-three", 'frequency = ["7 Hz", "8 Hz", "9 Hz"]', ("vibration[0].frequency: needs one", "3 values")),
        ("band-at-zero", 'frequency = ["7 Hz", "9 Hz"]', ("residual: no move leaves a whole band at zero",)),
        ("damping-one", 'frequency = "8 Hz", damping = 1.0', ("vibration[0].damping", "below 1", "not per cent")),
        ("damping-text", 'frequency = "8 Hz", damping = "2 %"', ("vibration[0].damping", "0.02")),
        ("residual-unit", 'frequency = "8 Hz", residual = "1 s"', ("vibration[0].residual", "a position is needed")),
        ("residual-negative", 'frequency = "8 Hz", residual = "-1 mm"', ("vibration[0].residual: must be 0 or more",)),
        ("robust-text", 'frequency = "8 Hz", robust = "yes"', ("vibration[0].robust: must be true or false",)),
        ("unknown-key", 'frequncy = "8 Hz"', ("vibration[0].frequncy: unknown key", "'frequency'")),
    ):
        yield _set(f"vibration-{name}", f"vibration=[{{ {mode} }}]", words=words)
    quiet = 'vibration=[{ frequency = "8 Hz" }]'
    yield _set("vibration-euler", quiet, "transcription.scheme=euler", words=("vibration", 'scheme = "exact"'))
    ranged = ('move.time=["0.5 s", "2 s"]', quiet)
    yield _set("vibration-time-range", *ranged, words=("vibration: needs a fixed move.time",))
    yield _set("vibration-no-list", "vibration=3", words=("vibration: must be a list", "8 Hz"))


_UNKNOWN: Final = {  # misspelt key: the one meant
    "mvoe.time": "'move'",
    "limts.velocity": "'limits'",
    "lod.mass": "'load'",
    "objectiv.norm": "'objective'",
    "transcripton.intervals": "'transcription'",
    "titel": "'title'",
    "move.tme": "'time'",
    "move.strat": "'start'",
    "move.vai": "'via'",
    "move.end.positon": "'position'",
    "move.start.velocty": "'velocity'",
    "limits.Velocity": "'velocity'",
    "limits.accleration": "'acceleration'",
    "limits.jerks": "'jerk'",
    "limits.forces": "'force'",
    "limits.torqe": "'torque'",
    "load.maas": "'mass'",
    "load.inerta": "'inertia'",
    "load.coulom": "'coulomb'",
    "objective.minimise": "'minimize'",
    "objective.nrom": "'norm'",
    "transcription.interval": "'intervals'",
    "transcription.sheme": "'scheme'",
    "velocity": "[limits]",
    "intervals": "[transcription]",
    "solver": "[transcription]",
    "mass": "[load]",
    "move.velocity": "[limits]",
    "limits.time": "[move]",
    "weather": "known: move, objective",
}
_NOT_A_SECTION: Final = ("move", "move.start", "move.end", "limits", "load", "objective", "transcription")


def _by_key() -> Iterator[Bad]:
    for key, meant in _UNKNOWN.items():
        named = key.split(".")[0] if key.split(".")[0] not in _NOT_A_SECTION else key
        yield _set(f"unknown-{key}", f'{key}="1 s"', words=(f"{named}: unknown key", meant))
    for key in _NOT_A_SECTION:
        for kind, value in (("number", "3"), ("text", '"x"'), ("list", "[]")):
            yield _set(f"{key}-is-a-{kind}", f"{key}={value}", words=(f"{key}: must be a section with keys",))
    for key in ("title", "source", "moral"):
        yield _set(f"{key}-number", f"{key}=3", words=(f"{key}: must be a text in quotes", "got 3"))
    for value in ('"yes"', "1", "[]"):
        yield _set(f"rotary-{value}", f"rotary={value}", words=("rotary: must be true or false",))


def _transcription() -> Iterator[Bad]:
    words: tuple[str, ...]
    for value in ("3", "0", "-5", "200001"):
        words = ("transcription.intervals: must be 4 to 200000", f"got {value}")
        yield _set(f"intervals-{value}", f"transcription.intervals={value}", words=words)
    for value in ('"200"', "3.5", "200.0", "nan", "true", "[200]", "{}"):
        words = ("transcription.intervals: must be a whole number", "4 to 200000")
        yield _set(f"intervals-{value}", f"transcription.intervals={value}", words=words)
    yield _set("intervals-memory", "transcription.intervals=2000000", words=("transcription.intervals", "30 GB"))
    yield _set("intervals-hex", f"transcription.intervals=0x{'f' * 300}", words=("intervals: must be 4 to 200000",))
    for key, value, words in (
        ("scheme", "exat", ("one of exact, euler", "did you mean 'exact'")),
        ("scheme", "Euler", ("one of exact, euler", "did you mean 'euler'")),
        ("scheme", "true", ("one of exact, euler",)),
        ("solver", "ipop", ("auto, piqp, clarabel, osqp, ipopt", "did you mean 'ipopt'")),
        ("solver", "gurobi", ("auto, piqp, clarabel, osqp, ipopt",)),
        ("solver", "3", ("auto, piqp, clarabel, osqp, ipopt",)),
    ):
        yield _set(f"{key}-{value}", f"transcription.{key}={value}", words=(f"transcription.{key}: unknown", *words))


def _objective() -> Iterator[Bad]:
    for value in ("0", "-1", "-0.0", "nan", "inf", "1e308", "1e-40"):
        yield _set(f"weight-{value}", f"objective.weight={value}", words=("objective.weight: must be > 0 and finite",))
    for value in ('"0.5"', '"1 kg"', "true", "[1]"):
        yield _set(f"weight-{value}", f"objective.weight={value}", words=("objective.weight: must be a plain number",))
    for value in ("l3", "L2", "2", '["l2"]', '""'):
        yield _set(f"norm-{value}", f"objective.norm={value}", words=("objective.norm: unknown norm", "l1, l2, linf"))
    for value, meant in (("jrk", "'jerk'"), ("Energy", "'energy'"), ("accelleration", "'acceleration'"), ("cost", "")):
        words = ("objective.minimize: unknown", "one of position", meant)
        yield _set(f"minimize-{value}", f"objective.minimize={value}", words=words)
    yield _set("minimize-number", "objective.minimize=3", words=("objective.minimize: must be a text",))
    yield _set("minimize-list", 'objective.minimize=["jerk"]', words=("objective.minimize: must be a text",))
    yield _set("norm-missing", 'objective={minimize="jerk"}', words=("objective.norm: is missing", "l1, l2, linf"))
    yield _set("minimize-missing", 'objective={norm="l2"}', words=("objective.minimize: is missing", "write minimize"))
    yield _set("weight-alone", "objective={weight=2}", words=("objective.minimize: is missing",))
    yield _set("objective-empty", "objective={}", words=("objective.terms: is missing", "write minimize"))
    yield _set("terms-empty", "objective.terms=[]", words=("objective.terms: is empty", "write"))
    yield _set("terms-text", 'objective.terms="jerk"', words=("objective.terms: must be a list of sections",))
    yield _set("terms-of-texts", 'objective.terms=["jerk"]', words=("objective.terms[0]: must be a section with keys",))
    both = 'objective={minimize="jerk", norm="l2", terms=[{minimize="energy"}]}'
    yield _set("terms-and-minimize", both, words=("objective: give either minimize", "or terms"))
    terms: tuple[tuple[str, str, tuple[str, ...]], ...] = (
        ("norm", '{minimize="energy", norm="l2"}', ("norm: energy takes no norm", "leave it out")),
        ("time-norm", '{minimize="time", norm="l1"}', ("norm: time takes no norm", "leave it out")),
        ("no-norm", '{minimize="power"}', ("norm: is missing", "l1, l2, linf")),
        ("weight", '{minimize="energy", weight=0}', ("weight: must be > 0",)),
        ("key", '{minimize="energy", wieght=1}', ("wieght: unknown key", "did you mean 'weight'")),
        ("quantity", '{minimize="torqe", norm="l2"}', ("minimize: unknown 'torqe'",)),
    )
    for name, term, (first, *rest) in terms:
        where = "objective.terms[1]."
        other = '{minimize="jerk", norm="l2"}'
        yield _set(f"term-{name}", f"objective.terms=[{other}, {term}]", words=(where + first, *rest))


def _motor() -> Iterator[Bad]:
    for key in ("torque_constant", "resistance"):
        text = "\n".join(line for line in MOTOR.splitlines() if not line.startswith(key))
        words = (f"load.{key}: is missing", "needs it", f"write {key} =")
        yield Bad(f"motor-without-{key}", words, text)
    no_motor = MOTOR[: MOTOR.index("torque_constant")] + '[objective]\nminimize="jerk"\nnorm="l2"\n'
    for key, value in (
        ("limits.current", "1 A"), ("limits.voltage", "10 V"), ("limits.brake_energy", "1 J"),
        ("load.eddy", "1 ohm s^2"), ("load.switching", "4 W/A"), ("load.recovery", "0.5"),
        ("load.hysteresis_exponent", "1.5"), ("load.resistance", "3 ohm"), ("objective.minimize", "current"),
    ):  # fmt: skip
        words = ("load.torque_constant: is missing", "needs it", 'write torque_constant = "0.57 N m/A"')
        yield _set(f"no-motor-{key}", f"{key}={value}", words=words, text=no_motor)
    yield _set("envelope-without-mass", 'limits.envelope={speed=["0 m/s","1 m/s"], force=["9 N","8 N"]}',
               words=("load.mass: is missing", "limits.envelope needs it"), text=_without("load"))  # fmt: skip
    twice = 'load={force_constant="40 N/A", torque_constant="40 N/A", resistance="1 ohm", mass="1 kg"}'
    yield _set("both-constants", twice, words=("load.force_constant: give force_constant or torque_constant",))
    twice = 'limits={rms_force="1 N", rms_torque="1 N"}'
    yield _set("both-rms", twice, words=("limits.rms_torque: give rms_torque or rms_force",))
    for value in ("1", "1.0", "2.001", "-1.5", "nan"):
        words = ("load.hysteresis_exponent: must be above 1 and at most 2", f"got {value}"[:5])
        yield _set(f"exponent-{value}", f"load.hysteresis_exponent={value}", words=words, text=MOTOR)
    for value in ("-0.1", "1.1", "inf"):
        yield _set(f"recovery-{value}", f"load.recovery={value}", words=("load.recovery: must be 0 to 1",), text=MOTOR)
    for key in ("recovery", "hysteresis_exponent"):
        for value in ('"50 %"', "true", "[1]"):
            words = (f"load.{key}: must be a plain number",)
            yield _set(f"{key}-{value}", f"load.{key}={value}", words=words, text=MOTOR)
    yield _set("dwell-negative", "move.dwell=-1 s", words=("move.dwell: must be 0 or more",), text=MOTOR)
    yield _set("dwell-metres", "move.dwell=1 m", words=("move.dwell", "a time is needed"), text=MOTOR)
    yield _set("dwell-elsewhere", "limits.dwell=1 s", words=("limits.dwell: unknown key", "[move]"), text=MOTOR)
    yield _set("envelope-elsewhere", "load.envelope={}", words=("load.envelope: unknown key", "[limits]"), text=MOTOR)
    for name, unit in (("rms_torque", "N m"), ("brake_energy", "J")):
        for value, words in (
            (f"0 {unit}", ("must be > 0",)), (f"-1 {unit}", ("must be > 0",)), ("1 kg", ("is needed",)),
            ("3", ("no unit",)), (f'["1 {unit}", "2 {unit}"]', ("is not a",)), ("{}", ("is not a",)),
        ):  # fmt: skip
            yield _set(f"{name}-{value}", f"limits.{name}={value}", words=(f"limits.{name}", *words), text=MOTOR)
    for name, speed, torque, words in (
        ("rises", '"0 rpm", "99 rpm"', '"1 N m", "2 N m"', ("must not increase with the speed",)),
        ("bends", '"0 rpm", "50 rpm", "99 rpm"', '"2 N m", "0.5 N m", "0.4 N m"', ("bends inwards",)),
        ("moving", '"1 rpm", "99 rpm"', '"2 N m", "1 N m"', ("must start at standstill",)),
        ("back", '"0 rpm", "99 rpm", "50 rpm"', '"2 N m", "1 N m", "1 N m"', ("speed: must increase",)),
        ("powerless", '"0 rpm", "99 rpm"', '"0 N m", "0 N m"', ("must be > 0 at standstill",)),
        ("negative", '"0 rpm", "99 rpm"', '"1 N m", "-1 N m"', ("nowhere negative",)),
        ("short", '"0 rpm", "99 rpm"', '"1 N m"', ("as many torques as speeds", "2 speeds, 1 torques")),
        ("single", '"0 rpm"', '"1 N m"', ("at least two",)),
        ("units", '"0 V", "99 V"', '"1 N m", "1 N m"', ("a velocity is needed",)),
        ("bare", "0, 99", '"1 N m", "1 N m"', ("no unit",)),
    ):
        value = f"limits.envelope={{speed=[{speed}], torque=[{torque}]}}"
        yield _set(f"envelope-{name}", value, words=("limits.envelope", *words), text=MOTOR)
    for name, value, words in (
        ("number", "3", ("must be {",)), ("empty", "{}", ("speed: is missing",)),
        ("no-torque", '{speed=["0 rpm", "1 rpm"]}', ("torque: is missing",)),
        ("key", '{speeds=["0 rpm"]}', ("unknown key 'speeds'", "did you mean 'speed'")),
    ):  # fmt: skip
        yield _set(f"envelope-{name}", f"limits.envelope={value}", words=("limits.envelope", *words), text=MOTOR)


def _weak_motor() -> Iterator[Bad]:
    """A motor that cannot do what is asked, by numbers: friction 0.02 N m and 2e-4 N m s, mean speed 12.5 rad/s."""
    yield _set("stiction", "limits.current=35 mA", words=("limits.current", "0.01995 N m", "cannot move"), text=MOTOR)
    yield _set("stiction-back", 'limits.current=["-35 mA","9 A"]', "move.end.position=-5 rad",
               'limits.velocity=["-100 rad/s","0 rad/s"]', words=("limits.current", "cannot move"),
               text=MOTOR)  # fmt: skip
    yield _set("stiction-voltage", "limits.voltage=0.1 V", words=("limits.voltage", "cannot move the load"), text=MOTOR)
    weak = 'limits.envelope={speed=["0 rad/s","99 rad/s"], torque=["0.019 N m","0.01 N m"]}'
    yield _set("stiction-envelope", weak, words=("limits.envelope", "cannot move the load"), text=MOTOR)
    words: tuple[str, ...] = ("limits.voltage: is too low for the mean speed of the move, 12.5 rad/s", "7.24342 V")
    yield _set("voltage", "limits.voltage=7.2 V", words=words, text=MOTOR)
    words = ("limits.voltage: is too low for the mean speed of the move, 6.25 rad/s",)
    longest = 'move.time=["0.4 s","0.8 s"]'
    yield _set("voltage-longest", "limits.voltage=3.6 V", longest, words=words, text=MOTOR)
    fast = ("move.start.velocity=30 rad/s", "move.end.velocity=30 rad/s", 'limits.velocity=["20 rad/s","100 rad/s"]',
            "move.end.position=15 rad", "move.time=0.5 s")  # fmt: skip
    words = ("limits.voltage: is too low for the least speed of limits.velocity, 20 rad/s",)
    yield _set("voltage-least-speed", "limits.voltage=11 V", *fast, words=words, text=MOTOR)
    slow = 'limits.envelope={speed=["0 rad/s","12 rad/s"], torque=["1 N m","1 N m"]}'
    words = ("limits.envelope: ends at 12 rad/s, below the mean speed of the move, 12.5 rad/s",)
    yield _set("envelope-ends", slow, words=words, text=MOTOR)
    falling = 'limits.envelope={speed=["0 rad/s","13 rad/s"], torque=["0.5 N m","0 N m"]}'
    words = ("limits.envelope: leaves 0.0192308 N m at the mean speed", "friction takes 0.0225 N m")
    yield _set("envelope-falls", falling, words=words, text=MOTOR)
    beyond = 'limits.envelope={speed=["0 rad/s","20 rad/s"], torque=["0.5 N m","0.5 N m"]}'
    words = ("move.start.velocity: 30 rad/s is beyond limits.envelope", "20 rad/s")
    yield _set("envelope-start", beyond, "move.start.velocity=30 rad/s", words=words, text=MOTOR)
    words = ("limits.current: gives the motor at most 89.3288 rad/s^2", "move.time is 0.4 s")
    yield _set("slow", "limits.current=0.1 A", words=words, text=MOTOR)


def _contradictions() -> Iterator[Bad]:
    free = ("move.time=free", "objective.minimize=time")
    table = 'limits.velocity={time=["0 s","1 s"], value=["1 m/s","2 m/s"]}'
    via = 'move.via=[{time="0.5 s", position="0.1 m"}]'
    yield _set("fixed-but-minimized", "objective.minimize=time", words=("objective.minimize: time is fixed", '"free"'))
    yield _set("free-without-time", "move.time=free", words=('move.time: "free" needs a time term',))
    yield _set("free-and-table", *free, table, words=("move.time", "fixed move.time"))
    yield _set("free-and-via", *free, via, words=("move.time", "via states need a fixed"))
    yield _set("range-and-via", 'move.time=["1 s","2 s"]', via, words=("move.time", "via states need a fixed"))
    mass = 'load={mass={time=["0 s","1 s"], value=["1 kg","2 kg"]}}'
    yield _set("free-and-changing-mass", *free, mass, words=("move.time", "inertia that varies"))
    yield from _vibrations()
    yield _set("one-sided-snap", 'limits.snap=["0 m/s^4","1e4 m/s^4"]', words=("limits.snap: [0, 10000] lets", "grow"))
    down = ('limits={jerk="98 m/s^3", snap=["-1e4 m/s^4","0 m/s^4"]}', "move.end.jerk=2 m/s^3")
    yield _set("snap-of-one-sign", *down, words=("limits.snap: [-10000, 0] lets", "only fall", "from 0 to 2"))
    rub = ("limits.force=5 N", "load.coulomb=6 N")
    yield _set("friction-above-force", *rub, words=("limits.force: 5 N", "load.coulomb = 6 N", "raise it"))
    one = ("limits.torque=0.1 N m", "load.coulomb=0.2 N m", "objective.minimize=energy")
    yield _set("friction-above-torque", *one, words=("limits.torque: 0.1 N m", "load.coulomb = 0.2"), text=ROTARY)
    for name, value in (("falls", '["2 s","1 s"]'), ("equal", '["1 s","1 s"]'), ("zero", '["0 s","1 s"]')):
        yield _set(f"time-range-{name}", f"move.time={value}", words=("move.time: needs 0 < min < max", "got min"))
    yield _set("time-of-three", 'move.time=["1 s","2 s","3 s"]', words=("move.time: needs one time", "3 values"))
    yield _set("time-empty", "move.time=[]", words=("move.time: needs one time", "0 values"))
    no_load = _without("load")
    for name, override in (
        ("energy", "objective.minimize=energy"),
        ("power", "objective.minimize=power"),
        ("force", "objective.minimize=force"),
        ("force-limit", "limits.force=5 N"),
        ("power-limit", "limits.power=5 W"),
    ):
        yield _set(f"{name}-without-mass", override, words=("load.mass: is missing", 'mass = "10 kg"'), text=no_load)
    torque = _without("load", ROTARY)
    yield Bad("energy-without-inertia", ("load.inertia: is missing", "kg m^2"), torque)
    yield _set("mass-and-inertia", 'load={mass="1 kg", inertia="1 kg"}', words=("load.mass: give mass or inertia",))
    yield _set("force-and-torque", 'limits={force="1 N", torque="1 N"}', words=("limits.torque: give torque or force",))
    yield _set("rotary-load", 'load.inertia="4e-4 kg m^2"', words=("move.start.position", "rotary axis", "rad"))
    yield _set("linear-load", 'load.mass="10 kg"', words=("move.end.position", "linear axis", "0.5 m"), text=ROTARY)
    yield _set("degree-sign", 'move.end.position="18 °"', words=("move.end.position", "write deg"), text=ROTARY)
    yield _set("degrees-bare", "move.end.position=18", words=("move.end.position", "no unit", "rad"), text=ROTARY)
    yield _set("superscript", 'limits.acceleration="5 m/s²"', words=("limits.acceleration", "write ^2"))
    yield _set("no-caret", 'limits.acceleration="5 m/s2"', words=("limits.acceleration", "write for example m/s^2"))
    yield _set("newton-metre", 'limits.torque="5 Nm"', words=("limits.torque", "did you mean 'N m'"), text=ROTARY)
    yield _set("seconds", 'move.time="1 sec"', words=("move.time", "did you mean 's'"))
    yield _set("capitals", 'load.mass="10 KG"', words=("load.mass", "did you mean 'kg'"))
    yield _set("minus-sign", 'move.end.position="\u22121 m"', words=("move.end.position", "plain minus sign"))

    yield _set("end-without-position", 'move.end={velocity="1 m/s"}', words=("move.end.position: is missing", '"free"'))
    yield _set("end-empty", "move.end={}", words=("move.end.position: is missing", "write"))
    for name, value, words in (
        ("after", '{time="2 s", position="0.1 m"}', ("move.via[0].time: 2 s must be before move.time = 1 s",)),
        ("at-end", '{time="1 s", position="0.1 m"}', ("move.via[0].time: 1 s must be before move.time",)),
        ("at-zero", '{time="0 s", position="0.1 m"}', ("move.via[0].time: must be > 0",)),
        ("timeless", '{position="0.1 m"}', ("move.via[0].time: is missing", "write")),
        ("empty", '{time="0.5 s"}', ("move.via[0]: gives no state", "write")),
        ("key", '{time="0.5 s", pos="1 m"}', ("move.via[0].pos: unknown key", "did you mean 'position'")),
        ("fast", '{time="0.5 s", velocity="2 m/s"}', ("move.via[0].velocity: 2 m/s is outside limits.velocity",)),
        (
            "back",
            '{time="0.5 s", position="0.1 m"}, {time="0.4 s", position="0.2 m"}',
            ("move.via[1].time: times must increase", "0.5 s and then 0.4 s"),
        ),
    ):
        yield _set(f"via-{name}", f"move.via=[{value}]", words=words)
    yield _set("via-text", 'move.via="0.5 s"', words=("move.via: must be a list of sections",))
    yield _set("via-number", "move.via=[3]", words=("move.via[0]: must be a section",))
    via = 'move.via=[{time="0.3333 s", position="0.1 m"}]'
    yield _set("via-off-step", via, "transcription.scheme=euler", words=("move.via[0].time", "multiple of the euler"))

    for end, sign in (("start", ""), ("end", "-")):
        yield _set(
            f"{end}-too-fast",
            f"move.{end}.velocity={sign}0.6 m/s",
            words=(f"move.{end}.velocity: {sign}0.6 m/s is outside limits.velocity [-0.5, 0.5] m/s", "widen"),
        )
    yield _set("one-ppb-outside", "move.start.velocity=0.500000002 m/s", words=("move.start.velocity: 0.500000002",))
    yield _set("end-outside", 'limits.position=["0 m","0.2 m"]', words=("move.end.position", "[0, 0.2] m"))
    yield _set("start-outside", 'limits.position=["0.1 m","1 m"]', words=("move.start.position", "[0.1, 1] m"))
    yield _set("no-rest", 'limits.velocity=["0.1 m/s","1 m/s"]', words=("move.start.velocity: 0 m/s (the default)",))
    yield _set("no-rest-max", 'limits.velocity={max="-1 m/s"}', words=("move.start.velocity", "at most -1"))
    yield _set("jerk-outside", "move.start.jerk=-100 m/s^3", words=("move.start.jerk", "limits.jerk [-98, 98]"))
    yield _set("acceleration-outside", "move.end.acceleration=5 m/s^2", words=("move.end.acceleration", "[-4.9, 4.9]"))
    at_start = 'limits.velocity={time=["0 s","1 s"], value=["0.1 m/s","2 m/s"]}'
    yield _set("table-outside", at_start, "move.start.velocity=0.2 m/s", words=("move.start.velocity", "[-0.1, 0.1]"))
    for end, v, a, side in (
        ("start", "0.49", "4.9", "max 0.5"),
        ("start", "-0.49", "-4.9", "min -0.5"),
        ("end", "0.49", "-4.9", "max 0.5"),
        ("end", "-0.49", "4.9", "min -0.5"),
    ):
        yield _set(
            f"doomed-{end}-{v}",
            f"move.{end}.velocity={v} m/s",
            f"move.{end}.acceleration={a} m/s^2",
            words=(f"move.{end}.velocity", side, "needs jmax >= a0^2", "= 1200.5 m/s^3", "limits.jerk allows 98 m/s^3"),
        )
    stop = ("limits.position=0.3 m", "move.end.velocity=0.49 m/s", "limits.acceleration=0.5 m/s^2")
    yield _set(
        "doomed-position",
        "move.start.position=-0.2 m",
        "move.start.velocity=-0.49 m/s",
        *stop,
        words=("move.start.position", "must leave limits.position (min -0.3 m)", "needs amax >= v0^2"),
    )
    yield _set(
        "doomed-at-limit",
        "move.start.velocity=0.5 m/s",
        "move.start.acceleration=1 m/s^2",
        words=("move.start.velocity", "no jerk limit is enough"),
    )

    for name, value, words in (
        ("both", '{value=["1 m/s","2 m/s"], time=["0 s","1 s"], max="3 m/s"}', ("give either value",)),
        ("scalar", '{value="1 m/s", time=["0 s","1 s"]}', ("value: must be a list such as",)),
        ("time-scalar", '{value=["1 m/s","2 m/s"], time="1 s"}', ("time: must be a list such as",)),
        ("times-bare", '{value=["1 m/s","2 m/s"], time=[0, 1]}', ("0 has no unit",)),
        ("one", '{value=["1 m/s"], time=["0 s"]}', ("at least two",)),
        ("repeated", '{value=["1 m/s","2 m/s"], time=["0 s","0 s"]}', ("time: must increase",)),
        ("negative", '{value=["1 m/s","-2 m/s"], time=["0 s","1 s"]}', ("min must be below max at all times",)),
        ("crossing", '{min={value=["0 m/s","3 m/s"], time=["0 s","1 s"]}, max="2 m/s"}', ("min must be below max",)),
        ("nested-key", '{min={valeu=["0 m/s"]}}', ("unknown key 'valeu'", "did you mean 'value'")),
        ("nested-empty", "{min={}}", ("time: is missing",)),
        ("nan", '{value=["1 m/s","nan m/s"], time=["0 s","1 s"]}', ("not finite",)),
        ("deep", '{max={value=[["1 m/s"]], time=[["0 s"]]}}', ("is not a time",)),
    ):
        yield _set(f"table-{name}", f"limits.velocity={value}", words=("limits.velocity", *words))
    for name, value, words in (
        ("zero", '{value=["1 kg","0 kg"], time=["0 s","1 s"]}', ("must be > 0",)),
        ("key", '{values=["1 kg","2 kg"], time=["0 s","1 s"]}', ("unknown key 'values'", "'value'")),
        ("short", '{value=["1 kg","2 kg"], time=["0 s"]}', ("as many values as times",)),
        ("number", "{value=3, time=4}", ("must be a list",)),
        ("bare", '{value=[1, 2], time=["0 s", "1 s"]}', ("1 has no unit",)),
        ("valueless", '{time=["0 s", "1 s"]}', ("value: is missing",)),
    ):
        yield _set(f"mass-table-{name}", f"load.mass={value}", words=("load.mass", *words))
    long = ",".join(['"1 s"'] * 10_001)
    yield _set("table-long", f'limits.velocity={{value=["1 m/s"], time=[{long}]}}', words=("limits.velocity", "10000"))


def _overrides() -> Iterator[Bad]:
    for override in ("move.time", "", "=1 s", "move..time=1 s", ".=3", f"{'a.' * 70}b=1"):
        yield _set(f"set-{override[:12]}", override, words=("--set", "write key=value"))
    yield _set("set-through-limit", "limits.velocity.max=1 m/s", words=("--set limits.velocity.max", "not a section"))
    yield _set("set-unquoted-list", "limits.velocity=[0 m/s, 1 m/s]", words=("--set limits.velocity", "quote it"))
    yield _set("set-unquoted-table", "limits.velocity={max=1 m/s}", words=("--set limits.velocity", "quote it"))
    yield _set("set-nothing", "move.time=", words=("move.time", "'' is not a number and a unit"))
    yield _set("set-long-number", f"move.time={'1' * 5000}", words=("--set move.time", "more than 400"))
    yield _set("set-brackets", f"move.time={'[' * 100_000}", words=("--set move.time", "nested deeper than 64"))
    yield _set("set-dots", f"move.time={'a.' * 20_000}b", words=("--set move.time", "more than 64 parts"))
    yield _set("set-nul", "move.time=1\0 s", words=("--set move.time", "NUL"))
    yield _set("set-escape-codes", "\x1b[31mred=1", words=("unknown key",))
    yield _set("set-lines", 'move.time="1 s"\n[load]\nmass=3', words=("move.time",))
    yield _set("set-twice", "move.time=1 s", "move.time=-1 s", words=("move.time: must be > 0", "'-1 s'"))


def _texts() -> Iterator[Bad]:
    toml = "not a TOML file"
    for name, text, words in (
        ("empty", "", ("move: is missing", "write [move]")),
        ("only-comment", "# nothing\n", ("move: is missing", "write [move]")),
        ("no-move", _without("move"), ("move: is missing", "write [move]", 'time = "1 s"')),
        ("no-objective", _without("objective"), ("objective: is missing", "write [objective]", "minimize")),
        ("empty-move", "[move]\n" + _without("move"), ("move.time: is missing", '"free"')),
        ("no-end", LINEAR.replace("end =", "via = [] #"), ("move.end: is missing", "position =")),
        ("misspelt-move", LINEAR.replace("[move]", "[mov]"), ("mov: unknown key", "did you mean 'move'")),
        ("unquoted", LINEAR.replace('"1 s"', "1 s"), (toml, "line 3", "in quotes")),
        ("half-quoted", LINEAR.replace('"1 s"', '"1 s'), (toml, "line 3", "in quotes")),
        ("no-value", LINEAR.replace('"1 s"', ""), (toml, "line 3", "write keys as")),
        ("words", "move the axis by 0.25 m in 1 s", (toml, "write keys as")),
        ("json", '{"move": {"time": "1 s"}}', (toml, "write keys as")),
        ("yaml", "move:\n  time: 1 s\n", (toml, "write keys as")),
        ("xml", "<move time='1 s'/>", (toml, "write keys as")),
        ("truncated", LINEAR[: LINEAR.index('"0.25')] + '"0.2', (toml, "write keys as")),
        ("truncated-header", LINEAR + "[transcrip", (toml, "write keys as")),
        ("duplicate-key", LINEAR + 'norm = "l1"\n', (toml, "once")),
        ("duplicate-section", LINEAR + "[move]\n", (toml, "once")),
        ("key-over-section", 'move = "x"\n' + LINEAR, (toml, "once")),
        ("colon", LINEAR.replace("time =", "time:"), (toml, "write keys as")),
        ("bad-escape", LINEAR.replace('"1 s"', '"1\\q s"'), (toml, "write keys as")),
        ("control-character", LINEAR.replace('"1 s"', '"1\x07 s"'), (toml,)),
        ("bare-carriage-return", LINEAR.replace("\n", "\r"), (toml,)),
        ("array-of-moves", LINEAR.replace("[move]", "[[move]]"), ("move: must be a section", "got [")),
        ("long-number", LINEAR + f"weight = {'1' * 5000}\n", ("line 18", "more than 400 digits")),
        ("long-hex", LINEAR + f"weight = 0x{'f' * 5000}\n", ("line 18", "more than 400 digits")),
        ("400-digits", LINEAR + f"weight = {'1' * 400}\n", ("objective.weight: must be > 0 and finite",)),
        ("long-fraction", LINEAR + f"weight = 0.{'1' * 5000}\n", ("line 18", "more than 400 digits")),
        ("brackets", LINEAR + f"weight = {'[' * 100_000}\n", ("line 18", "nested deeper than 64")),
        ("brackets-on-lines", LINEAR + "weight = " + "[\n" * 100_000, ("nested deeper than 64",)),
        ("braces", LINEAR + f"weight = {'{a=' * 100_000}\n", ("line 18", "nested deeper than 64")),
        ("dotted-key", f"{'a.' * 20_000}b = 1\n" + LINEAR, ("line 1", "more than 64 parts")),
        ("dotted-header", f"[{'a.' * 20_000}b]\n", ("line 1", "more than 64 parts")),
        ("quoted-dotted-key", '" ".' * 20_000 + "b = 1\n", ("line 1", "more than 64 parts")),
        ("spaced-dotted-key", f"{'a . ' * 20_000}b = 1\n", ("line 1", "more than 64 parts")),
        ("hidden-dotted-key", 'a = { b = """"x"""", ' + "a." * 20_000 + "b = 1 }\n", ("line 1", "more than 64 parts")),
        ("many-keys", "".join(f"a{i} = 1\n" for i in range(100_001)), ("more than 100000 values",)),
        ("long-key", f"{'a' * 900_000} = 1\n", ("line 1", "more than 400")),
        ("long-quoted-key", f'"{"a" * 900_000}" = 1\n', ("unknown key", "known: move")),
        ("strange-key", '"\\u001b[31m\\n" = 1\n', ("unknown key", "known: move")),
        ("long-text", LINEAR.replace('"1 s"', f'"{"1" * 900_000} s"'), ("move.time", "characters")),
        ("emoji", LINEAR.replace('"1 s"', '"\U0001f600"'), ("move.time", "not a number and a unit")),
        ("mark", "\ufeff" + LINEAR, ("byte order mark", "save it as plain UTF-8")),
        ("nul", LINEAR + "\0", ("NUL", "save it as plain UTF-8")),
    ):
        yield Bad(f"text-{name}", words, text)


CASES: Final = (
    *_by_field(),
    *_by_key(),
    *_transcription(),
    *_objective(),
    *_motor(),
    *_weak_motor(),
    *_contradictions(),
    *_overrides(),
    *_texts(),
)


def _bytes(content: bytes) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(content)


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(2**30)


def _socket(path: Path) -> None:
    here = Path.cwd()
    os.chdir(path.parent)  # a socket's path may be 107 bytes long
    try:
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(path.name)
    finally:
        os.chdir(here)


def _loop(path: Path) -> None:
    path.symlink_to(path.with_name("other"))
    path.with_name("other").symlink_to(path)


_PLAIN: Final = "save it as plain UTF-8"
FILES: Final = (
    BadFile("byte-order-mark", ("byte order mark", _PLAIN), _bytes(b"\xef\xbb\xbf" + LINEAR.encode())),
    BadFile("utf-16", ("byte order mark", _PLAIN), _bytes(LINEAR.encode("utf-16"))),
    BadFile("utf-16-without-mark", ("NUL", _PLAIN), _bytes(LINEAR.encode("utf-16-le"))),
    BadFile("utf-32", (_PLAIN,), _bytes(LINEAR.encode("utf-32"))),
    BadFile("nul", ("NUL", _PLAIN), _bytes(LINEAR.encode() + b"\0")),
    BadFile("latin-1", ("not UTF-8 at byte", _PLAIN), _bytes(b'title = "\xb5m"\n' + LINEAR.encode())),
    BadFile("cut-character", ("not UTF-8 at byte", _PLAIN), _bytes(LINEAR.encode() + b"# \xc2")),
    BadFile("random", (_PLAIN,), _bytes(bytes(range(255, 127, -1)) * 100)),
    BadFile("empty", ("move: is missing", "write [move]"), _bytes(b"")),
    BadFile("executable", (_PLAIN,), _bytes(b"\x7fELF\x02\x01\x01" + bytes(100))),
    BadFile("sparse-gigabyte", ("larger than 1 MB",), _sparse),
    BadFile("over-a-megabyte", ("larger than 1 MB",), _bytes(b"#" * 1_000_001)),
    BadFile("pipe", ("not a regular file", "give a problem file"), os.mkfifo),
    BadFile("endless-device", ("not a regular file", "give a problem file"), lambda path: path.symlink_to("/dev/zero")),
    BadFile("directory", ("not a regular file", "give a problem file"), Path.mkdir),
    BadFile("socket", ("cannot be read", "give a problem file"), _socket),
    BadFile("symlink-loop", ("cannot be read", "symbolic links"), _loop),
    BadFile("dangling-symlink", ("No such file", "give a problem file"), lambda path: path.symlink_to("nowhere.toml")),
    BadFile("missing", ("No such file", "ready-made problem"), lambda path: None),
)
