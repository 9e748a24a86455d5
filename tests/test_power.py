"""The cone bound of power and energy: published gaps, agreement with Ipopt, and never above what Ipopt finds."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from tests.conftest import axis, solved, table_i, term
from trajopt import power
from trajopt.attempt import Clock
from trajopt.transcribe import Setting

MIXTURE = [term("energy", weight=0.5), term("power", "linf", weight=0.5)]
TABLE_I_GAPS = [  # exact scheme, N = 200: the objective (computed independently), the gap to certify
    ("power", "l2", np.sqrt(1.85727772), 1e-4),
    ("power", "linf", 1.68200675, 5e-4),
    ("energy", None, 0.811147924, 1e-8),
    (MIXTURE, None, 0.5 * 1.222303 + 0.5 * 1.814183, 1e-3),
]


@pytest.mark.parametrize(("minimize", "norm", "value", "gap"), TABLE_I_GAPS, ids=["l2", "linf", "energy", "mixture"])
def test_value_and_gap_on_the_axis_of_table_i(minimize: object, norm: str | None, value: float, gap: float) -> None:
    solution = solved(table_i(minimize, norm))  # type: ignore[arg-type]
    assert solution.route.model == "cvxpy"
    assert solution.objective == pytest.approx(value, rel=1e-6 if minimize is MIXTURE else 1e-7)
    assert solution.certificate["gap"] <= gap


@pytest.mark.parametrize("seed", range(9))
def test_tangents_bound_nearly_as_well_as_squares(seed: int) -> None:
    """The quadratic programs of the relaxation lie below its cone program, and no farther than a part of the gap."""
    rng = np.random.default_rng([3, seed])
    limits = {"velocity": (0.0, rng.uniform(0.3, 0.6)), "acceleration": rng.uniform(3.0, 9.0)}
    limits["jerk"] = rng.uniform(60.0, 400.0)
    load = {"inertia": 10.0} | ({"viscous": 4.0, "coulomb": 2.0} if seed % 3 == 2 else {})
    objective = ([term("power", "l2")], [term("power", "linf")], MIXTURE)[seed % 3]
    setting = Setting.of(axis(objective, distance=0.254, limits=limits, load=load, intervals=60))
    relaxed, answer = power.optimum(setting, Clock())
    cones = power.relax(setting, Clock())
    assert relaxed.bound <= cones.bound + 1e-7 * answer.value
    assert cones.bound - relaxed.bound <= 0.05 * (answer.value - cones.bound) + 1e-7 * answer.value


def test_energy_closes_the_gap_and_is_solved_globally() -> None:
    assert solved(table_i("energy")).status is trajopt.Verdict.SOLVED


@pytest.mark.parametrize("seed", range(12))
def test_the_bound_lies_below_ipopt_and_the_descent_agrees_with_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time, distance = rng.uniform(0.5, 3.0), rng.uniform(0.05, 2.0)
    mean = distance / time
    limits = {
        "velocity": (0.0, mean * rng.uniform(1.6, 4.0)),
        "acceleration": mean / time * rng.uniform(8.0, 40.0),
        "jerk": mean / time**2 * rng.uniform(80.0, 900.0),
    }
    load = {"inertia": 2.0} | ({"viscous": 0.3, "coulomb": 0.2} if seed % 3 == 0 else {})
    minimize, norm = (("power", "l2"), ("power", "linf"), ("energy", None))[seed % 3]
    given = {"distance": distance, "time": time, "limits": limits, "load": load, "intervals": 60}
    ours, ipopt = (solved(axis(minimize, norm, solver=solver, **given)) for solver in ("auto", "ipopt"))  # type: ignore[arg-type]
    assert ours.objective is not None and ipopt.objective is not None
    assert ours.certificate["lower_bound"] <= min(ours.objective, ipopt.objective) * (1 + 1e-8)
    assert ours.objective <= ipopt.objective * (1 + 1e-6)
    if not load.get("viscous"):
        assert ours.certificate["gap"] <= 5e-3


@pytest.mark.parametrize("limits", [{"velocity": (0.0, 0.5)}, {"velocity": (0.0, 0.5), "acceleration": 4.0}])
@pytest.mark.filterwarnings("error")
def test_missing_limits_leave_the_reach_open(limits: dict[str, object]) -> None:
    terms = [term("energy"), term("jerk", "l2", weight=0.01)]
    solution = solved(axis(terms, distance=0.254, limits=limits, load={"inertia": 10.0}, intervals=60))
    assert solution.certificate["lower_bound"] <= solution.objective


def test_backwards_costs_what_forwards_costs() -> None:
    limits = {"acceleration": 4.905, "jerk": 98.1}
    there = solved(table_i("power", "linf", limits=limits | {"velocity": (0.0, 0.5)}, intervals=60))
    back = solved(table_i("power", "linf", limits=limits | {"velocity": (-0.5, 0.0)}, distance=-0.254, intervals=60))
    assert back.objective == pytest.approx(there.objective, rel=1e-8)
    assert back.certificate["lower_bound"] == pytest.approx(there.certificate["lower_bound"], rel=1e-8)


def test_reversing_moves_say_that_no_bound_is_known() -> None:
    solution = solved(
        table_i("power", "linf", limits={"velocity": 0.5, "acceleration": 4.905, "jerk": 98.1}, intervals=40)
    )
    assert solution.certificate["lower_bound"] is None and "no bound known" in solution.certificate["bounds"]


@pytest.mark.slow
@pytest.mark.parametrize("norm", ["l2", "linf"])
def test_tightening_closes_the_gap(norm: str) -> None:
    problem = table_i("power", norm)
    loose = solved(problem)
    transcription = problem.transcription.model_copy(update={"tighten": True})
    tight = solved(problem.replace(transcription=transcription))
    assert tight.objective == pytest.approx(loose.objective, rel=1e-9)
    assert loose.certificate["gap"] > 1e-5 > 1e-6 >= tight.certificate["gap"]
    assert loose.certificate["lower_bound"] < tight.certificate["lower_bound"] <= tight.objective * (1 + 1e-9)
    assert tight.status is trajopt.Verdict.SOLVED


def test_a_power_limit_that_cannot_be_kept_is_explained_with_a_cure_that_works() -> None:
    tight = table_i("jerk", "l2", limits={"velocity": (0.0, 0.5), "jerk": 98.1, "power": 1.0}, intervals=40)
    solution = trajopt.solve(tight)
    assert solution.status is trajopt.Verdict.IMPOSSIBLE_ON_GRID
    enough = solution.explanation["limits"]["power"]["value"]
    assert solved(tight.with_limit("power", enough)).metrics["peak_power"] <= enough * (1 + 1e-9)
    assert not trajopt.solve(tight.with_limit("power", enough * 0.999)).status.solved
