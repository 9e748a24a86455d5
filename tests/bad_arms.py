"""Bad problems of several axes as data, beside `tests.bad_input`: what is wrong, and what the refusal must contain."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from tests.bad_input import Bad

THROW: Final = """
[move]
time = "1 s"

[[axes]]
name = "shoulder"
move.start = { position = "0 rad", acceleration = "0 rad/s^2" }
move.end = "free"
limits = { position = "180 deg", jerk = "100 rad/s^3" }

[[axes]]
name = "elbow"
move.start = { position = "0 deg", acceleration = "0 rad/s^2" }
move.end = "free"
limits = { position = "179 deg", jerk = "100 rad/s^3" }

[arm]
kind = "scara"
lengths = ["0.4 m", "0.3 m"]
masses = ["4 kg", "2 kg"]
inertias = ["0.06 kg m^2", "0.02 kg m^2"]

[tip]
velocity = ["0 m/s", "12.5 m/s"]

[objective]
minimize = "power"
norm = "linf"
axes = [0.5, 0.5]
"""
GANTRY: Final = """
[move]
time = "free"

[[axes]]
name = "x"
move.end = { position = "0.8 m" }
limits = { velocity = "1.5 m/s", acceleration = "6 m/s^2" }

[[axes]]
name = "turn"
move.end = { position = "90 deg" }
limits = { velocity = "10 rad/s", acceleration = "80 rad/s^2" }

[objective]
minimize = "time"
"""
_LINE: Final = 'line = { start = ["0.5 m", "-0.2 m"], end = ["0.3 m", "0.4 m"], width = "1 mm" }'
_OVERRIDES: Final = (
    ("arm.kind=delta", ("arm.kind: unknown 'delta'", "scara, planar")),
    ("arm.lengths=['0 m', '0.3 m']", ("arm.lengths: link 1: must be > 0, got '0 m'",)),
    ("arm.masses=['4 kg', '0 kg']", ("arm.masses: link 2: must be > 0, got '0 kg'",)),
    ("arm.masses=['4 kg', '-1 kg']", ("arm.masses: link 2: must be > 0",)),
    ("arm.masses=['4 kg']", ("arm.masses: needs a value a link, 2, got 1",)),
    ("arm.masses=['4 m', '1 kg']", ("arm.masses", "mass", "kg")),
    ("arm.lengths=[0.4, 0.3]", ("arm.lengths: 0.4 has no unit",)),
    ("arm.inertias=['0.06 kg', '0.02 kg']", ("arm.inertias", "kg m^2")),
    ("arm.payload=-1 kg", ("arm.payload: must be 0 or more",)),
    ("arm.colour=red", ("arm.colour: unknown key",)),
    ("arm=3", ("arm: must be a section with kind = scara or planar",)),
    ("tip.velocity=['0 m/s']", ("tip.velocity: needs x and y, got 1",)),
    ("tip.velocity=['0 m', '1 m']", ("tip.velocity", "m/s")),
    ("tip.velocity=['0 m/s', '60 m/s']", ("tip.velocity: 60 m/s is beyond 50 m/s", "no motion exceeds", "widen")),
    ("tip.release=1 s", ("tip.release: 1 s must be before move.time = 1 s",)),
    ("tip.release=soon", ("tip.release", 'or "end", or "free"')),
    ("tip.release=-1 s", ("tip.release: must be > 0",)),
    ("objective.axes=[1]", ("objective.axes: needs a weight an axis, 2, got 1",)),
    ("objective.axes=[0, 0]", ("objective.axes: must weigh one axis at least",)),
    ("objective.axes=[-1, 1]", ("objective.axes: must be plain numbers, 0 or more",)),
    ("objective.combine=product", ("objective.combine: unknown 'product'", "sum, max")),
    ("objective.minimize=current", ("objective.minimize: current is not known on an arm",)),
    ("transcription.solver=clarabel", ("transcription.solver: an arm is nonconvex", "ipopt")),
    ("search.starts=0", ("search.starts: must be a whole number, 1 to 1000",)),
    ("move.shared=false", ("move.shared: axes that are coupled",)),
    ("move.time=free", ('move.time: "free" needs a time term',)),
    ("axes=[]", ("axes: needs 1 to 12 axes, got 0",)),
    ("axes=3", ("axes: the axes must be a list",)),
    ("limits={jerk='1 rad/s^3'}", ("limits: belongs to each of the axes",)),
)
_REPLACED: Final = (
    ("degrees", '"0 rad", acc', '"90", acc', ("axes[0].move.start.position", "'90'")),
    ("no-unit", 'position = "0 rad", acc', "position = 90, acc", ("axes[0].move.start.position: 90 has no unit",)),
    ("metres", '"180 deg"', '"180 mm"', ("axes[0].limits.position", "rad")),
    ("snap", '"179 deg"', '"179 deg", snap = "1e4 rad/s^4"', ("axes: coupled ones need one top", "elbow snap")),
    ("names", '"elbow"', '"shoulder"', ("axes: two have one name",)),
    ("end", 'move.end = "free"\nlimits = { position = "179', 'limits = { position = "179',
     ("axes[1].move.end: is missing",)),
    ("outside", '"0 deg"', '"200 deg"', ("axes[1].move.start.position: 3.49065", "outside limits.position")),
    ("load", 'name = "elbow"', 'name = "elbow"\nload = { inertia = "1 kg m^2" }',
     ("axes[1].load.inertia", "is the arm")),
    ("current", "jerk =", 'current = "1 A", jerk =', ("axes[0].limits.current: not known on an arm",)),
    ("one-axis", '[[axes]]\nname = "elbow"', "[extra]", ("extra: unknown key",)),
    ("three", "[arm]", '[[axes]]\nmove.end = "free"\n\n[arm]', ("axes: the arm has 2 joints, got 3 axes",)),
    ("no-arm", THROW[THROW.index("[arm]"): THROW.index("[tip]")], "", ("tip: needs an arm",)),
    ("both", "[tip]", f"[tip]\n{_LINE}", ("tip: give either velocity", "or line")),
)  # fmt: skip
_LINES: Final = (
    ("start", '"-0.2 m"', '"-0.9 m"', ("tip.line: is 1.02956 m from the first", "0.1 to 0.7 m", "move it inside")),
    ("inner", '["0.3 m", "0.4 m"]', '["-0.5 m", "0.2 m"]', ("tip.line: is 0 m", "out of reach: 0.1 to 0.7 m")),
    ("point", '["0.3 m", "0.4 m"]', '["0.5 m", "-0.2 m"]', ("tip.line", "one point")),
    ("width", '"1 mm"', '"0 mm"', ("tip.line.width: must be > 0",)),
)


def _cases() -> Iterator[Bad]:
    for fault, words in _OVERRIDES:
        yield Bad(f"arm-{fault}", words, THROW, (fault,))
    for name, old, new, words in _REPLACED:
        assert old in THROW, name
        yield Bad(f"arm-{name}", words, THROW.replace(old, new))
    line = THROW.replace('velocity = ["0 m/s", "12.5 m/s"]', _LINE)
    for name, old, new, words in _LINES:
        yield Bad(f"line-{name}", words, line.replace(old, new))
    curve = 'curve = { x = ["0.5 m"], y = ["0 m", "9 m"], width = "1 mm" }'
    bent = THROW.replace('velocity = ["0 m/s", "12.5 m/s"]', curve)
    yield Bad("curve-reach", ("tip.curve: is 9.01388 m from the first joint at 1 of its way",), bent)
    yield Bad("curve-still", ("tip.curve: x and y do not depend on s",), bent.replace('"0 m", "9 m"', '"0 m"'))
    yield Bad("curve-empty", ("tip.curve.x: needs 1 to 16 coefficients",), bent.replace('["0.5 m"]', "[]"))
    stretched = THROW.replace('move.end = "free"', 'move.end = { position = "0 rad", velocity = "free" }')
    singular = ("tip.velocity: the arm is singular in the end pose (0, 0) rad", "bend it")
    yield Bad("arm-singular", singular, stretched, ("tip.velocity=['12.5 m/s', '0 m/s']",))
    yield Bad("gantry-time", ("objective.axes: time is shared",), GANTRY, ("objective.axes=[1, 2]",))
    unlimited = GANTRY.replace('limits = { velocity = "1.5 m/s", acceleration = "6 m/s^2" }', "")
    yield Bad("gantry-limits", ("axes[0].limits: nothing bounds the move",), unlimited)


CASES: Final = tuple(_cases())
