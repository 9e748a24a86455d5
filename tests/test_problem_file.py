"""Problem files: what is legal is read, what is not is refused in one line that names the field and the remedy."""

from __future__ import annotations

import datetime
import re
import string
import tomllib
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import bad_arms, bad_mechanisms, bad_plants
from tests.bad_input import CASES, FILES, LINEAR, ROTARY, Bad, BadFile
from trajopt import preflight, problem_file
from trajopt.errors import BadInput
from trajopt.problem import Limit, Problem, Table

JARGON = re.compile(r"Input should|Value error|_error|_type|pydantic|Traceback|recursion|object at 0x|\bnp\.")
ALL = (*CASES, *bad_plants.CASES, *bad_mechanisms.CASES, *bad_arms.CASES)
ALL_FILES = (*FILES, *bad_mechanisms.FILES)
READY_MADE = sorted(entry.name[:-5] for entry in files("problems").iterdir() if entry.name.endswith(".toml"))


def refusal(read: Callable[[], object]) -> str:
    """The message with which ``read`` refuses, checked to be one printable line for engineers."""
    with pytest.raises(BadInput) as caught:
        read()
    check(caught.value)
    assert not JARGON.search(str(caught.value))
    return str(caught.value)


def check(error: BadInput) -> None:
    assert error.exit_code == 2
    assert str(error).isprintable()
    assert len(str(error)) <= 500


@pytest.mark.parametrize("bad", ALL, ids=[bad.name for bad in ALL])
def test_bad_input_is_refused_in_one_line(bad: Bad) -> None:
    message = refusal(lambda: problem_file.parse(bad.text, bad.overrides))
    assert [word for word in bad.words if word not in message] == [], message


@pytest.mark.parametrize("bad", ALL_FILES, ids=[bad.name for bad in ALL_FILES])
def test_bad_file_is_refused_in_one_line(bad: BadFile, tmp_path: Path) -> None:
    path = tmp_path / "move.toml"
    bad.make(path)
    message = refusal(lambda: problem_file.load(path))
    assert [word for word in ("move.toml", *bad.words) if word not in message] == [], message


def test_corpus_is_large() -> None:
    names = [bad.name for bad in ALL] + [bad.name for bad in FILES]
    assert len(names) == len(set(names)) >= 220


def test_misspelt_ready_made_problem_is_named() -> None:
    message = refusal(lambda: problem_file.load(READY_MADE[0].replace("a", "e", 1)))
    assert f"did you mean '{READY_MADE[0]}'" in message


@pytest.mark.parametrize("name", READY_MADE)
def test_ready_made_problems_load_without_warning(name: str) -> None:
    assert preflight.warnings(problem_file.load(name)) == []


@pytest.mark.parametrize("name", ["a\0b.toml", "x" * 5000, "", "line\nbreak.toml", "no/such/move.toml"])
def test_strange_paths_are_refused(name: str) -> None:
    refusal(lambda: problem_file.load(name))


def test_crlf_is_legal(tmp_path: Path) -> None:
    path = tmp_path / "move.toml"
    path.write_bytes(LINEAR.replace("\n", "\r\n").encode())
    assert problem_file.load(path) == problem_file.parse(LINEAR)


def test_long_comments_and_texts_are_legal() -> None:
    title = "a.b" * 200 + "[" * 100 + "1" * 1000
    text = f"# {'.' * 1000} {'[' * 1000}\ntitle = \"{title}\"\nmoral = '''{title}'''\n"
    assert problem_file.parse(text + LINEAR).moral == title


def test_numbers_arrive_in_si() -> None:
    problem = problem_file.parse(ROTARY, ["limits.velocity=60 rpm", 'move.time=["500 ms","1 min"]'])
    assert problem.rotary
    assert problem.move.end.position == pytest.approx(1.5707963267948966, rel=1e-15)
    assert problem.limits.velocity == Limit(min=-6.283185307179586, max=6.283185307179586)
    assert problem.limits.force == Limit(min=-2.0, max=2.0)
    assert problem.move.time == (0.5, 60.0)


def test_without_a_load_the_end_position_tells_the_kind_of_axis() -> None:
    text = '[move]\ntime = "1 s"\nend = { position = "90 deg" }\n[objective]\nminimize = "jerk"\nnorm = "l2"\n'
    assert problem_file.parse(text).rotary
    assert not problem_file.parse(text.replace("90 deg", "90 mm")).rotary


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("move.time=free", "objective.minimize=time"),
        ('move.time=["1 s","2 s"]', "objective.weight=2"),
        ('move.via=[{time="0.5 s", position="free", velocity="0 m/s"}]', "move.start.position=free"),
        ('limits.velocity={time=["0 s","1 s"], value=["1 m/s","2 m/s"]}',),
        ('limits.velocity={min={time=["0 s","1 s"], value=["-1 m/s","0 m/s"]}, max="0.5 m/s"}',),
        ('limits.velocity={min=["-1 m/s","0 m/s"], max=["1 m/s","2 m/s"], time=["0 s","1 s"]}',),
        ('limits.acceleration={max="1 m/s^2"}', "move.end.acceleration=free"),
        ('load.mass={time=["0 s","1 s"], value=["1 kg","2 kg"]}', "load.coulomb=1 N", "load.viscous=1 N s/m"),
        ('objective.terms=[{minimize="energy", weight=0.5}, {minimize="power", norm="linf", weight=0.5}]',),
        ('transcription={intervals=50, scheme="euler", solver="osqp"}', "title=a title"),
    ],
    ids=str,
)
def test_canonical_round_trip(overrides: tuple[str, ...]) -> None:
    problem = problem_file.parse(LINEAR, overrides)
    assert Problem.model_validate(problem.canonical()) == problem
    assert problem.replace() == problem


def test_canonical_round_trip_of_a_rotary_axis() -> None:
    problem = problem_file.parse(ROTARY, ["load.viscous=1e-4 N m s/rad", "move.time=free", "objective.minimize=time"])
    assert Problem.model_validate(problem.canonical()) == problem


def test_every_ready_made_problem_survives_the_round_trip() -> None:
    for name in READY_MADE:
        problem = problem_file.load(name)
        assert type(problem).model_validate(problem.canonical()) == problem


# Overrides


@pytest.mark.parametrize("value", ["0.3 m", '"0.3 m"', "'0.3 m'", "  300 mm ", "30e1 mm"])
def test_override_with_and_without_quotes(value: str) -> None:
    assert problem_file.parse(LINEAR, [f"move.end.position={value}"]).move.end.position == pytest.approx(0.3, rel=1e-15)


def test_override_with_integers_lists_and_tables() -> None:
    move = 'move.end={position="1 m", velocity="free"}'
    overrides = ["transcription.intervals=50", 'limits.velocity=["0 m/s", "1 m/s"]', move]
    problem = problem_file.parse(LINEAR, overrides)
    assert problem.transcription.intervals == 50
    assert problem.limits.velocity == Limit(min=0.0, max=1.0)
    assert (problem.move.end.position, problem.move.end.velocity) == (1.0, "free")


def test_override_makes_sections_and_the_last_one_counts() -> None:
    problem = problem_file.parse(LINEAR, ["transcription.scheme=euler", "move.time=2 s", " move . time = 3 s"])
    assert (problem.transcription.scheme, problem.move.fixed_time) == ("euler", 3.0)


def labels(text: str, *overrides: str) -> list[str]:
    return [term.label for term in problem_file.parse(text, overrides).objective.terms]


def test_override_replaces_one_form_of_the_objective_by_the_other() -> None:
    terms = 'objective.terms=[{minimize="energy"}, {minimize="power", norm="linf"}]'
    assert labels(LINEAR, terms) == ["energy", "power linf"]
    assert labels(LINEAR, terms, "objective.minimize=jerk", "objective.norm=l1") == ["jerk l1"]
    assert labels(LINEAR, terms, "objective.norm=l1", "objective.minimize=jerk") == ["jerk l1"]
    assert labels(LINEAR, "objective.minimize=energy") == ["energy"]
    assert labels(LINEAR, "objective.minimize=power") == ["power l2"]
    assert labels(LINEAR, "objective={minimize='energy'}") == ["energy"]


def test_override_of_mass_by_inertia_and_of_force_by_torque() -> None:
    problem = problem_file.parse(LINEAR, ["load.inertia=20 kg", "limits.torque=3 N", "limits.force=4 N"])
    assert problem.load.inertia == 20.0
    assert problem.limits.force == Limit(min=-4.0, max=4.0)


# States at, near and beyond their limits


@pytest.mark.parametrize("velocity", ["0.5", "-0.5", "0.5000000004", "-0.5000000004"])
def test_a_state_outside_by_rounding_is_accepted(velocity: str) -> None:
    for end in ("start", "end"):
        problem = problem_file.parse(LINEAR, [f"move.{end}.velocity={velocity} m/s"])
        assert getattr(problem.move, end).velocity == float(velocity)


@pytest.mark.parametrize(
    "overrides",
    [
        ("limits.jerk=1201 m/s^3",),
        ('limits.jerk={min="-1201 m/s^3", max="1 m/s^3"}', "move.end.acceleration=free"),
        ('limits.jerk={max="1 m/s^3"}', "move.end.acceleration=free"),
        ('limits.velocity={min="-0.5 m/s"}',),
        ("move.time=1 ms", "move.end.acceleration=free", "move.end.velocity=free"),
        ("move.time=free", "objective.minimize=time", "move.end.acceleration=4.9 m/s^2", "move.end.velocity=0.5 m/s"),
        ('limits.jerk={time=["0 s","1 s"], value=["98 m/s^3","99 m/s^3"]}',),
    ],
    ids=str,
)
def test_a_state_with_room_to_brake_is_not_doomed(overrides: tuple[str, ...]) -> None:
    doomed = ("move.start.velocity=0.49 m/s", "move.start.acceleration=4.9 m/s^2")
    with pytest.raises(BadInput, match="needs jmax"):
        problem_file.parse(LINEAR, doomed)
    problem_file.parse(LINEAR, (*doomed, *overrides))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(-0.499, 0.499), st.floats(-4.9, 4.9), st.floats(1.0, 1e4), st.sampled_from(["start", "end"]))
def test_doomed_exactly_when_the_formula_says_so(v: float, a: float, jerk: float, end: str) -> None:
    beyond = v + (1 if end == "start" else -1) * a * abs(a) / (2 * jerk)
    overrides = [f"move.{end}.velocity={v} m/s", f"move.{end}.acceleration={a} m/s^2", f"limits.jerk={jerk} m/s^3"]
    overrides += ["move.time=100 s"]
    if abs(a) < 1e-30 or abs(v) < 1e-30 or abs(abs(beyond) - 0.5) < 1e-8:
        return
    try:
        problem_file.parse(LINEAR, overrides)
        assert abs(beyond) < 0.5
    except BadInput as error:
        assert abs(beyond) > 0.5
        needed = float(re.findall(r"= ([0-9.e+]+) m/s\^3, limits.jerk", str(error))[0])
        problem_file.parse(LINEAR, [*overrides[:2], f"limits.jerk={needed * 1.00001} m/s^3", overrides[3]])


# Warnings


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (("limits.velocity=5000 m/s",), ("limits.velocity: 5000 m/s", "20000 times", "mm instead of m")),
        (("limits.acceleration=49000 m/s^2",), ("limits.acceleration", "unit mistake")),
        (("limits.jerk=9.8e6 m/s^3",), ("limits.jerk", "unit mistake")),
        (("limits.jerk=1e-12 m/s^3",), ("limits.jerk: makes the least time 5.6 h", "1 s of move.time")),
        (("limits.jerk=1e-12 m/s^3", "move.time=free", "objective.minimize=time"), ("5.6 h", "by the other limits")),
        (("limits.jerk=2000 m/s^3",), ("transcription.intervals: a step of 0.005 s", "write intervals = 409 or more")),
        (("limits.jerk=9.8e6 m/s^3",), ("transcription.intervals", "leave limits.jerk out")),
    ],
    ids=str,
)
def test_likely_slips_are_warned_of(overrides: tuple[str, ...], words: tuple[str, ...]) -> None:
    found = preflight.warnings(problem_file.parse(LINEAR, overrides))
    assert any(all(word in line for word in words) for line in found), found
    assert all(line.isprintable() and len(line) <= 300 for line in found)


def test_the_suggested_intervals_silence_the_warning() -> None:
    overrides = ["limits.jerk=2000 m/s^3", "transcription.intervals=409"]
    assert preflight.warnings(problem_file.parse(LINEAR, overrides)) == []


@pytest.mark.parametrize("override", ["title=x", "move.end.position=0 m", "move.end.position=free", "move.time=5 s"])
def test_ordinary_problems_are_not_warned_of(override: str) -> None:
    assert preflight.warnings(problem_file.parse(LINEAR, [override])) == []


# Code


@pytest.mark.parametrize(
    "limits",
    [
        {"velocity": Limit(min=1.0, max=0.0)},
        {"velocity": Limit(max=float("nan"))},
        {"velocity": Limit(max=Table(time=(0.0, 1.0), value=(1.0, float("inf"))))},
        {"velocity": 10**400},
        {"velocity": float("inf")},
    ],
    ids=["crossing", "nan", "infinite-table", "huge", "infinite"],
)
def test_bad_limits_in_code_are_refused(limits: dict[str, Any]) -> None:
    problem = problem_file.parse(LINEAR)
    with pytest.raises(ValueError, match="must be"):
        problem.replace(limits=type(problem.limits)(**limits))


# Anything at all

QUANTITIES = st.sampled_from(["1 s", "0.5 m/s", "3 kg", "free", "1 rad", "nan m", "l2", "jerk", "energy", "1 kg m^2"])
SCALARS = st.one_of(
    QUANTITIES,
    st.text(max_size=8),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.none(),
    st.just(datetime.date(1979, 5, 27)),
    st.just(datetime.time(7, 32)),
)
KEYS = st.sampled_from(
    re.findall(
        r"\w+",
        "move time start end via position velocity acceleration jerk limits load mass inertia force torque value min"
        " max objective terms minimize norm weight transcription intervals scheme solver title rotary",
    )
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS | st.text(max_size=4), inner, max_size=4),
    max_leaves=12,
)


@pytest.mark.parametrize("key", ["move.time", "limits.jerk", "load.mass", "objective.norm", "transcription.intervals"])
def test_numbers_too_long_to_print_are_refused(key: str) -> None:
    stated = tomllib.loads(LINEAR)
    section, field = key.split(".")
    stated.setdefault(section, {})[field] = 10**5000
    assert "a number of thousands of digits" in refusal(lambda: problem_file.from_dict(stated))


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.dictionaries(KEYS, VALUES, max_size=6))
def test_any_dictionary_is_read_or_refused(data: dict[str, Any]) -> None:
    try:
        problem_file.from_dict(data)
    except BadInput as error:
        check(error)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.data())
def test_any_value_in_a_good_file_is_read_or_refused(data: st.DataObject) -> None:
    stated: dict[str, Any] = tomllib.loads(LINEAR)
    section = stated[data.draw(st.sampled_from(sorted(stated)))]
    section[data.draw(KEYS)] = data.draw(VALUES)
    try:
        problem = problem_file.from_dict(stated)
        assert Problem.model_validate(problem.canonical()) == problem
    except BadInput as error:
        check(error)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.text(st.sampled_from(string.printable + "é\u2028\0"), max_size=40), st.integers(0, len(LINEAR)))
def test_any_text_is_read_or_refused(extra: str, at: int) -> None:
    for text in (extra, LINEAR[:at] + extra + LINEAR[at:]):
        try:
            problem_file.parse(text)
        except BadInput as error:
            check(error)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.text(max_size=20), st.text(max_size=20))
def test_any_override_is_read_or_refused(key: str, value: str) -> None:
    for override in (f"{key}={value}", f"move.time={value}", key):
        try:
            problem_file.parse(LINEAR, [override])
        except BadInput as error:
            check(error)


def test_a_changed_copy_does_not_keep_what_was_worked_out_from_the_original() -> None:
    problem = problem_file.load("clemen_rupp_jerk_l2")
    assert problem.order == 3 and "jerk" in problem.limits.given
    limits = problem.limits.model_copy(update={"jerk": None, "snap": Limit(min=-1e5, max=1e5)})
    assert set(limits.given) == {*problem.limits.given, "snap"} - {"jerk"}
    assert problem.model_copy(update={"limits": limits}).order == 4
