"""Plants from end to end: problem files, solutions, figures, files, the command line, other verdicts than SOLVED."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
from dataclasses import FrozenInstanceError, replace
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import trajopt
from tests.bad_plants import MATRICES, POLES, POLYNOMIALS
from tests.test_plant import ROWS, TWO_MASSES
from trajopt import problem_file
from trajopt.plant import time_optimal
from trajopt.plant.problem import PlantProblem

KEYS = {"status", "objective", "duration", "metrics", "certificate", "audit", "route", "timings", "problem", "command"}


def two_masses(**changes: Any) -> PlantProblem:
    plant = {"numerator": [1], "denominator": TWO_MASSES, "input": 1, "final_value": 1}
    return PlantProblem(plant=plant | changes)


def solved(problem: PlantProblem) -> trajopt.PlantSolution:
    """The solution of a problem that must be solved and proven."""
    solution = trajopt.solve(problem)
    assert solution.status is trajopt.Verdict.SOLVED, solution.message
    assert solution.audit["passed"] and solution.audit["not_checked"] == []
    assert solution.objective == solution.duration == solution.command.duration
    assert abs(solution.certificate["gap"]) <= 1e-8
    return solution


@pytest.fixture(scope="module")
def spring() -> trajopt.PlantSolution:
    return solved(two_masses())


# ------------------------------------------------------------------------------------------------ the problem


def test_the_descriptions_of_one_plant_give_one_answer() -> None:
    texts = [POLYNOMIALS, MATRICES, POLYNOMIALS.replace("numerator = [1]", "poles = [[-0.1, 0.99498743710662]]")]
    texts[2] = texts[2].replace("denominator = [1, 0.2, 1]\n", "")
    durations = [solved(problem_file.parse(text)).duration for text in texts]
    assert durations == pytest.approx([1.335006098281] * 3, rel=1e-9)


def test_conjugates_may_be_left_out_and_each_counts() -> None:
    plant = trajopt.PlantSection(poles=[0, 0, [-0.1, 2.0], (-0.1, 2.0)], input=1, final_value=1)
    assert sorted(plant.poles, key=lambda p: p.imag)[:2] == [-0.1 - 2j] * 2 and len(plant.poles) == 6
    whole = trajopt.PlantSection(poles=[0, -0.1 + 2j, -0.1 - 2j], zeros=[3, 1j], input=1, final_value=1)
    assert len(whole.poles) == 3 and whole.zeros == (3, 1j, -1j)


@pytest.mark.parametrize(
    ("text", "overrides"),
    [
        (POLES, ()),
        (POLES, ("plant.robust={poles=[[-1, 7], -3]}",)),
        (POLYNOMIALS, ("plant.robust=zvd", "title=x")),
        (POLYNOMIALS, ("plant.robust={band=['0.1 Hz', '200 mHz'], damping=0.02}", "plant.input=2")),
        (MATRICES, ("plant.final_input=0.5", "plant.B=[[0], [1]]", "plant.C=[[1, 0]]")),
    ],
)
def test_canonical_round_trip(text: str, overrides: tuple[str, ...]) -> None:
    problem = problem_file.parse(text, overrides)
    again = PlantProblem.model_validate(json.loads(json.dumps(problem.canonical())))
    assert again == problem == problem.replace() == pickle.loads(pickle.dumps(problem))
    assert again.hash == problem.hash != problem.replace(title="another").hash


def test_one_number_is_plus_minus_and_frequencies_have_units() -> None:
    problem = problem_file.parse(POLYNOMIALS, ["plant.input=2", "plant.robust={band=['0.1 Hz', '200 mHz'], count=2}"])
    assert problem.plant.input == (-2.0, 2.0)
    assert problem.plant.added == pytest.approx((0.2j * pi, 0.4j * pi))


def test_a_problem_is_frozen_and_refused_in_code_too() -> None:
    with pytest.raises(ValueError, match="frozen"):
        two_masses().plant.input = (0, 1)
    with pytest.raises(trajopt.BadInput, match=r"plant\.input: must be > 0"):
        two_masses(input=-1)
    with pytest.raises(trajopt.BadInput, match=r"^final_value: a move of zero length"):
        trajopt.PlantSection(numerator=[1], denominator=[1, 0, 0], input=1, final_value=0)


def test_what_only_solving_shows_is_bad_input_too() -> None:
    problem = PlantProblem(plant={"poles": [0, 0, [0, 1e5]], "gain": 1e10, "input": 1, "final_value": 1})
    with pytest.raises(trajopt.BadInput, match=r"^plant: the mode at .* swings 31831 times .* damp it"):
        trajopt.solve(problem)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-3, 3) | st.floats() | st.sampled_from(["zvd", "1 Hz", "x", "", 10**400]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(["band", "poles", "count"]), inner),
    max_leaves=8,
)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.sampled_from([POLES, POLYNOMIALS, MATRICES]), st.sampled_from([*trajopt.PlantSection.model_fields]), VALUES)
def test_any_value_is_read_or_refused(text: str, key: str, value: Any) -> None:
    data = problem_file.tomllib.loads(text)
    data["plant"][key] = value
    try:
        problem = problem_file.from_dict(data)
        assert PlantProblem.model_validate(problem.canonical()) == problem
    except trajopt.BadInput as error:
        assert str(error).isprintable() and len(str(error)) <= 500


# ------------------------------------------------------------------------------------------------ the solution


@pytest.mark.parametrize("row", ROWS)
def test_reference_rows_through_solve(row: str) -> None:
    numerator, denominator, u_ss, y_f, robust, switches, duration = ROWS[row]
    plant = {"numerator": numerator, "denominator": denominator, "input": 1, "final_value": y_f, "final_input": u_ss}
    solution = solved(PlantProblem(plant=plant | ({"robust": robust} if robust else {})))
    assert solution.duration == pytest.approx(duration, rel=1e-9)
    assert solution.command.switches == pytest.approx(switches, rel=1e-9)
    assert solution.metrics["switches"] == len(switches)


@pytest.mark.parametrize(
    "changes",
    [
        {"robust": {"band": (0.2, 0.25), "count": 3}},
        {"robust": {"band": (0.2, 0.2), "damping": 0.1, "count": 1}},
        {"robust": {"poles": [[0.0, sqrt(2)], [0.0, sqrt(2)]]}},
        {"robust": {"poles": [-1.0]}},
    ],
)
def test_robust_commands_take_longer_and_are_proven(spring: trajopt.PlantSolution, changes: dict[str, Any]) -> None:
    solution = solved(two_masses(**changes))
    assert solution.duration > spring.duration
    if "band" in changes["robust"]:
        damping = changes["robust"].get("damping", 0.0)
        assert solution.residual_vibration(np.array(changes["robust"]["band"]), damping) == pytest.approx(0, abs=1e-8)


@pytest.mark.parametrize(
    "plant",
    [
        {"poles": [-1, -2], "zeros": [0], "gain": 3, "input": 1, "final_value": 0, "final_input": 0.5},
        {"poles": [-1, -2], "zeros": [-3, -5], "gain": 2, "input": (0.2, 1), "final_value": 7.5},
        {"poles": [0] * 6, "input": 1, "final_value": 0.5},
        {"poles": [-1, -1e6], "gain": 1e6, "input": 1, "final_value": 0.5},
        {"poles": [0], "input": [0, 1], "final_value": 5},
        {"poles": [0, 0, -1, [-0.1, 1], [-0.05, 2.2], [0, 3.7]], "zeros": [-4, [-1, 5]], "input": 1, "final_value": 9},
        {"poles": [0, 0, [0, sqrt(2)]], "input": 1, "final_value": pi**2},  # a whole period: one switch, many costates
    ],
)
def test_plants_of_all_kinds_are_proven(plant: dict[str, Any]) -> None:
    solved(PlantProblem(plant=plant))


def test_frame_and_at(spring: trajopt.PlantSolution) -> None:
    frame = spring.frame
    assert list(frame) == ["time", "input", "output", "sigma"] and set(spring.command.switches) <= set(frame["time"])
    assert frame["time"].is_monotonic_increasing and frame["time"].iloc[-1] == spring.duration
    arcs = frame["sigma"].abs() > 1e-9
    assert (np.sign(frame["sigma"]) == frame["input"])[arcs][:-1].all() and frame["input"].iloc[-1] == 0
    later = spring.at([spring.duration, 2 * spring.duration])
    assert later["output"] == pytest.approx([1, 1], abs=1e-12) and later["input"].tolist() == [0, 0]
    assert np.isnan(later["sigma"][1]) and spring.at(0.0)["input"] == 1
    with pytest.raises(ValueError, match="from 0 on"):
        spring.at(-1.0)


def test_metrics_of_the_modes(spring: trajopt.PlantSolution) -> None:
    assert spring.metrics["mode1_frequency"] == pytest.approx(sqrt(2) / 2 / pi)
    assert spring.metrics["mode1_damping"] == 0 and spring.metrics["mode1_residual"] < 1e-9
    assert spring.residual_vibration(spring.metrics["mode1_frequency"]) < 1e-9
    assert spring.residual_vibration(np.full((2, 2), 0.2)).shape == (2, 2)


def test_a_solution_is_frozen(spring: trajopt.PlantSolution) -> None:
    with pytest.raises(FrozenInstanceError):
        spring.duration = 1.0
    with pytest.raises(TypeError, match="frozen"):
        spring.metrics["switches"] = 2.0
    again = pickle.loads(pickle.dumps(spring))
    assert again.duration == spring.duration and ", duration=4.21786651" in repr(again)


def test_figures(spring: trajopt.PlantSolution) -> None:
    panels = spring.plot()
    assert [axes.get_ylabel().split("\n")[0] for axes in panels] == ["input u", "output y", "switching"]
    steps, output, sigma = (axes.lines[0] for axes in panels)
    assert set(steps.get_ydata()) == {-1.0, 0.0, 1.0} and np.max(output.get_ydata()) == pytest.approx(1.0, abs=1e-9)
    assert np.nanmax(np.abs(sigma.get_ydata())) == pytest.approx(1.0)
    axes = spring.plot_vibration()
    left, marked = axes.lines[0].get_ydata(), axes.lines[1].get_xdata()
    assert marked[0] == pytest.approx(sqrt(2) / 2 / pi) and np.min(left[300:]) < 1 < np.max(left)
    assert spring.plot_vibration(np.array([0.1, 0.3]), 0.05).lines[0].get_xdata().tolist() == [0.1, 0.3]


def test_saved_files_pass_the_check(spring: trajopt.PlantSolution, tmp_path: Path) -> None:
    (tmp_path / "trajectory.csv").write_text("of another answer")
    written = spring.save(tmp_path)
    assert [path.name for path in written] == ["result.json", "command.csv", "command.png", "vibration.png"]
    assert sorted(tmp_path.iterdir()) == sorted(written)
    result = json.loads(written[0].read_text())
    assert set(result) >= KEYS and result["structure"]["arcs"][0] == {
        "from": 0.0, "to": spring.command.switches[0], "limit": "input.max", "top": 1.0,
    }  # fmt: skip
    steps = pd.read_csv(written[1], comment="#")
    assert steps["t [s]"].tolist() == [0.0, *spring.command.switches, spring.duration]
    assert steps["u"].tolist() == [1, -1, 1, -1, 0]
    assert trajopt.check_file(written[0], spring.problem.canonical()).passed


# ------------------------------------------------------------------------------------------------ other verdicts


def test_no_structure_found_is_undecided(tmp_path: Path) -> None:
    solution = trajopt.solve(PlantProblem(plant={"poles": [0, -1e10], "input": 1, "final_value": 1e-3}))
    assert solution.status is trajopt.Verdict.UNDECIDED and "no command found" in solution.message
    assert solution.duration is None and solution.to_dict()["metrics"] is None
    with pytest.raises(trajopt.NoSolution, match="no command found"):
        solution.plot()
    assert [path.name for path in solution.save(tmp_path)] == ["result.json"]
    assert trajopt.check_file(tmp_path / "result.json").passed


def slower(monkeypatch: pytest.MonkeyPatch, optimal: bool) -> trajopt.PlantSolution:
    """The robust command for two masses, as if found for the plain problem."""
    stated = two_masses(robust="zvd").plant
    command = time_optimal(stated.model, -1, 1, y_f=1, robust="zvd")
    found = replace(command, optimal=optimal)
    monkeypatch.setattr("trajopt.plant.solving.time_optimal", lambda *_: found)
    return trajopt.solve(two_masses())


def test_a_command_without_proof_is_local_and_bounded(
    monkeypatch: pytest.MonkeyPatch, spring: trajopt.PlantSolution
) -> None:
    solution = slower(monkeypatch, optimal=False)
    assert solution.status is trajopt.Verdict.SOLVED_LOCAL
    assert 0 <= solution.certificate["lower_bound"] <= spring.duration and solution.certificate["gap"] > 0.2


def test_a_false_claim_of_optimality_does_not_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    solution = slower(monkeypatch, optimal=True)
    assert solution.status is trajopt.Verdict.UNDECIDED and solution.duration is None
    assert "did not pass the check" in solution.message and not solution.audit["passed"]


@pytest.mark.parametrize("error", [1e-5, float("nan")])
def test_an_end_that_misses_is_not_solved(monkeypatch: pytest.MonkeyPatch, error: float) -> None:
    command = time_optimal(two_masses().plant.model, -1, 1, y_f=1)
    monkeypatch.setattr("trajopt.plant.solving.time_optimal", lambda *_: replace(command, end_error=error))
    solution = trajopt.solve(two_masses())
    assert solution.status is trajopt.Verdict.UNDECIDED and "end off by" in solution.message


def test_time_limit_and_death_of_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    import os
    import time

    monkeypatch.setattr("trajopt.plant.solving.time_optimal", lambda *_: time.sleep(60))
    solution = trajopt.solve(two_masses(), seconds=0.2)
    assert solution.status is trajopt.Verdict.LIMIT and isinstance(solution, trajopt.PlantSolution)
    monkeypatch.setattr("trajopt.plant.solving.time_optimal", lambda *_: os._exit(9))
    solution = trajopt.solve(two_masses(), seconds=20)
    assert solution.status is trajopt.Verdict.CRASHED and "code 9" in solution.message


def test_plants_are_not_synchronised() -> None:
    with pytest.raises(trajopt.BadInput, match="takes moves of one axis each"):
        trajopt.synchronise([two_masses()])


# ------------------------------------------------------------------------------------------------ the command line


def run(*words: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "trajopt", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


def test_solve_prints_the_switch_times_and_saves(tmp_path: Path) -> None:
    done = run("solve", "two_masses_and_a_spring", "--set", "plant.final_value=2", "-o", tmp_path)
    assert done.returncode == 0, done.stderr
    for words in ("SOLVED", "to rest at 2", "input: +1 to ", "then 0", "mode of 0.225079 Hz", "lower bound", "newton"):
        assert words in done.stdout
    assert run("check", tmp_path / "result.json").returncode == 0
    done = run("check", tmp_path / "result.json", "--problem", "two_masses_and_a_spring")
    assert done.returncode == 3 and "belongs to another problem" in done.stdout


def test_json_and_route() -> None:
    done = run("solve", "motor_with_lag", "--seconds", "60", "--json")
    result = json.loads(done.stdout)
    assert done.returncode == 0 and set(result) >= KEYS and result["comparison"] == []
    assert result["objective"] == pytest.approx(1.657454454153, rel=1e-11)
    done = run("route", "motor_with_lag", "--json")
    assert json.loads(done.stdout)["model"] == "arcs" and json.loads(done.stdout)["solver"] == "newton"


def test_bad_input_is_one_line_and_exit_2() -> None:
    for override in ("plant.poles=[0, 2]", "plant.poles=[0, 0, [0, 1e6]]"):
        done = run("solve", "motor_with_lag", "--set", override)
        assert done.returncode == 2 and len(done.stderr.strip().splitlines()) == 1, done.stderr
        assert "plant" in done.stderr
