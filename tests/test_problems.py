"""The ready-made problems: each says what it is and where it comes from, and its moral holds; the paper's tables."""

from __future__ import annotations

import contextlib
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import problems
import trajopt
from problems import clemen_rupp
from tests.conftest import PUBLISHED_CURVES, solved

PAPER = [name for name in problems.ready_made() if name.startswith("clemen_rupp_")]
QUANTITIES, NORMS = ("velocity", "acceleration", "jerk", "power"), ("l1", "l2", "linf")
E0, P0 = 0.811147924, 1.681929422  # J, W: best energy and peak power, Euler, N = 200, recomputed independently


def test_every_single_axis_case_of_the_paper_is_there() -> None:
    cases = {f"clemen_rupp_{quantity}_{norm}" for quantity in QUANTITIES for norm in NORMS}
    cases |= {f"clemen_rupp_velocity_{norm}_jerk10" for norm in NORMS}
    cases |= {f"clemen_rupp_{name}" for name in ("energy", "time", "equal_weights")}
    assert set(PAPER) == cases


@pytest.mark.parametrize("name", problems.ready_made())
def test_it_says_what_it_is(name: str) -> None:
    problem = trajopt.load(name)
    for text, shortest in ((problem.title, 10), (problem.source, 7), (problem.moral, 40)):
        assert len(text) >= shortest and "\n" not in text
    assert trajopt.load(problems.ready_made()[name]) == problem
    assert trajopt.route(problem).reason


@pytest.mark.parametrize("name", PAPER)
def test_the_paper_s_cases_state_table_i(name: str) -> None:
    problem = trajopt.load(name)
    given = {kind: (limit.lowest, limit.highest) for kind, limit in problem.limits.given.items()}
    jerk = 981.0 if name.endswith("jerk10") else 98.1
    assert given == {
        "velocity": (0.0, 0.5),
        "acceleration": (-4.905, 4.905),
        "jerk": (-jerk, jerk),
        "power": (-100.0, 100.0),
    }
    assert problem.load.inertia == 10.0 and problem.move.end.position == 0.254 and problem.move.start_position == 0.0
    assert problem.move.time == ("free" if name.endswith("_time") else 1.0)
    assert (problem.transcription.intervals, problem.transcription.scheme) == (200, "exact")
    assert "Clemen & Rupp 2023" in problem.source


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("norm", NORMS)
def test_names_say_what_is_minimised(quantity: str, norm: str) -> None:
    (term,) = trajopt.load(f"clemen_rupp_{quantity}_{norm}").objective.terms
    assert (term.minimize, term.norm and term.norm.name) == (quantity, norm)


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(trajopt.BadInput, match="no_such_problem"):
        trajopt.load("no_such_problem")


def test_rotary_indexing_reaches_its_torque_limit_only_while_speeding_up() -> None:
    solution = solved(trajopt.load("rotary_indexing"))
    assert solution.problem.rotary
    torque = solution.frame["force"]
    assert torque.max() == pytest.approx(3.1, abs=1e-6) and torque.min() > -3.09
    assert solution.at(solution.duration)["position"] == pytest.approx(np.pi / 2)
    free = solved(trajopt.load("rotary_indexing", ['limits.torque="5 N m"']))
    velocity = free.frame["velocity"].to_numpy()
    np.testing.assert_allclose(velocity, velocity[::-1], atol=1e-4)  # the moral: symmetric without the torque limit
    velocity = solution.frame["velocity"].to_numpy()
    assert np.abs(velocity - velocity[::-1]).max() > 1e-2


def test_fly_past_passes_its_via_state() -> None:
    solution = solved(trajopt.load("fly_past_via_state"))
    at = solution.at(0.5)
    for name, value in (("position", 0.15), ("velocity", 0.3), ("acceleration", 0.0)):
        assert at[name] == pytest.approx(value, abs=1e-9)
    assert solution.metrics["peak_velocity"] == pytest.approx(0.5, abs=1e-6)


def test_friction_problem_keeps_its_limit_by_time_and_a_little_jerk_costs_little() -> None:
    problem = trajopt.load("friction_and_limit_by_time")
    solution = solved(problem)
    beside = solution.at(np.linspace(0.4, 0.6, 101))["velocity"]
    assert beside.max() == pytest.approx(0.2, abs=1e-6)
    assert solution.metrics["energy"] > 15 * 0.25  # Coulomb friction alone takes that
    alone = solved(trajopt.load("friction_and_limit_by_time", ['objective.minimize="energy"']))
    assert alone.metrics["energy"] <= solution.metrics["energy"] <= 1.005 * alone.metrics["energy"]
    assert solution.metrics["rms_jerk"] < 0.75 * alone.metrics["rms_jerk"]


def test_morals_of_the_plants_in_numbers() -> None:
    names = ("two_masses_and_a_spring", "two_masses_and_a_spring_zvd", "motor_with_lag", "damped_mode_and_lag")
    spring, zvd, motor, mode = (solved(trajopt.load(name)) for name in names)
    assert spring.duration == pytest.approx(1.49 * 2 * np.sqrt(2), rel=2e-3)  # rigid, of the same mass
    assert zvd.duration == pytest.approx(1.39 * spring.duration, rel=2e-3)
    for off in (0.9, 1.1):
        left = [
            s.residual_vibration(off * np.sqrt(2) / 2 / np.pi) * np.sum(np.abs(s.command.impulses[1]))
            for s in (spring, zvd)
        ]
        assert left[1] / left[0] == pytest.approx(1 / 6, rel=0.05)
    assert motor.command.switches[0] / motor.duration == pytest.approx(0.8, abs=5e-3)
    assert mode.duration * mode.metrics["mode1_frequency"] == pytest.approx(0.52, abs=5e-3)


def test_a_tenfold_jerk_limit_makes_l2_and_linf_alike() -> None:
    velocity = {}
    for name in ("l2", "linf", "l2_jerk10", "linf_jerk10"):
        velocity[name] = solved(trajopt.load(f"clemen_rupp_velocity_{name}")).frame["velocity"]
    apart = [np.abs(velocity[f"l2{jerk}"] - velocity[f"linf{jerk}"]).max() for jerk in ("", "_jerk10")]
    assert apart[1] < 0.3 * apart[0]


# ------------------------------------------------------------------------------------------------ Tables II and III


@pytest.fixture(scope="module")
def solutions() -> dict[clemen_rupp.Case, trajopt.Solution]:
    return clemen_rupp.solve_cases()


@pytest.fixture(scope="module")
def table(solutions: dict[clemen_rupp.Case, trajopt.Solution]) -> pd.DataFrame:
    return clemen_rupp.study(solutions)


@pytest.mark.slow
def test_every_determined_entry_has_the_printed_digits(table: pd.DataFrame) -> None:
    assert set(table.index[~table["determined"]]) == {"velocity_l1"}
    assert clemen_rupp.disagreements(table) == []
    determined = table[table["determined"]]
    assert len(determined) == 14
    for quantity in ("energy", "power"):
        entries = determined[[f"{quantity}_printed", f"{quantity}_euler_ratio"]].itertuples(index=False, name=None)
        for printed, ratio in entries:
            assert abs(ratio - float(printed)) <= 0.5 * 10.0 ** -len(printed.partition(".")[2]), (printed, ratio)


@pytest.mark.slow
def test_absolute_values_behind_the_ratios(table: pd.DataFrame) -> None:
    assert table["energy_euler"].min() == pytest.approx(E0, rel=1e-7)
    assert table["power_euler"].min() == pytest.approx(P0, rel=1e-7)
    energy = {"acceleration_l2": 1.8482, "jerk_l2": 2.7964, "power_l2": 1.3907, "time": 3.0821, "equal_weights": 1.5031}
    power = {
        "velocity_l2": 5.4456,
        "acceleration_l2": 1.4072,
        "jerk_l2": 2.5909,
        "jerk_linf": 3.3302,
        "power_l2": 1.7726,
        "time": 11.2108,
        "equal_weights": 1.0796,
    }
    for quantity, expected in (("energy", energy), ("power", power)):
        ratios = table[f"{quantity}_euler_ratio"].to_dict()
        assert {name: ratios[name] for name in expected} == pytest.approx(expected, abs=1.1e-4)
    # The ringing of least L2 velocity costs it next to nothing and shows in the energy: no more digits than these.
    assert table["energy_euler_ratio"]["velocity_l2"] == pytest.approx(1.171, abs=2e-3)


@pytest.mark.slow
def test_the_exact_scheme_has_lower_peaks_where_euler_errs_to_first_order(table: pd.DataFrame) -> None:
    peaks = table.loc[["energy", "time"], ["power_euler", "power_exact"]]
    assert (peaks["power_exact"] < 0.985 * peaks["power_euler"]).all()
    assert peaks["power_exact"]["time"] == pytest.approx(18.510244, rel=5e-3)  # continuous time


@pytest.mark.slow
def test_morals_in_numbers(solutions: dict[clemen_rupp.Case, trajopt.Solution]) -> None:
    value = {name: solutions[name, "exact"].objective for name in clemen_rupp.PRINTED}
    assert all(x is not None for x in value.values())
    assert value["velocity_l1"] == pytest.approx(0.254, rel=1e-6)
    assert value["jerk_l1"] == pytest.approx(4 * float(value["acceleration_linf"] or 0), rel=1e-6)
    assert value["energy"] == pytest.approx(10 * float(value["velocity_linf"] or 0) ** 2, rel=1e-3)
    assert float(value["jerk_linf"] or 0) > 32 * 0.254
    for name in ("acceleration_linf", "jerk_l1", "jerk_linf", "time"):  # they run into the velocity limit
        assert solutions[name, "exact"].metrics["peak_velocity"] == pytest.approx(0.5, rel=1e-6)


@pytest.fixture(scope="module")
def front() -> trajopt.Front:
    """Every tenth weight of Fig. 7; the demonstration draws all 51."""
    return clemen_rupp.pareto_sweep(points=6)


@pytest.mark.slow
@pytest.mark.skipif(not PUBLISHED_CURVES.exists(), reason="published curves are not part of the repository")
def test_the_front_of_figure_7(front: trajopt.Front) -> None:
    published = pd.read_csv(PUBLISHED_CURVES / "fig7_pareto_front.csv").to_numpy()
    ratios = front.values / front.values.min(axis=0)
    assert front.status is trajopt.Verdict.SOLVED and len(front.points) == 6
    assert np.max(np.abs(ratios / published[::-1][::10] - 1)) <= 1e-3


def run(
    monkeypatch: pytest.MonkeyPatch,
    given: dict[clemen_rupp.Case, trajopt.Solution],
    front: trajopt.Front,
    output: Path,
) -> tuple[int, str]:
    monkeypatch.setattr(clemen_rupp, "solve_cases", lambda done: given)
    monkeypatch.setattr(clemen_rupp, "pareto_sweep", lambda workers: front)
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        code = clemen_rupp.main(["--output", str(output)])
    return code, text.getvalue()


@pytest.mark.slow
def test_the_study_writes_figures_and_table(
    solutions: dict[clemen_rupp.Case, trajopt.Solution],
    front: trajopt.Front,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    code, text = run(monkeypatch, solutions, front, tmp_path / "demo")
    assert code == 0
    written = {path.name: path for path in (tmp_path / "demo").iterdir()}
    figures = {
        "fig1_velocity.png",
        "fig2_acceleration.png",
        "fig3_jerk.png",
        "fig4_power.png",
        "fig5_time.png",
        "fig6_equal_weights.png",
        "fig7_pareto_front.png",
    }
    assert set(written) == {"tables_2_and_3.csv", "fig7_pareto_front.csv"} | figures
    assert all(f"wrote {path}" in text for path in written.values())
    assert all(written[name].stat().st_size > 30_000 for name in figures)
    assert len(pd.read_csv(written["tables_2_and_3.csv"])) == 15
    assert "velocity L1: no unique optimum" in text and "not as published" not in text


@pytest.mark.slow
def test_the_study_fails_when_an_entry_differs_or_a_case_is_unsolved(
    solutions: dict[clemen_rupp.Case, trajopt.Solution],
    front: trajopt.Front,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.setattr(clemen_rupp, "figures", lambda solutions, directory: [])
    wrong = dict(solutions)
    good = solutions["jerk_l2", "euler"]
    wrong["jerk_l2", "euler"] = replace(good, metrics={**good.metrics, "energy": 1.01 * good.metrics["energy"]})
    code, text = run(monkeypatch, wrong, front, tmp_path)
    assert code == 3 and "not as published: jerk L2: energy 2.8243, printed 2.80" in text
    lost = dict(solutions)
    lost["power_l2", "exact"] = trajopt.Solution(trajopt.Verdict.LIMIT, good.problem, good.route, message="time limit")
    code, text = run(monkeypatch, lost, front, tmp_path)
    assert code == 3 and "not solved: power_l2 exact: LIMIT, time limit" in text
