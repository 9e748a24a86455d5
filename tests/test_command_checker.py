"""The checker of commands: own mathematics against scipy's, and every mutation of a good result is seen."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import signal
from scipy.linalg import expm

import trajopt
from tests.test_plant import TWO_MASSES
from trajopt import checker
from trajopt.checker.linear_system import chain, exponential, series
from trajopt.plant.problem import PlantProblem

Result = dict[str, Any]
SPRING = {"numerator": [1], "denominator": TWO_MASSES, "input": 1, "final_value": 1}
MIXED = {"poles": [0, -1, [-0.1, 1.0], [-0.05, 2.2]], "zeros": [-4], "gain": 3, "input": [-1, 0.7], "final_value": 2}
ROBUST = SPRING | {"robust": "zvd"}
HELD = {"A": [[0, 1, 0], [0, 0, 1], [-48, -17.2, -3.4]], "B": [0, 0, 1], "C": [1, 0, 0], "input": 1,
        "final_value": 0.0125, "final_input": 0.6}  # fmt: skip
PERIOD = SPRING | {"final_value": np.pi**2}  # one switch, so many switching functions vanish there


@pytest.fixture(scope="module")
def results() -> dict[str, Result]:
    """Good results, as a file holds them."""
    plants = {"spring": SPRING, "mixed": MIXED, "robust": ROBUST, "held": HELD, "period": PERIOD}
    found = {name: trajopt.solve(PlantProblem(plant=plant)).to_dict() for name, plant in plants.items()}
    return {name: json.loads(json.dumps(result)) for name, result in found.items()}


def failed(result: Result, problem: Result | None = None) -> list[str]:
    return [check.name for check in checker.check(result, problem).failed]


# ------------------------------------------------------------------------------------------------ its mathematics


@pytest.mark.parametrize("size", [1e-6, 1.0, 30.0, 1000.0])
def test_exponentials(size: float) -> None:
    matrices = np.random.default_rng(1).standard_normal((5, 4, 4)) - 4 * np.eye(4)
    for found, wanted in zip(exponential(size * matrices), map(expm, size * matrices), strict=True):
        assert found == pytest.approx(wanted, rel=1e-10, abs=1e-12)


@pytest.mark.parametrize("zeros", [0, 1, 2, 3, 5, 6, 7])
def test_chains_of_sections_have_the_transfer_function(zeros: int) -> None:
    poles = [0j, 0j, -1 + 0j, -300 + 0j, -2.2 + 0j, -0.1 + 30j, -0.1 - 30j]
    roots = [0j, -5 + 0j, 1 + 2j, 1 - 2j, -0.3 + 0j, 4 + 0j, -9 + 0j]
    roots = [roots[i] for i in {2: (2, 3), 5: (0, 1, 2, 3, 4)}.get(zeros, range(zeros))]
    if zeros == 3:
        roots = [0j, *roots[2:], 1 - 2j]
    system = chain(poles, roots, 2.5).balanced()
    for s in (0.2 + 0.7j, 3 + 20j, 100 + 0j):
        found = system.c @ np.linalg.solve(s * np.eye(7) - system.a, system.b) + system.d
        assert found == pytest.approx(2.5 * np.prod(s - np.array(roots)) / np.prod(s - np.array(poles)), rel=1e-10)


def test_steps_of_systems_in_series() -> None:
    filtered = series([chain([-3 + 0j], [], 3.0), chain([-0.5 + 2j, -0.5 - 2j], [-1 + 0j], 4.0)])
    times = np.linspace(0, 5, 20)
    wanted = signal.step(([12, 12], np.polymul([1, 3], [1, 1, 4.25])), T=times)[1]
    assert filtered.reached(times)[1] @ filtered.c == pytest.approx(wanted, abs=1e-9)


# ------------------------------------------------------------------------------------------------ good results


def test_good_results_pass_and_nothing_is_left_out(results: dict[str, Result]) -> None:
    for result in results.values():
        report = checker.check(result, result["problem"])
        assert report.passed, report.summary()
        assert report.not_checked == () and report.tolerance == 1e-6
        assert checker.command_bound(result) == pytest.approx(result["duration"], rel=1e-8)


def test_switching_function_is_its_own_unless_many_vanish_at_the_switches(results: dict[str, Result]) -> None:
    for name, alone in (("spring", True), ("robust", True), ("held", True), ("period", False)):
        result = copy.deepcopy(results[name])
        result["command"]["sigma"] = None
        report = checker.check(result)
        assert report.passed == alone and (checker.command_bound(result) is not None) == alone
        if not alone:
            assert failed(result) == ["optimality"] and "many switching functions" in report.not_checked[0]
            assert checker.check(result | {"status": "SOLVED_LOCAL", "certificate": None}).passed


def test_bound_of_a_command_that_is_not_the_shortest(results: dict[str, Result]) -> None:
    slow = copy.deepcopy(results["robust"])
    slow["problem"] = results["spring"]["problem"]
    slow["problem_hash"] = results["spring"]["problem_hash"]
    assert failed(slow) == ["sign of the switching function", "optimality", "certificate bound"]
    bound = checker.command_bound(slow)
    assert bound is not None and 0 < bound < results["spring"]["duration"]


# ------------------------------------------------------------------------------------------------ mutations


def _move_switch(result: Result) -> None:
    result["command"]["times"][1] += 1e-5


def _stretch(result: Result) -> None:
    result["command"]["times"] = [t * (1 + 1e-5) for t in result["command"]["times"]]


def _swap(result: Result) -> None:
    levels = result["command"]["levels"]
    levels[0], levels[1] = levels[1], levels[0]


def _truncate(result: Result) -> None:
    result["command"]["times"].pop()


def _reverse(result: Result) -> None:
    result["command"]["times"][1:3] = result["command"]["times"][2:0:-1]


def _weaken(result: Result) -> None:
    result["command"]["levels"] = [0.999 * u for u in result["command"]["levels"]]


def _hold_elsewhere(result: Result) -> None:
    result["command"]["final_input"] += 0.01


def _hold_outside(result: Result) -> None:
    result["command"]["final_input"] = 5.0


def _put(*path: str | int, value: Any) -> Callable[[Result], None]:
    def mutate(result: Result) -> None:
        at: Any = result
        for key in path[:-1]:
            at = at[key]
        at[path[-1]] = value

    return mutate


MUTATIONS: dict[str, tuple[Callable[[Result], None], str]] = {
    "switch moved": (_move_switch, "end at rest"),
    "stretched": (_stretch, "final value"),
    "levels swapped": (_swap, "end at rest"),
    "a time lost": (_truncate, "structure"),
    "times fall": (_reverse, "structure"),
    "levels inside the limits": (_weaken, "levels"),
    "another final input": (_hold_elsewhere, "end at rest"),
    "final input outside": (_hold_outside, "final input"),
    "another duration": (_put("duration", value=4.0), "duration"),
    "another objective": (_put("objective", value=4.0), "objective"),
    "another number of switches": (_put("metrics", "switches", value=2.0), "metric switches"),
    "another residual": (_put("metrics", "mode1_residual", value=1.0), "metric mode1_residual"),
    "bound above": (_put("certificate", "lower_bound", value=1e3), "certificate bound"),
    "another gap": (_put("certificate", "gap", value=0.5), "certificate gap"),
    "not a number": (_put("command", "levels", 0, value="1"), "structure"),
    "nan": (_put("command", "times", 1, value=float("nan")), "structure"),
    "unknown key": (_put("command", "colour", value=1), "structure"),
    "no command": (_put("command", value=None), "structure"),
    "unknown status": (_put("status", value="FINE"), "structure"),
    "numbers without a solution": (_put("status", value="LIMIT"), "structure"),
    "no plant": (_put("problem", "plant", value=None), "structure"),
    "plant of another kind": (_put("problem", "plant", "colour", value=1), "structure"),
    "an input that is no pair": (_put("problem", "plant", "input", value=[1.0]), "structure"),
    "sigma of another length": (_put("command", "sigma", "time", value=[0.0]), "structure"),
}


@pytest.mark.parametrize("name", ["spring", "mixed", "robust"])
@pytest.mark.parametrize("mutation", MUTATIONS)
def test_mutations_are_seen(results: dict[str, Result], name: str, mutation: str) -> None:
    mutate, check = MUTATIONS[mutation]
    result = copy.deepcopy(results[name])
    mutate(result)
    assert check in failed(result), checker.check(result).summary()


def test_another_final_value_or_input_is_seen(results: dict[str, Result]) -> None:
    for key, value, check in (("final_value", 0.01251, "final value"), ("final_input", 0.61, "final input as stated")):
        result = copy.deepcopy(results["held"])
        result["problem"]["plant"][key] = value
        assert {"problem hash", check} <= set(failed(result))


def test_the_plain_command_is_not_robust(results: dict[str, Result]) -> None:
    result = results["spring"] | {"problem": results["robust"]["problem"]}
    assert "robust end at rest" in failed(result)


def test_another_plant_is_seen(results: dict[str, Result]) -> None:
    result = copy.deepcopy(results["spring"])
    result["problem"]["plant"]["denominator"][2] *= 1 + 1e-4
    assert {"problem hash", "end at rest"} <= set(failed(result))
    assert failed(results["spring"], results["held"]["problem"]) == ["same problem"]


@pytest.mark.parametrize("key", ["numerator", "denominator", "A", "B", "poles", "zeros", "gain", "robust", "input"])
@pytest.mark.parametrize("value", [None, [], [0.0], [[1.0, 2.0], [3.0]], {}, "x", 1e60, [1e60, 1e-60], -1.0])
def test_any_plant_in_a_file_is_judged(results: dict[str, Result], key: str, value: Any) -> None:
    for name in ("spring", "mixed", "held"):
        result = copy.deepcopy(results[name])
        result["problem"]["plant"][key] = value
        assert not checker.check(result).passed


def test_files_are_compared_and_sealed(tmp_path: Path) -> None:
    trajopt.solve(PlantProblem(plant=SPRING)).save(tmp_path)
    path, table = tmp_path / "result.json", tmp_path / "command.csv"
    assert checker.check_file(path).passed
    text = table.read_text()
    for bad in (text.replace("t [s],u", "t,u"), text.replace("1.00", "1.01"), text[:-4], text.replace(",1", ""), ""):
        table.write_text(bad)
        assert [check.name for check in checker.check_file(path).failed] == ["command.csv"]
    table.unlink()
    path.write_text(path.read_text().replace('"message": ""', '"message": "x"'))
    assert [check.name for check in checker.check_file(path).failed] == ["seal"]
    path.write_text(path.read_text()[:-200])
    with pytest.raises(checker.CheckerInputError, match="truncated"):
        checker.check_file(path)
