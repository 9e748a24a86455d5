"""Units: every name and prefix, products and powers, and refusals that say what would do."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trajopt import units
from trajopt.units import UnitError

SI = {  # value of one unit in SI, and its powers of m, kg, s, rad, A
    "1": (1.0, (0, 0, 0, 0, 0)),
    "m": (1.0, (1, 0, 0, 0, 0)),
    "in": (0.0254, (1, 0, 0, 0, 0)),
    "g": (0.001, (0, 1, 0, 0, 0)),
    "kg": (1.0, (0, 1, 0, 0, 0)),
    "t": (1000.0, (0, 1, 0, 0, 0)),
    "s": (1.0, (0, 0, 1, 0, 0)),
    "min": (60.0, (0, 0, 1, 0, 0)),
    "h": (3600.0, (0, 0, 1, 0, 0)),
    "Hz": (1.0, (0, 0, -1, 0, 0)),
    "rad": (1.0, (0, 0, 0, 1, 0)),
    "deg": (math.pi / 180, (0, 0, 0, 1, 0)),
    "rev": (2 * math.pi, (0, 0, 0, 1, 0)),
    "rpm": (math.pi / 30, (0, 0, -1, 1, 0)),
    "N": (1.0, (1, 1, -2, 0, 0)),
    "J": (1.0, (2, 1, -2, 0, 0)),
    "W": (1.0, (2, 1, -3, 0, 0)),
    "A": (1.0, (0, 0, 0, 0, 1)),
    "V": (1.0, (2, 1, -3, 0, -1)),
    "ohm": (1.0, (2, 1, -3, 0, -2)),
}
PREFIXES = {"n": 1e-9, "u": 1e-6, "\u00b5": 1e-6, "\u03bc": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6}


@pytest.mark.parametrize("name", SI)
def test_every_unit(name: str) -> None:
    value, dimension, written = units.parse(f"2.5 {name}")
    assert value == pytest.approx(2.5 * SI[name][0], rel=1e-15)
    assert (dimension, written) == (SI[name][1], name)


@pytest.mark.parametrize("prefix", PREFIXES)
@pytest.mark.parametrize("name", ["m", "g", "s", "Hz", "rad", "N", "J", "W", "A", "V", "ohm"])
def test_every_prefix(prefix: str, name: str) -> None:
    value, dimension, _ = units.parse(f"2 {prefix}{name}")
    assert value == pytest.approx(2 * PREFIXES[prefix] * SI[name][0], rel=1e-15)
    assert dimension == SI[name][1]


def test_the_table_holds_nothing_else() -> None:
    assert len(units.UNITS) == len(SI) - 1 + 11 * len(PREFIXES)  # kg is k + g
    for text in ("1 min", "1 h", "1 t", "1 in"):  # a unit's own name comes before a prefix
        assert units.parse(text)[0] == SI[text[2:]][0]


@pytest.mark.parametrize(
    ("text", "value", "dimension"),
    [
        ("1 m/s", 1, (1, 0, -1, 0, 0)),
        ("1 m/s^2", 1, (1, 0, -2, 0, 0)),
        ("1 m/s/s", 1, (1, 0, -2, 0, 0)),
        ("1 m s^-2", 1, (1, 0, -2, 0, 0)),
        ("1 mm/ms", 1, (1, 0, -1, 0, 0)),
        ("1 km/h", 1 / 3.6, (1, 0, -1, 0, 0)),
        ("1 N m", 1, (2, 1, -2, 0, 0)),
        ("1 N*m", 1, (2, 1, -2, 0, 0)),
        ("1 N \u00b7 m", 1, (2, 1, -2, 0, 0)),
        ("1 mN m", 1e-3, (2, 1, -2, 0, 0)),
        ("1 N m s/rad", 1, (2, 1, -1, -1, 0)),
        ("1 kg m^2", 1, (2, 1, 0, 0, 0)),
        ("1 g cm^2", 1e-7, (2, 1, 0, 0, 0)),
        ("1 m/s m", 1, (2, 0, -1, 0, 0)),  # / divides by one name
        ("1 1/s", 1, (0, 0, -1, 0, 0)),
        ("1 /s", 1, (0, 0, -1, 0, 0)),
        ("1/s", 1, (0, 0, -1, 0, 0)),
        ("1 m^0", 1, (0, 0, 0, 0, 0)),
        ("1 V A", 1, (2, 1, -3, 0, 0)),
        ("1 ohm A^2", 1, (2, 1, -3, 0, 0)),
        ("1 rev/min", math.pi / 30, (0, 0, -1, 1, 0)),
    ],
)
def test_products_and_powers(text: str, value: float, dimension: tuple[int, ...]) -> None:
    assert units.parse(text)[0] == pytest.approx(value, rel=1e-15)
    assert units.parse(text)[1] == dimension


@pytest.mark.parametrize("number", ["1", "+1", "-1.", ".5", "0.5", "1E3", "-1.5e+03", "-0.0", "007", "0e999", "1e-30"])
def test_numbers(number: str) -> None:
    for text in (f"{number} m", f"{number}m", f" \t{number}  m\n"):
        assert units.parse(text)[0] == float(number)


def test_angles() -> None:
    assert units.parse("18 deg")[0] == pytest.approx(units.parse("0.31415926535897932 rad")[0], rel=1e-15)
    assert units.to_si("18 deg", "position", rotary=True) == pytest.approx(math.pi / 10, rel=1e-15)
    assert units.to_si("60 rpm", "velocity", rotary=True) == pytest.approx(2 * math.pi, rel=1e-15)
    assert units.to_si("60 rpm", "velocity", rotary=True) == units.to_si("1 rev/s", "velocity", rotary=True)


@pytest.mark.parametrize("rotary", [False, True])
def test_every_kind_takes_its_example(rotary: bool) -> None:
    for name, kind in units.kinds(rotary).items():
        assert units.to_si(kind.example, name, rotary) == float(kind.example.split()[0])
        assert units.to_si(f"1 {kind.unit}", name, rotary) == 1.0


@pytest.mark.parametrize(("text", "kind"), [("1 N m", "force"), ("1 N m/rad", "force"), ("1 N m rad/s", "power")])
def test_a_radian_is_a_pure_number_in_torque_and_power(text: str, kind: str) -> None:
    assert units.to_si(text, kind, rotary=True) == 1.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is not a number and a unit"),
        ("m", "is not a number and a unit"),
        ("5", "'5' has no unit"),
        ("5 ", "has no unit"),
        ("1 m/", "is not a unit; write for example m/s^2"),
        ("1 /", "is not a unit"),
        ("1 m//s", "is not a unit"),
        ("1 m*", "is not a unit"),
        ("1 *m", "is not a unit"),
        ("1 m**2", "is not a unit"),
        ("1 m2", "is not a unit; write for example m/s^2"),
        ("1 m^", "is not a unit"),
        ("1 m^22", "is not a unit"),
        ("1 m^1.5", "is not a unit"),
        ("1 (m/s)", "is not a unit"),
        ("1 m; rm -rf", "is not a unit"),
        ("1 m # comment", "is not a unit"),
        ("9**9**9 mm", "'**9**9 mm' is not a unit"),
        ("__import__('os')", "is not a number and a unit"),
        ("0x10 m", "is not a unit"),
        ("1_000 m", "is not a number and a unit"),
        ("1.5.2 m", "is not a number and a unit"),
        ("1,5 m", "write a decimal point"),
        ("1.000,5 m", "write a decimal point"),
        ("\uff11 m", "is not a number and a unit"),
        ("\u0661 m", "is not a number and a unit"),
        ("1 m^\u0662", "is not a unit"),
        ("\u22121 m", "plain minus sign"),
        ("18 \u00b0", "write deg"),
        ("1 m/s\u00b2", "write ^2"),
        ("1 m/s\u00b3", "write ^3"),
        ("1 \u03a9", "write ohm"),
        ("1 \u2126", "write ohm"),
        ("nan m", "not finite"),
        ("-Infinity m", "leave the key out where there is no limit"),
        ("1e400 m", "out of range (1e-30 to 1e30 in SI)"),
        ("1e4000 m", "out of range"),
        ("1e308 km", "out of range"),
        ("1e-400 m", "out of range"),
        ("1e-25 nm", "out of range"),
        ("1 km^9 km^9 km^9 km^9 km^9 km^9 km^9 km^9 km^9 km^9 km^9 km^9 km^9", "out of range"),
        ("1 nm^9 nm^9 nm^9 nm^9 nm^9 nm^9", "out of range"),
        ("1 Nm", "did you mean 'N m'"),
        ("1 Ns/m", "did you mean 'N s'"),
        ("1 sec", "did you mean 's'"),
        ("1 KG", "did you mean 'kg'"),
        ("1 hz", "did you mean 'Hz'"),
        ("1 RPM", "did you mean 'rpm'"),
        ("1 degrees", "did you mean 'deg'"),
        ("1 furlong", "unknown unit 'furlong'"),
        ("1" * 101, "a text of 101 characters"),
    ],
)
def test_refusals(text: str, words: str) -> None:
    with pytest.raises(UnitError) as caught:
        units.parse(text)
    assert words in str(caught.value)
    with pytest.raises(UnitError, match="a velocity is needed, for example '0.5 m/s'"):
        units.to_si(text, "velocity")


@pytest.mark.parametrize(
    ("text", "kind", "rotary", "message"),
    [
        ("5 kg", "velocity", False, "'5 kg' is in kg; a velocity is needed, for example '0.5 m/s'"),
        ("5 m", "acceleration", False, "'5 m' is in m; an acceleration is needed, for example '0.5 m/s^2'"),
        ("5 1/s", "velocity", True, "'5 1/s' is in 1/s; a velocity is needed, for example '0.5 rad/s'"),
    ],
)
def test_wrong_dimension(text: str, kind: str, rotary: bool, message: str) -> None:
    with pytest.raises(UnitError) as caught:
        units.to_si(text, kind, rotary)
    assert str(caught.value) == message


@pytest.mark.parametrize(("text", "rotary", "axis"), [("1 deg/s", False, "linear"), ("1 m/s", True, "rotary")])
def test_the_other_kind_of_axis_is_pointed_out(text: str, rotary: bool, axis: str) -> None:
    with pytest.raises(UnitError, match=f"the load, or else the end position, makes this a {axis} axis"):
        units.to_si(text, "velocity", rotary)


@pytest.mark.parametrize("value", ["x" * 1000, 10**5000, [1] * 1000, {"a": "b" * 1000}], ids=type)
def test_values_are_shown_short(value: object) -> None:
    assert len(units.shown(value)) <= 60


ALPHABET = st.sampled_from("0123456789+-.eE _,;()^*/·mskgNradWHzohminVACJtu\u00b5\u0661²°\n\0 '\"")


@settings(max_examples=500, deadline=None, derandomize=True)
@given(st.text(max_size=120) | st.text(ALPHABET, max_size=40))
def test_any_text_is_a_quantity_or_a_unit_error(text: str) -> None:
    try:
        value, _, _ = units.parse(text)
    except UnitError as error:
        assert len(str(error)) <= 300
    else:
        assert value == 0 or 1e-30 <= abs(value) <= 1e30


@given(st.floats(-1e20, 1e20).filter(lambda x: x == 0 or abs(x) > 1e-20), st.sampled_from(sorted(SI)))
def test_printed_numbers_are_read_back(number: float, name: str) -> None:
    assert units.parse(f"{number!r} {name}")[0] == number * units.UNITS[name][0]
