"""The checker must pass what is right, whatever its shape and units, and miss no fault. The optimiser is not used.

Trajectories are built here by exact fractions, and measured here by dense sampling.
"""

from __future__ import annotations

import ast
import copy
import hashlib
import json
import math
import os
import random
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import trajopt
from trajopt import checker
from trajopt.checker import CheckerInputError, check, check_file, measure, result_file
from trajopt.checker.float_twin import FloatTwin
from trajopt.checker.polynomials import bernstein
from trajopt.checker.questions import tasks_of
from trajopt.checker.rational_twin import RationalTwin
from trajopt.checker.reading import read
from trajopt.checker.values import WITHOUT_SOLUTION

NAMES = ("position", "velocity", "acceleration", "jerk", "snap")
Data = dict[str, Any]


# Building right results


def integrate(scheme: str, start: list[float], top: list[float], times: list[float]) -> list[list[float]]:
    """Node values of the derivatives below the top one, exact to the last rounding."""
    order, count = len(start), len(top)
    states = [[Fraction(x) for x in start]]
    for k in range(count):
        h = Fraction(times[k + 1]) - Fraction(times[k]) if scheme == "exact" else Fraction(times[-1]) / count
        now = [*states[-1], Fraction(top[k])]
        reach = order if scheme == "exact" else 1
        states.append([
            sum((now[i + j] * h**j / math.factorial(j) for j in range(min(reach, order - i) + 1)), Fraction(0))
            for i in range(order)
        ])  # fmt: skip
    return [[float(state[i]) for state in states] for i in range(order)]


def table_at(limit: Any, t: Any) -> Any:
    return np.interp(t, limit["time"], limit["value"]) if isinstance(limit, dict) else limit + 0 * t


def sampled(data: Data, per: int = 4001) -> tuple[Any, dict[str, Any]]:
    """Times (rows, per) and all signals on them, a row for each stretch of one direction; Euler: its nodes (1, N+1)."""
    found, load = data["trajectory"], data["problem"].get("load", {})
    order, time = found["order"], np.array(found["time"])
    x = [np.array(found[name]) for name in NAMES[: order + 1]]
    if found["scheme"] == "euler":
        t, signals = time[None, :], {name: x[i][None, :] for i, name in enumerate(NAMES[: order + 1])}
        sign = np.sign(signals["velocity"])
    else:
        k, left, right = stretches(time, x)
        s = left[:, None] + np.linspace(0, 1, per) * (right - left)[:, None]
        t = time[k, None] + s
        signals = {
            NAMES[i]: sum(x[i + j][k, None] * s**j / math.factorial(j) for j in range(order - i + 1)) + 0 * s
            for i in range(order + 1)
        }
        sign = np.sign(signals["velocity"][:, [per // 2]])
    if load.get("inertia") is not None:
        v = signals["velocity"]
        signals["force"] = table_at(load["inertia"], t) * signals["acceleration"] + load.get("viscous", 0.0) * v
        signals["force"] = signals["force"] + load.get("coulomb", 0.0) * sign
        signals["power"] = signals["force"] * v
    if load.get("torque_constant") is not None:
        signals |= electrical(load, signals["force"], signals["velocity"])
    return t, signals


def electrical(load: Data, force: Any, v: Any) -> dict[str, Any]:
    """Current, voltage, and the power that a motor draws."""
    u = force / load["torque_constant"]
    iron = load["eddy"] * v**2 * u**2 + load["hysteresis"] * np.abs(v) * np.abs(u) ** load["hysteresis_exponent"]
    drawn = force * v + load["resistance"] * u**2 + load["switching"] * np.abs(u) + iron
    return {"current": u, "voltage": load["resistance"] * u + load["torque_constant"] * v, "drawn": drawn}


def counted(load: Data, drawn: Any) -> Any:
    return np.where(drawn > 0, drawn, load["recovery"] * drawn)


def stretches(time: Any, x: list[Any]) -> tuple[Any, Any, Any]:
    """Interval, start and end (s after its left node) of every stretch between nodes and reversals."""
    rows = []
    for k, h in enumerate(np.diff(time)):
        reach = range(len(x) - 2, -1, -1)
        roots = np.roots([x[1 + j][k] / math.factorial(j) for j in reach])
        inside = sorted(r.real for r in roots if abs(r.imag) < 1e-9 * h and 1e-9 * h < r.real < (1 - 1e-9) * h)
        ends = [0.0, *inside, h]
        rows += [(k, a, b) for a, b in zip(ends, ends[1:], strict=False)]
    k, left, right = zip(*rows, strict=True)
    return np.array(k), np.array(left), np.array(right)


def metrics_of(data: Data) -> dict[str, float]:
    t, signals = sampled(data)
    end = data["trajectory"]["time"][-1]
    euler_step = end / (t.size - 1) if data["trajectory"]["scheme"] == "euler" else None
    found = {}
    for name in (*NAMES[1 : data["trajectory"]["order"] + 1], "force", "power", "current"):
        if name in signals:
            x = signals[name]
            found[f"peak_{name}"] = float(np.max(np.abs(x)))
            top = x.shape != t.shape  # of the Euler scheme: a value for each interval
            total = np.sum(x**2) * euler_step if top and euler_step else np.trapezoid(x**2, t).sum()
            found[f"rms_{name}"] = math.sqrt(total / end)
    if "power" in signals:
        found["energy"] = float(np.trapezoid(np.abs(signals["power"]), t).sum())
    if "drawn" in signals:
        load = data["problem"]["load"]
        found["peak_voltage"] = float(np.max(np.abs(signals["voltage"])))
        found["copper_loss"] = load["resistance"] * found["rms_current"] ** 2 * end
        found["electrical_energy"] = float(np.trapezoid(counted(load, signals["drawn"]), t).sum())
        found["brake_energy"] = float(np.trapezoid(np.maximum(-signals["drawn"], 0.0), t).sum())
    speed = np.abs(signals["velocity"])
    found["distance"] = float(speed[0, :-1].sum() * euler_step if euler_step else np.trapezoid(speed, t).sum())
    return found


def objective_of(data: Data) -> float:
    """The single term minimised here: L2 of the top derivative."""
    found = data["trajectory"]
    top = np.array(found[NAMES[found["order"]]])
    steps = np.diff(found["time"])
    return math.sqrt(steps @ top**2 / steps.sum() if found["scheme"] == "exact" else top @ top)


def sealed(data: Data) -> Data:
    """The result with the hash its problem has now."""
    text = json.dumps(data["problem"], sort_keys=True, separators=(",", ":"))
    data["problem_hash"] = hashlib.sha256(text.encode()).hexdigest()
    return data


def result(
    top: list[float], order: int = 3, scheme: str = "exact", times: list[float] | None = None, start: Any = None,
    limits: Any = None, load: Any = None, span: float = 1.0, **problem: Any,
) -> Data:  # fmt: skip
    """A right result for a problem that asks for just this trajectory."""
    times = times or [span * k / len(top) for k in range(len(top) + 1)]
    start = start or [0.0] * order
    nodes = integrate(scheme, start, top, times)
    state = lambda k: {name: nodes[i][k] for i, name in enumerate(NAMES[:order])}  # noqa: E731
    data: Data = {
        "format": "trajopt result 1", "trajopt": "0.1.0", "status": "SOLVED", "route": {},
        "problem": {
            "move": {"time": times[-1], "start": state(0), "end": state(-1), "via": []},
            "limits": copy.deepcopy(limits or {}), "load": copy.deepcopy(load or {"coulomb": 0.0, "viscous": 0.0}),
            "objective": {"terms": [{"minimize": NAMES[order], "norm": "l2", "weight": 1.0}]},
            "transcription": {"intervals": len(top), "scheme": scheme, "solver": "auto"}, "rotary": False, "title": "",
            **problem,
        },
        "duration": times[-1],
        "trajectory": {
            "scheme": scheme, "order": order, "time": times, **dict(zip(NAMES, [*nodes, top], strict=False)),
        },
    }  # fmt: skip
    data["objective"] = objective_of(data)
    data["certificate"] = {"lower_bound": data["objective"] * (1 - 1e-7), "gap": 1e-7}
    data["metrics"] = metrics_of(data) if len(top) < 1000 else {}
    return sealed(data)


def s_curve(count: int = 16, distance: float = 0.254, span: float = 1.0, **more: Any) -> Data:
    """Rest to rest with jerk + - - + in equal quarters: every peak has a closed form."""
    jerk = 32 * distance / span**3
    top = [jerk if 4 * k < count or 4 * k >= 3 * count else -jerk for k in range(count)]
    limits = {
        "velocity": {"min": 0.0, "max": 2 * distance / span}, "jerk": {"min": -jerk, "max": jerk},
        "acceleration": {"min": -jerk * span / 4, "max": jerk * span / 4},
    }  # fmt: skip
    return result(top, limits={**limits, **more.pop("limits", {})}, span=span, **more)


LOAD = {"inertia": 10.0, "coulomb": 0.0, "viscous": 0.0}
RUB = {"inertia": 10.0, "coulomb": 3.0, "viscous": 2.0}
GROWING = {"inertia": {"time": [0.0, 0.25, 1.0], "value": [5.0, 10.0, 6.0]}, "coulomb": 1.0, "viscous": 0.5}
MOTOR = {**RUB, "torque_constant": 20.0, "resistance": 0.7, "switching": 0.4, "eddy": 0.5, "hysteresis": 0.3,
         "hysteresis_exponent": 2.0, "recovery": 0.6}  # fmt: skip
IRON = {**MOTOR, "hysteresis_exponent": 1.6, "recovery": 0.0}
UNEVEN = [0.0, 0.1, 0.25, 0.3, 0.45, 0.5, 0.6, 0.75, 0.8, 0.9, 1.0]
WAVE = [3.0, -7.0, 2.0, -1.0, 5.0, -4.0, 3.0, 6.0, -8.0, 1.0]

RIGHT: dict[str, Callable[[], Data]] = {
    "s-curve": lambda: s_curve(load=LOAD),
    "friction": lambda: s_curve(load=RUB),
    "growing load": lambda: s_curve(load=GROWING),
    "order 2": lambda: result([2 / 3, 1 / 3, -1 / 3, -2 / 3], 2, load=LOAD),
    "order 4": lambda: result(WAVE, 4, load=RUB),
    "uneven": lambda: result(WAVE, times=UNEVEN, load=GROWING, start=[0.3, -0.2, 0.1],
                             transcription={"intervals": 10, "scheme": "exact", "solver": "auto"}),
    "reversing": lambda: result([40.0, -80.0, 30.0, -50.0, 70.0, -10.0], load=RUB),
    "euler": lambda: result(WAVE, scheme="euler", load=RUB, start=[0.1, 0.2 / 3, -0.3 / 7]),
    "euler snap": lambda: result(WAVE, 4, scheme="euler", load=LOAD),
    "no load": lambda: result(WAVE),
    "motor": lambda: s_curve(load=MOTOR),
    "motor reversing": lambda: result([40.0, -80.0, 30.0, -50.0, 70.0, -10.0], load=IRON),
    "motor order 2": lambda: result([2 / 3, 1 / 3, -1 / 3, -2 / 3], 2, load=MOTOR),
    "motor order 4": lambda: result(WAVE, 4, load={**MOTOR, "coulomb": 0.0}, start=[0.0, 0.2, -0.1, 0.3]),
    "motor euler": lambda: result(WAVE, scheme="euler", load=IRON, start=[0.1, 0.2 / 3, -0.3 / 7]),
}  # fmt: skip


@pytest.mark.parametrize("strict", [False, True])
@pytest.mark.parametrize("name", RIGHT)
def test_right_results_pass(name: str, strict: bool) -> None:
    data = RIGHT[name]()
    report = check(json.loads(json.dumps(data)), data["problem"], strict=strict)
    assert report.passed, report.to_dict()
    assert report.decided_by == ("rational" if strict else report.decided_by)
    assert report.tolerance == (1e-9 if strict else 1e-6)
    assert report.not_checked == ()
    assert report.summary().startswith("passed") and "\n" not in report.summary()


def test_floats_decide_the_plain_case() -> None:
    assert check(s_curve(200, load=LOAD)).decided_by == "float"


@pytest.mark.parametrize("name", RIGHT)
def test_measure_agrees_with_dense_sampling(name: str) -> None:
    data = RIGHT[name]()
    assert measure(data) == pytest.approx(metrics_of(data), rel=3e-7)


def test_measure_of_the_s_curve_has_closed_forms() -> None:
    found = measure(s_curve(load=LOAD))
    jerk, distance = 32 * 0.254, 0.254
    assert found["peak_velocity"] == pytest.approx(jerk / 16, rel=1e-12)
    assert found["peak_acceleration"] == pytest.approx(jerk / 4, rel=1e-12)
    assert found["rms_jerk"] == pytest.approx(jerk, rel=1e-12)
    assert found["rms_acceleration"] == pytest.approx(jerk / 4 / math.sqrt(3), rel=1e-12)
    assert found["distance"] == pytest.approx(distance, rel=1e-12)
    assert found["energy"] == pytest.approx(10 * (jerk / 16) ** 2, rel=1e-12)


# Faults in single numbers


def places(data: Data) -> list[tuple[str, ...]]:
    found = data["trajectory"]
    lists = {name: value for name, value in found.items() if isinstance(value, list)}
    numbers = [("trajectory", name, str(k)) for name, value in lists.items() for k in range(len(value))]
    return [*numbers, ("objective",), ("duration",), *(("metrics", name) for name in data["metrics"])]


def at(data: Data, place: tuple[str, ...]) -> tuple[Any, Any]:
    holder: Any = data
    for key in place[:-1]:
        holder = holder[key]
    return holder, int(place[-1]) if isinstance(holder, list) else place[-1]


@pytest.mark.parametrize("strict", [False, True])
@pytest.mark.parametrize("name", RIGHT)
def test_a_fault_of_1e_5_in_any_one_number_is_caught(name: str, strict: bool) -> None:
    data = RIGHT[name]()
    for place in places(data)[:: 4 if strict else 1]:
        holder, key = at(data, place)
        value = holder[key]
        size = max(map(abs, holder)) if isinstance(holder, list) else abs(value)
        for sign in (1, -1):
            fault = value * 1e-5 if abs(value) > 1e-3 * size else size * 1e-5
            holder[key] = value + sign * fault
            assert not check(data, strict=strict).passed, f"{place}: {value} -> {holder[key]}"
        holder[key] = value
    assert check(data, strict=strict).passed


@pytest.mark.parametrize("name", RIGHT)
def test_lost_swapped_scaled_and_flipped_samples_are_caught(name: str) -> None:
    right = RIGHT[name]()
    for signal in [key for key, value in right["trajectory"].items() if isinstance(value, list)]:
        for change in (
            lambda x: x[:-1], lambda x: x[1:], lambda x: [*x, x[-1]], lambda x: [x[1], x[0], *x[2:]],
            lambda x: [1.001 * a for a in x], lambda x: [-a for a in x], lambda x: x[::-1],
            lambda x: [*x[:2], math.nan, *x[3:]], lambda x: [*x[:2], math.inf, *x[3:]],
            lambda x: [*x[:2], 1e300, *x[3:]],
            lambda x: [*x[:2], None, *x[3:]], lambda x: [*x[:2], str(x[2]), *x[3:]], lambda x: [*x[:2], True, *x[3:]],
            lambda x: [], lambda x: None, lambda x: dict(enumerate(x)), lambda x: [x],
        ):  # fmt: skip
            data = copy.deepcopy(right)
            data["trajectory"][signal] = change(right["trajectory"][signal])
            if data["trajectory"][signal] != right["trajectory"][signal]:
                assert not check(data).passed, (signal, data["trajectory"][signal])
    lost = copy.deepcopy(right)
    for value in lost["trajectory"].values():
        if isinstance(value, list):
            value.pop(2)
    assert not check(lost).passed


def test_the_whole_trajectory_scaled_or_mirrored_is_caught() -> None:
    for factor in (-1.0, 1 + 1e-5, 1000.0):
        data = s_curve(load=LOAD)
        for name in NAMES[:4]:
            data["trajectory"][name] = [factor * x for x in data["trajectory"][name]]
        data.update(objective=objective_of(data), metrics=metrics_of(data), certificate=None)
        report = check(data)
        assert not report.passed and any(failed.name == "end position" for failed in report.failed)


@pytest.mark.parametrize("name", ["s-curve", "order 4", "uneven", "euler"])
def test_six_printed_digits_fail(name: str) -> None:
    data = RIGHT[name]()
    text = json.dumps(data["trajectory"])
    data["trajectory"] = json.loads(text, parse_float=lambda number: float(f"{float(number):.6g}"))
    assert not check(data).passed


def test_a_drift_hidden_in_small_defects_is_caught() -> None:
    data = s_curve(4000, load=LOAD)
    peak = max(data["trajectory"]["velocity"])
    data["trajectory"]["velocity"] = [v + 4e-10 * peak * k for k, v in enumerate(data["trajectory"]["velocity"])]
    failed = {failed.name for failed in check(data).failed}
    assert "drift velocity" in failed and "dynamics velocity" not in failed


# Identity, verdicts and shape


def test_an_edited_problem_or_another_one_is_caught() -> None:
    data = s_curve(load=LOAD)
    other = copy.deepcopy(data["problem"])
    other["limits"]["velocity"]["max"] = 0.6
    assert "belongs to another problem" in check(data, other).summary()
    edited = {**data, "problem": other}
    assert "edited" in check(edited).summary()
    assert check(sealed(edited), other).passed
    for bad in (None, "", "0" * 64, 5, data["problem_hash"].upper()):
        assert not check({**data, "problem_hash": bad}).passed


@pytest.mark.parametrize("status", WITHOUT_SOLUTION)
def test_without_solution_no_numbers_are_carried(status: str) -> None:
    data = s_curve(load=LOAD)
    empty = {**data, "status": status, "objective": None, "duration": None, "metrics": None, "trajectory": None}
    assert check(empty, data["problem"]).passed
    for key in ("objective", "duration", "metrics", "trajectory"):
        assert key in check({**empty, key: data[key]}).summary()


def test_missing_keys_and_unknown_words_are_caught() -> None:
    data = s_curve(load=LOAD)
    for key in data.keys() - {"certificate", "route"}:
        assert not check({k: v for k, v in data.items() if k != key}).passed
        assert not check({**data, key: None}).passed or key == "trajopt"
    for changed in ({"status": "solved"}, {"status": ["SOLVED"]}, {"format": "trajopt result 2"}, {"objective": True}):
        assert not check({**data, **changed}).passed
    for section, extra in (("limits", {"torque": {"max": 1.0}}), ("load", {"gravity": 9.81}), ("move", {"pause": 1.0})):
        odd = copy.deepcopy(data)
        odd["problem"][section].update(extra)
        assert "does not know" in check(sealed(odd)).failed[0].note
    for junk in (None, [], 5, "text"):
        assert not check(junk).passed  # type: ignore[arg-type]


def test_order_and_scheme_must_be_those_of_the_problem() -> None:
    data = s_curve(load=LOAD)
    data["problem"]["limits"]["snap"] = {"max": 1e9}
    assert "order" in check(sealed(data)).summary()
    data = s_curve(load=LOAD)
    data["problem"]["transcription"]["scheme"] = "euler"
    assert "scheme" in check(sealed(data)).summary()
    data = s_curve(load=LOAD)
    data["problem"]["transcription"]["intervals"] = 17
    assert {failed.name for failed in check(sealed(data)).failed} == {"mesh"}


@pytest.mark.parametrize(
    ("time", "right"),
    [(1.0, True), (1.0 + 1e-9, False), ([0.5, 1.0], True), ([1.0, 2.0], True), ([1.001, 2.0], False),
     ([0.5, 0.999], False), ("free", True), ("often", False), ([1.0], False), (None, False)],
)  # fmt: skip
def test_move_time(time: Any, right: bool) -> None:
    data = s_curve(load=LOAD)
    data["problem"]["move"]["time"] = time
    assert check(sealed(data)).passed is right


def test_boundary_states_default_to_rest_and_free_ones_are_free() -> None:
    data = result([2.0, 1.0, 3.0, -4.0], 2)
    end = data["problem"]["move"]["end"]
    off = {name: value * (1 + 1e-5) for name, value in end.items()}
    for change, right in (({"velocity": "free"}, True), ({"velocity": off["velocity"]}, False),
                          ({"position": "free"}, True), ({"position": off["position"]}, False)):  # fmt: skip
        data["problem"]["move"]["end"] = {**end, **change}
        assert check(sealed(data)).passed is right
    data["problem"]["move"]["end"] = {"position": end["position"]}
    assert [failed.name for failed in check(sealed(data)).failed] == ["end velocity"]


def test_via_states() -> None:
    data = s_curve(load=LOAD)
    found = data["trajectory"]
    via = {"time": found["time"][5], "position": found["position"][5], "velocity": found["velocity"][5]}
    for change, wrong in (({}, set()), ({"position": via["position"] + 1e-6}, {"via 1 position"}),
                          ({"velocity": 0.0}, {"via 1 velocity"}), ({"time": 0.32}, {"mesh"}),
                          ({"time": 1.5}, {"mesh", "via 1 position", "via 1 velocity"})):  # fmt: skip
        data["problem"]["move"]["via"] = [{**via, **change}]
        assert {failed.name for failed in check(sealed(data)).failed} == wrong


# Limits


def bump(limits: Data, load: Any = None, **more: Any) -> Data:
    """Velocity 0.5 at both nodes, 0.75 half-way: broken limits show between the nodes only."""
    return result([-2.0] * 1, start=[0.0, 0.5, 1.0], limits=limits, load=load, **more)


@pytest.mark.parametrize("strict", [False, True])
@pytest.mark.parametrize(
    ("limits", "load", "time"),
    [({"velocity": {"max": 0.75}}, None, None),
     ({"velocity": {"max": 0.75 - 1e-5}}, None, 0.5),
     ({"velocity": {"max": 0.6, "min": -1e30}}, None, 0.5),
     ({"velocity": {"min": 0.5, "max": 1.0}}, None, None),
     ({"velocity": {"max": {"time": [0.0, 1.0], "value": [0.5624, 1.0624]}}}, None, 0.25),
     ({"velocity": {"max": {"time": [0.0, 1.0], "value": [0.5625, 1.0625]}}}, None, None),
     ({"velocity": {"max": {"time": [-5.0, -1.0], "value": [0.1, 0.75]}}}, None, None),
     ({"acceleration": {"min": -1.0, "max": 0.999}}, None, 0.0),
     ({"acceleration": {"min": -0.999, "max": 1.0}}, None, 1.0),
     ({"jerk": {"min": -1.999}}, None, 0.0),
     ({"force": {"max": 10.0}}, LOAD, None),
     ({"force": {"max": 9.99}}, LOAD, 0.0),
     ({"power": {"min": -5.0, "max": 5.0}}, LOAD, None),
     ({"power": {"min": -4.99}}, LOAD, 1.0)],
)  # fmt: skip
def test_limits_between_the_nodes(limits: Data, load: Any, time: float | None, strict: bool) -> None:
    report = check(bump(limits, load), strict=strict)
    if time is None:
        assert report.passed, report.summary()
        return
    (failed,) = report.failed
    assert failed.name == f"limit {next(iter(limits))}"
    assert failed.time == pytest.approx(time, abs=2e-4)
    assert report.worst is failed


def test_power_between_the_nodes() -> None:
    peak = metrics_of(s_curve(4, load=LOAD))["peak_power"]
    for factor, right in ((1 + 1e-8, True), (1 - 1e-5, False)):
        data = s_curve(4, load=LOAD, limits={"power": {"min": -peak * factor, "max": peak * factor}})
        assert check(data).passed is right and check(data, strict=factor > 1).passed is right


def test_limits_of_a_motor() -> None:
    """Each at the edge, by its definition; and 1e-5 of it beyond."""
    plain = s_curve(load=MOTOR)
    t, signals = sampled(plain)
    found = plain["metrics"]
    dwell = 0.6
    cases = {
        "current": {"min": -found["peak_current"], "max": found["peak_current"]},
        "voltage": {"max": float(np.max(signals["voltage"]))},
        "rms_force": {"max": found["rms_force"] * math.sqrt(1 / (1 + dwell))},
        "brake_energy": {"max": found["brake_energy"]},
    }
    for name, limit in cases.items():
        for factor, right in ((1 + 3e-7, True), (1 - 1e-5, False)):
            data = s_curve(load=MOTOR, limits={name: {side: x * factor for side, x in limit.items()}})
            data["problem"]["move"]["dwell"] = dwell
            for strict in (False, True) if factor > 1 else (False,):
                report = check(sealed(data), strict=strict)
                assert {failed.name for failed in report.failed} == (set() if right else {f"limit {name}"})
    data["problem"]["limits"]["rms_force"] = cases["rms_force"]
    data["problem"]["move"]["dwell"] = 0.99 * dwell
    assert "limit rms_force" in {failed.name for failed in check(sealed(data)).failed}


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_envelope_holds_between_the_nodes_and_in_every_quadrant(way: float) -> None:
    """Force 10 - 20 t and velocity 0.5 + t - t²: the highest of plus-minus force + 12·velocity, by sampling."""
    t = np.linspace(0, 1, 100001)
    v, force = 0.5 + t - t**2, 10 - 20 * t
    level = max(float(np.max(force + 12 * v)), float(np.max(-force + 12 * v)))
    for factor, right in ((1 + 1e-8, True), (1 - 1e-5, False)):
        # forces fall by 12 N per m/s from `level` down to the last speed, 1 m/s
        envelope = {"speed": [0.0, 1.0], "force": [level * factor, level * factor - 12]}
        data = result([-2.0 * way], start=[0.0, 0.5 * way, way], limits={"envelope": envelope}, load=LOAD)
        assert check(data).passed is right and check(data, strict=factor > 1).passed is right
    for last, right in ((0.75, True), (0.74, False)):
        envelope = {"speed": [0.0, last], "force": [30.0, 30.0]}
        data = result([-2.0 * way], start=[0.0, 0.5 * way, way], limits={"envelope": envelope}, load=LOAD)
        assert check(data).passed is right


def test_what_is_no_motor_is_said() -> None:
    for change, word in (
        ({"torque_constant": None}, "torque_constant"), ({"resistance": 0.0}, "resistance"),
        ({"eddy": -1.0}, "negative"), ({"hysteresis_exponent": 1.0}, "hysteresis_exponent"),
        ({"recovery": 1.1}, "recovery"), ({"gears": 2}, "gears"),
    ):  # fmt: skip
        data = s_curve(load=MOTOR)
        data["problem"]["load"].update(change)
        assert word in check(sealed(data)).summary()
    for limit in ({"current": {"max": 1.0}}, {"brake_energy": {"max": 1.0}}):
        assert "torque_constant" in check(s_curve(load=LOAD, limits=limit)).summary()
    for envelope in ({"speed": [0.0, 1.0], "force": [1.0, 2.0]}, {"speed": [0.1, 1.0], "force": [2.0, 1.0]},
                     {"speed": [0.0], "force": [1.0]}, {"speed": [0.0, 0.0], "force": [2.0, 1.0]}, 5):  # fmt: skip
        assert "envelope" in check(s_curve(load=LOAD, limits={"envelope": envelope})).summary()
    for limit in ({"min": 0.0}, {"max": {"time": [0.0, 1.0], "value": [1.0, 2.0]}}):
        assert "rms_force" in check(s_curve(load=LOAD, limits={"rms_force": limit})).summary()


def test_position_limits_between_the_nodes() -> None:
    for level, right in ((0.125, True), (0.125 - 1e-6, False)):
        data = result([-1.0, 1.0, 1.0], 2, start=[0.0, 0.5], limits={"position": {"min": -1.0, "max": level}},
                      times=[0.0, 0.9, 1.0, 1.2])  # fmt: skip
        assert check(data).passed is right


def test_a_limit_table_with_a_corner_inside_an_interval() -> None:
    table = {"time": [0.2, 0.5, 0.8], "value": [1.0, 0.74, 1.0]}
    failed = {failed.name for failed in check(bump({"velocity": {"max": table}})).failed}
    assert failed == {"mesh", "limit velocity"}  # the exact scheme owes a node there, and the limit counts all the same


def test_an_inertia_that_varies_between_nodes() -> None:
    load = {"inertia": {"time": [0.0, 1.0], "value": [10.0, 30.0]}, "coulomb": 0.0, "viscous": 0.0}
    # force (10 + 20 t)(1 - 2 t) falls from 10 to -30; power = force·(0.5 + t - t²)
    assert check(bump({"force": {"min": -30.0, "max": 10.0}}, load)).passed
    assert not check(bump({"force": {"min": -29.99, "max": 10.0}}, load)).passed
    t = np.linspace(0, 1, 200001)
    low = float(np.min((10 + 20 * t) * (1 - 2 * t) * (0.5 + t - t**2)))
    assert check(bump({"power": {"min": low * (1 + 1e-8)}}, load), strict=True).passed
    assert not check(bump({"power": {"min": low * (1 - 1e-5)}}, load)).passed


def test_friction_counts_on_both_sides_of_a_reversal_and_not_at_rest() -> None:
    load = {"inertia": 1.0, "coulomb": 2.0, "viscous": 0.0}
    top = [-1.0, -1.0, -1.0]  # v from 0.7 through zero in the second interval: force -1 + 2, then -1 - 2
    for low, high, right in ((-3.0, 1.0, True), (-2.999, 1.0, False), (-3.0, 0.999, False)):
        data = result(top, 2, start=[0.0, 0.7], limits={"force": {"min": low, "max": high}}, load=load, span=1.5)
        assert check(data).passed is right and check(data, strict=True).passed is right
    stop = result([1.0, -1.0], 2, limits={"force": {"min": 1.0, "max": 3.0}}, load=load)  # -1 + 2 until it stops
    assert check(stop).passed and check(stop, strict=True).passed


def test_limits_of_the_euler_scheme_count_at_nodes_only() -> None:
    data = result([-2.0, -2.0, 1.0], scheme="euler", start=[0.0, 0.5, 1.0], load=LOAD)
    peak = max(data["trajectory"]["velocity"])
    for level, right in ((peak, True), (peak * (1 - 1e-5), False)):
        data["problem"]["limits"] = {"velocity": {"max": level}}
        assert check(sealed(data)).passed is right
        assert check(data, strict=True).passed is right
    data["problem"]["limits"] = {"jerk": {"max": {"time": [0.0, 1.0], "value": [0.0, 1.4]}}}
    assert not check(sealed(data)).passed  # 1 at the left node of the last interval, where 0.933 is allowed


def test_a_force_limit_needs_an_inertia() -> None:
    assert "inertia" in check(bump({"force": {"max": 1.0}})).summary()


@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1e3, 2.0**40])
@pytest.mark.parametrize("clock", [1.0, 1e-3, 86400.0])
def test_units_change_no_verdict(unit: float, clock: float) -> None:
    for strict in (False, True):
        data = s_curve(8, 0.254 * unit, clock, load=RUB)
        assert check(data, strict=strict).passed
        data["problem"]["limits"]["velocity"]["max"] *= 1 - 1e-5
        assert not check(sealed(data), strict=strict).passed


@pytest.mark.parametrize("origin", [1.0, -1e3, 1e6])
def test_a_far_origin_changes_no_verdict(origin: float) -> None:
    limits = {"position": {"min": origin, "max": origin + 0.25}}
    data = s_curve(8, 0.25, load=LOAD, start=[origin, 0.0, 0.0], limits=limits)
    assert check(data).passed and check(data, strict=True).passed
    data["problem"]["limits"]["position"]["max"] -= 1e-6
    assert not check(sealed(data)).passed


def test_not_moving_does_not_reach_a_near_end_far_out() -> None:
    data = result([0.0, 0.0], 2, start=[1e6, 0.0])
    assert check(data).passed
    data["problem"]["move"]["end"]["position"] = 1e6 + 1e-7
    assert not check(sealed(data)).passed


def test_standing_still_passes_exactly() -> None:
    data = result([0.0] * 4, load=RUB)
    assert data["objective"] == 0 and check(data).passed and check(data, strict=True).passed
    data["trajectory"]["velocity"][2] = 1e-12
    assert not check(data).passed


# Objective, metrics, certificate


def value_of(data: Data, term: Data) -> float:
    """The documented definition, written down once more."""
    found, load = data["trajectory"], data["problem"]["load"]
    name, order, time = term["minimize"], found["order"], np.array(found["time"])
    steps, euler = np.diff(time), found["scheme"] == "euler"
    if name == "time":
        return float(time[-1])
    x = [np.array(found[key]) for key in NAMES[: order + 1]]
    quantity = {"energy": "power", "copper_loss": "current", "electrical_energy": "drawn"}.get(name, name)
    weights = np.append(steps, 0) / 2 + np.append(0, steps) / 2
    pick: Callable[[Any], Any] = lambda y: y  # noqa: E731
    if quantity not in NAMES and order == 2:
        weights = np.tile(steps / 2, 2)
        pick = lambda y: np.concatenate([y[:-1], y[1:]]) if len(y) > len(steps) else np.tile(y, 2)  # noqa: E731
    if quantity in NAMES:
        y = x[NAMES.index(quantity)] - (x[0][0] if quantity == "position" else 0)
        weights = weights if len(y) > len(steps) else steps
    else:
        v = pick(x[1])
        y = pick(table_at(load["inertia"], time)) * pick(x[2]) + load["viscous"] * v + load["coulomb"] * np.sign(v)
        if quantity in ("current", "voltage", "drawn"):
            y = electrical(load, y, v)[quantity]
        y = y * v if quantity == "power" else y
    if euler:
        weights = np.full(len(y), steps[0] if "norm" not in term else 1.0)
    if name == "copper_loss":
        return float(weights @ (load["resistance"] * y**2))
    if name == "electrical_energy":
        return float(weights @ counted(load, y))
    norm = term.get("norm", "l1")
    if norm == "linf":
        return float(np.max(np.abs(y)))
    return float(weights @ np.abs(y) if norm == "l1" else math.sqrt(weights @ y**2 / (1 if euler else time[-1])))


@pytest.mark.parametrize("name", [name for name in RIGHT if name not in ("reversing", "euler snap", "no load")])
def test_objectives_by_definition(name: str) -> None:
    data = RIGHT[name]()
    below = NAMES[: data["trajectory"]["order"] + 1]
    motor = name.startswith("motor")
    normed = (*below, "force", "power", *(("current", "voltage") if motor else ()))
    terms = [{"minimize": key, "norm": norm} for key in normed for norm in ("l1", "l2", "linf")]
    plain = ("energy", "time", *(("copper_loss", "electrical_energy") if motor else ()))
    terms += [{"minimize": key} for key in plain]
    # the order is that of the problem: its states say so where the term does not
    alone = [[{**term, "weight": 2.0}] for term in terms]
    for chosen in [*alone, [{**term, "weight": 0.1 + k} for k, term in enumerate(terms)]]:
        data["problem"]["objective"] = {"terms": chosen}
        data["problem"]["limits"] = {below[-1]: {"min": -1e6, "max": 1e6}}
        data["objective"] = sum(term["weight"] * value_of(data, term) for term in chosen)
        data["certificate"] = None
        for strict in (False, True):
            assert check(sealed(data), strict=strict).passed, (chosen, check(data, strict=strict).summary())
            assert not check({**data, "objective": data["objective"] * (1 + 1e-5)}, strict=strict).passed


def test_a_norm_of_the_users_own_is_said_not_to_be_checked() -> None:
    data = s_curve(load=LOAD)
    data["problem"]["objective"]["terms"].append({"minimize": "velocity", "norm": "l4", "weight": 1.0})
    report = check({**sealed(data), "objective": data["objective"] + 1.0, "certificate": None})
    assert report.passed and "l4" in report.not_checked[0] and "l4" in report.summary()
    assert not check({**data, "objective": data["objective"] * (1 - 1e-5), "certificate": None}).passed


def test_metrics_unknown_or_not_defined_are_said_not_to_be_checked() -> None:
    data = result(WAVE)
    data["metrics"].update(peak_snap=5.0, beauty=1.0, energy=3.0, peak_power=None)
    report = check(data)
    assert report.passed and set(report.not_checked) == {"metrics.peak_snap", "metrics.beauty", "metrics.energy"}


@pytest.mark.parametrize(
    ("certificate", "right"),
    [(None, True), ({}, True), ({"lower_bound": None}, True), ({"lower_bound": 1.0}, True),
     ({"lower_bound": 1.0, "gap": 0.0}, True), ({"lower_bound": 1 + 1e-8}, False),
     ({"lower_bound": 0.9, "gap": 0.1}, True), ({"lower_bound": 0.9, "gap": 0.0}, False),
     ({"lower_bound": "1"}, False), ({"lower_bound": math.nan}, False), ("yes", False)],
)  # fmt: skip
def test_certificates(certificate: Any, right: bool) -> None:
    data = s_curve(load=LOAD)
    if isinstance(certificate, dict) and isinstance(certificate.get("lower_bound"), float):
        certificate = {**certificate, "lower_bound": certificate["lower_bound"] * data["objective"]}
    report = check({**data, "certificate": certificate})
    assert report.passed is right
    if certificate and certificate != "yes" and certificate.get("lower_bound") == (1 + 1e-8) * data["objective"]:
        assert "bound above the answer" in report.summary()
    assert bool(report.not_checked) is (certificate in ({}, {"lower_bound": None}))


# The twins


def random_case(seed: int) -> Data:
    """Anything that has the shape of a result: uneven meshes, tables, friction, reversals, states at rest."""
    dice = random.Random(seed)
    order, scheme = dice.choice([(2, "exact"), (3, "exact"), (4, "exact"), (3, "euler"), (4, "euler")])
    count = dice.randint(1, 6)
    size, clock = 10 ** dice.uniform(-6, 6), 10 ** dice.uniform(-3, 3)
    times = [0.0, *sorted(dice.uniform(0.05, 0.95) * clock for _ in range(count - 1)), clock]
    if scheme == "euler":
        times = [clock * k / count for k in range(count + 1)]
    top = [dice.choice([0.0, 1.0, -1.0, dice.gauss(0, 1)]) * size / clock**order for _ in range(count)]
    start = [dice.choice([0.0, dice.gauss(0, 1)]) * size / clock**i for i in range(order)]
    inertia = {"time": [0.3 * clock, 0.6 * clock], "value": [dice.uniform(1, 9), dice.uniform(1, 9)]}
    load = {"inertia": dice.choice([2.0, inertia]), "viscous": dice.choice([0.0, 1.0 / clock]),
            "coulomb": dice.choice([0.0, size / clock**2])}  # fmt: skip
    if dice.random() < 0.5:
        speed, watt = size / clock, size**2 / clock**3
        load |= {"torque_constant": dice.uniform(1, 9) * size / clock**2, "resistance": dice.uniform(0.1, 9) * watt,
                 "switching": dice.choice([0.0, watt]), "eddy": dice.choice([0.0, watt / speed**2]),
                 "hysteresis": dice.choice([0.0, watt / speed]), "hysteresis_exponent": dice.choice([1.3, 2.0]),
                 "recovery": dice.choice([0.0, 0.7, 1.0])}  # fmt: skip
    data = result(top, order, scheme, times, start, load=load)
    _, signals = sampled(data, 101)
    for name in (*NAMES[: order + 1], "force", "power", "current", "voltage"):
        if name not in signals:
            continue
        x = signals[name]
        low, high = float(np.min(x)), float(np.max(x))
        room = dice.choice([-0.1, -1e-7, 0.0, 1e-3]) * (high - low)
        level = high + dice.uniform(-0.5, 0.5) * (high - low)
        table = {"time": [0.2 * clock, 0.7 * clock], "value": [high + room, level]}
        data["problem"]["limits"][name] = {"min": low - room, "max": dice.choice([high + room, table])}
    return sealed(data)


@pytest.mark.parametrize("block", range(10))
def test_the_twins_agree(block: int) -> None:
    for seed in range(40 * block, 40 * block + 40):
        case = read(random_case(seed), [])
        assert case is not None
        quick, exact = FloatTwin(case), RationalTwin(case)
        for task in tasks_of(case, quick, 1e-6, []):
            a, b = task.ask(quick), task.ask(exact)
            off = abs(float(a.violation) - float(b.violation))
            assert off <= 2e-3 * task.tolerance + a.rounding, (seed, task.name, a, b, task.tolerance)


@pytest.mark.parametrize("block", range(5))
def test_limits_agree_with_dense_sampling(block: int) -> None:
    for seed in range(1000 + 20 * block, 1020 + 20 * block):
        data = random_case(seed)
        data["problem"]["load"]["coulomb"] = 0.0  # its jump is another test's
        t, signals = sampled(data, 2001)
        case = read(sealed(data), [])
        assert case is not None
        for name, limit in data["problem"]["limits"].items():
            x = signals[name]
            when = t[:, : x.shape[1]]
            over = max(np.max(x - table_at(limit["max"], when)), np.max(table_at(limit["min"], when) - x), 0.0)
            size = float(np.max(np.abs(x)))
            for twin in (FloatTwin(case), RationalTwin(case)):
                found = float(twin.excess(name, 1e-9 * size).violation)
                assert found == pytest.approx(over, abs=3e-4 * size), (seed, name)


def test_the_rational_twin_decides_at_the_edge() -> None:
    for factor, right in ((1 - 0.999999e-6, True), (1 - 1.000001e-6, False)):
        data = bump({"velocity": {"max": 0.75 / (2 - factor)}})
        report = check(data)
        limit = data["problem"]["limits"]["velocity"]["max"]
        assert report.decided_by == "rational"
        assert report.passed is (0.75 - limit <= 1e-6 * limit) is right


def test_both_forms_of_a_polynomial_are_the_same() -> None:
    dice = np.random.default_rng(1)
    for degree in range(8):
        rows = dice.normal(size=(5, degree + 1))
        found = bernstein(rows)
        for s in (0.0, 0.3, 0.5, 1.0):
            basis = [math.comb(degree, k) * s**k * (1 - s) ** (degree - k) for k in range(degree + 1)]
            assert found @ basis == pytest.approx(rows @ [s**k for k in range(degree + 1)])


def test_ten_thousand_intervals() -> None:
    data = s_curve(10_000)
    assert check(data).passed
    data["trajectory"]["acceleration"][2000] *= 1 + 1e-5
    assert not check(data).passed


# Files


def write(folder: Path, data: Data, name: str = "result.json") -> Path:
    """The file of a result, with the seal that belongs to it."""
    path = folder / name
    data = {key: value for key, value in data.items() if key != "seal"}
    text = json.dumps(data, sort_keys=True, separators=(",", ":"))
    path.write_text(json.dumps(data | {"seal": hashlib.sha256(text.encode()).hexdigest()}))
    return path


def write_table(folder: Path, data: Data, digits: str = ".17g") -> Path:
    found = data["trajectory"]
    order = found["order"]
    last = 0.0 if found["scheme"] == "euler" else found[NAMES[order]][-1]
    columns = [found["time"], *(found[name] for name in NAMES[:order]), [*found[NAMES[order]], last]]
    header = ["t [s]", "q [m]", "v [m/s]", "a [m/s^2]", "j [m/s^3]", "s [m/s^4]"][: order + 2]
    rows = [",".join(format(x, digits) for x in row) for row in zip(*columns, strict=True)]
    path = folder / "trajectory.csv"
    path.write_text("\n".join(["# trajopt", ",".join(header), *rows]) + "\n")
    return path


@pytest.mark.parametrize("name", ["s-curve", "order 2", "order 4", "euler"])
def test_a_file_and_its_table(name: str, tmp_path: Path) -> None:
    data = RIGHT[name]()
    path = write(tmp_path, data)
    plain = check_file(path, data["problem"])
    assert plain.passed
    table = write_table(tmp_path, data)
    report = check_file(path, strict=True)
    assert report.passed and report.not_checked == () and len(report.checks) == len(check(data).checks) + 2
    text = table.read_text()
    lines = text.splitlines()
    for wrong in (
        "\n".join(lines[:-1]) + "\n", text[:-30], text + lines[-1] + "\n", "", "t [s]\n", "\0" * 50,
        text.replace("q [m]", "x [m]"), "\n".join([*lines[:4], lines[5], lines[4], *lines[6:]]) + "\n",
        text.replace(lines[4], lines[4].replace(",", ",1", 1), 1),
        text.replace(lines[4], "nan" + lines[4][lines[4].index(","):]), text.replace("j [m/s^3]", "v [m/s]"),
    ):  # fmt: skip
        if wrong != text:
            table.write_text(wrong)
            assert [failed.name for failed in check_file(path).failed] == ["trajectory.csv"], wrong
    write_table(tmp_path, data, ".6g")
    assert not check_file(path).passed
    assert check_file(write(tmp_path, data, "other.json")).passed  # the table belongs to result.json


def test_columns_beyond_the_trajectory_are_said_not_to_be_checked(tmp_path: Path) -> None:
    data = s_curve(load=LOAD)
    path, table = write(tmp_path, data), write_table(tmp_path, data)
    lines = table.read_text().splitlines()
    table.write_text("\n".join([lines[0], lines[1] + ",T [K]", *(line + ",5" for line in lines[2:])]))
    report = check_file(path)
    assert report.passed and "T [K]" in report.not_checked[0]


def test_no_solution_has_no_table(tmp_path: Path) -> None:
    data = s_curve(load=LOAD)
    write_table(tmp_path, data)
    data.update(status="LIMIT", objective=None, duration=None, metrics=None, trajectory=None)
    assert "no solution" in check_file(write(tmp_path, data)).summary()


def test_files_that_are_no_results(tmp_path: Path) -> None:
    text = json.dumps(s_curve(load=LOAD))
    path = tmp_path / "result.json"
    for size in (*range(1, len(text), 97), len(text) - 1):
        path.write_text(text[:size])
        with pytest.raises(CheckerInputError, match="truncated"):
            check_file(path)
    for content, word in (
        (b"", "truncated"), (b"[1]", "no result"), (b"5", "no result"), (b"\xff\xfe{}", "UTF-8"),
        (b'{"a": NaN}', "NaN"),
        (b'{"a": -Infinity}', "Infinity"), (b'{"a": 1, "a": 2}', "twice"), (b'{"p": {"a": 1, "a": 2}}', "twice"),
        (b"[" * 100_000, "nested"), (b'{"a": ' + b"9" * 5000 + b"}", "no result"), (b"\0" * 100, "truncated"),
    ):  # fmt: skip
        path.write_bytes(content)
        with pytest.raises(CheckerInputError, match=word) as caught:
            check_file(path)
        assert "\n" not in str(caught.value)
    path.write_text(text.replace('"objective": 8.128', '"objective": 1e400', 1))
    assert not check_file(path).passed


def test_files_that_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for odd in (tmp_path / "missing", tmp_path, tmp_path / "pipe", tmp_path / "loop", Path("/dev/zero"), Path("a\0b")):
        with pytest.raises(CheckerInputError):
            check_file(odd)
    monkeypatch.setattr(result_file, "LARGEST_FILE", 100)
    with pytest.raises(CheckerInputError, match="bytes"):
        check_file(write(tmp_path, s_curve(load=LOAD)))


def test_nothing_to_measure() -> None:
    data = s_curve(load=LOAD)
    empty = {"trajectory": None, "duration": None, "objective": None, "metrics": None}
    for changed in ({"status": "LIMIT"}, {"status": "LIMIT", **empty}, {"trajectory": None}):
        with pytest.raises(CheckerInputError, match="nothing to measure"):
            measure({**data, **changed})


# Robustness


JUNK = st.one_of(
    st.none(), st.booleans(), st.integers(), st.just(10**400), st.floats(), st.text(max_size=5), st.just([]),
    st.just({}),
    st.just([[]]), st.just({"time": [0, 1], "value": [1]}), st.just(-1), st.just(1e-320), st.just("free"),
)  # fmt: skip
FORGIVEN = ("trajopt", "route", "certificate", "metrics", "gap", "lower_bound")


def nodes_of(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path] * bool(path) + [place for key, item in items for place in nodes_of(item, (*path, key))]


@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_junk_anywhere_is_caught_and_never_raises(draw: st.DataObject) -> None:
    data = s_curve(8, load=draw.draw(st.sampled_from([LOAD, GROWING])))
    place = draw.draw(st.sampled_from(nodes_of(data)))
    junk, reseal = draw.draw(JUNK), draw.draw(st.booleans())
    holder: Any = data
    for key in place[:-1]:
        holder = holder[key]
    old, holder[place[-1]] = holder[place[-1]], junk
    if reseal:
        sealed(data)
    report = check(data)
    text = json.dumps(report.to_dict(), allow_nan=False)
    assert "\n" not in report.summary() and text
    numbers = type(old) in (int, float) and type(junk) in (int, float)
    same = junk == old or (numbers and abs(junk) < 1e9 and abs(junk - old) < 1e-12)
    harmless = place[0] in FORGIVEN or same or (place[0] in ("problem", "problem_hash") and reseal)
    assert not report.passed or harmless, (place, junk)


def test_the_checker_stands_alone() -> None:
    files = list(Path(checker.__file__).parent.rglob("*.py"))
    assert len(files) > 5
    imported = set()
    for node in (node for file in files for node in ast.walk(ast.parse(file.read_text()))):
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module
            imported.add(node.module)
    own = {name for name in imported if name.startswith("trajopt.checker.")}
    assert own and {name.split(".")[0] for name in imported - own} - {"numpy"} <= set(sys.stdlib_module_names)


def test_a_report_says_what_is_wrong_in_one_line() -> None:
    data = s_curve(load=LOAD)
    data["trajectory"]["velocity"][5] *= 1.01
    report = check(data)
    told = report.to_dict()
    assert set(told) == {"passed", "tolerance", "excess", "decided_by", "worst", "failed", "checks", "not_checked"}
    assert set(told["worst"]) == {"name", "violation", "tolerance", "time"}
    assert told["worst"]["name"] == "dynamics velocity" and told["worst"]["time"] == data["trajectory"]["time"][5]
    assert told["checks"] == len(report.checks) and not told["passed"]
    assert all("\n" not in line for line in told["failed"])
    assert report.summary().startswith("FAILED")


def test_force_and_power_of_a_table_are_recomputed_and_units_compared(tmp_path: Path) -> None:
    problem = trajopt.load("clemen_rupp_power_l2", ["transcription.intervals=20"])
    trajopt.solve(problem).save(tmp_path)
    path, table = tmp_path / "result.json", tmp_path / "trajectory.csv"
    report = check_file(path)
    assert report.passed and report.not_checked == ()
    text = table.read_text()
    lines = text.splitlines()
    for column in (-1, -2):
        cells = lines[9].split(",")
        cells[column] = repr(float(cells[column]) * (1 + 1e-9))
        table.write_text(text.replace(lines[9], ",".join(cells)))
        assert [failed.name for failed in check_file(path).failed] == ["trajectory.csv"]
    for name, wrong in (("q [m]", "q [mm]"), ("P [W]", "P [kW]"), ("F [N]", "F [N m]")):
        table.write_text(text.replace(name, wrong))
        assert wrong in check_file(path).summary()


@pytest.mark.parametrize(
    "edit",
    [
        lambda data: data["prices"][0].update(per_percent=99.0),
        lambda data: data["audit"].update(tolerance=1.0),
        lambda data: data["route"].update(solver="another"),
        lambda data: data["metrics"].pop("rms_jerk"),
        lambda data: data.update(explanation={"text": ["because"]}),
        lambda data: data.update(status="SOLVED_LOCAL"),
        lambda data: data.update(certificate=None),
    ],
    ids=["price", "audit", "route", "metric", "explanation", "status", "certificate"],
)
def test_any_edit_breaks_the_seal(edit: Any, tmp_path: Path) -> None:
    trajopt.solve(trajopt.load("clemen_rupp_jerk_l2", ["transcription.intervals=12"])).save(tmp_path)
    path = tmp_path / "result.json"
    assert check_file(path).passed
    data = json.loads(path.read_text())
    edit(data)
    path.write_text(json.dumps(data))
    assert "seal" in {failed.name for failed in check_file(path).failed}
    del data["seal"]
    path.write_text(json.dumps(data))
    assert "missing" in check_file(path).summary()
