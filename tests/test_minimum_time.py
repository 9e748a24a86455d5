"""Minimum time: against closed forms, by the search over convex programs and by Ipopt with a free step."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
import pytest

import trajopt
from tests.conftest import axis, solved
from tests.reference import closed_forms as known

LIMITS = {"velocity": 0.5, "acceleration": 4.905, "jerk": 98.1}  # Clemen & Rupp 2023, Table I
FOUND = 2e-7  # relative: how close the search comes, with room to keep the limits between nodes


def shortest(distance: float = 0.254, intervals: int = 40, **changes: Any) -> trajopt.Problem:
    """A minimum-time move, by the search over fixed times unless another solver is named."""
    return axis("time", time="free", distance=distance, intervals=intervals, **{"solver": "clarabel", **changes})


@pytest.mark.parametrize("intervals", [8, 16, 40])
def test_s_curve_with_all_switches_on_the_mesh(intervals: int) -> None:
    """v/a = 0.2, a/j = 0.1, D/v = 0.5: switches at eighths."""
    problem = shortest(0.1, intervals, limits={"velocity": 0.2, "acceleration": 1.0, "jerk": 10.0})
    assert known.s_curve_time(0.1, 0.2, 1.0, 10.0) == pytest.approx(0.8, rel=1e-12)
    assert solved(problem).duration == pytest.approx(0.8, rel=FOUND)


def test_s_curve_without_a_stretch_of_constant_acceleration() -> None:
    """v < a²/j: ramps of 2 sqrt(v/j) = 0.5 s, half of the move."""
    problem = shortest(0.25, 16, limits={"velocity": 0.5, "acceleration": 100.0, "jerk": 8.0})
    assert solved(problem).duration == pytest.approx(known.s_curve_time(0.25, 0.5, 100.0, 8.0), rel=FOUND)


@pytest.mark.parametrize("distance", [0.3, 0.1, 0.04], ids=["trapezoid", "just-trapezoid", "triangle"])
def test_velocity_and_acceleration_limits_on_the_mesh(distance: float) -> None:
    """v = 0.2, a = 0.4, ramps of 0.5 s: a quarter, a half (of 1 s) or all of the move."""
    problem = shortest(distance, 40, limits={"velocity": 0.2, "acceleration": 0.4})
    assert solved(problem).duration == pytest.approx(known.trapezoid_time(distance, 0.2, 0.4), rel=FOUND)


def test_trapezoid_between_nodes() -> None:
    exact = known.trapezoid_time(0.254, 0.5, 4.905)
    limits = {"velocity": 0.5, "acceleration": 4.905}
    meshes = np.array([20, 40, 80])
    found = np.array([solved(shortest(intervals=int(n), limits=limits)).duration / exact - 1 for n in meshes])
    assert np.all(found > 0)
    assert -np.polyfit(np.log(meshes), np.log(found), 1)[0] == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("distance", list(known.CLEMEN_RUPP_TIMES))
def test_the_distances_of_clemen_and_rupp(distance: float) -> None:
    """Never faster than the closed form, and within 4/N² of it wherever the switches fall between the nodes."""
    exact = known.CLEMEN_RUPP_TIMES[distance]
    for intervals in (50, 150):
        excess = solved(shortest(distance, intervals, limits=LIMITS)).duration / exact - 1
        assert -FOUND < excess < 4 / intervals**2


def test_closed_forms_agree_with_the_typed_times() -> None:
    assert known.s_curve_time(0.254, 0.5, 4.905, 98.1) == pytest.approx(known.CLEMEN_RUPP_TIMES[0.254], rel=1e-9)
    by_jerk_alone = (32 * 0.005 / 98.1) ** (1 / 3)  # T³ = 32 D/j
    assert by_jerk_alone == pytest.approx(known.CLEMEN_RUPP_TIMES[0.005], rel=1e-9)


def test_force_limit() -> None:
    """2 sqrt(D m/F)."""
    problem = shortest(0.5, limits={"force": 20.0}, load={"inertia": 2.0})
    assert solved(problem).duration == pytest.approx(2 * sqrt(0.5 * 2.0 / 20.0), rel=FOUND)


@pytest.mark.parametrize("way", [1, -1])
def test_force_limit_with_coulomb_friction_one_way(way: int) -> None:
    """(F+Fc)/(2F) = 5/8 of the time forth: a node of 40 intervals."""
    velocity = (0.0, 100.0) if way > 0 else (-100.0, 0.0)
    problem = shortest(way * 0.5, limits={"velocity": velocity, "force": 20.0}, load={"inertia": 2.0, "coulomb": 5.0})
    assert solved(problem).duration == pytest.approx(known.coulomb_time(0.5, 20.0, 2.0, 5.0), rel=FOUND)


def test_force_limit_with_viscous_friction() -> None:
    """First order: friction grows over a step of constant acceleration, so that the limit is met at its end only."""
    exact = known.viscous_time(0.5, 20.0, 2.0, 8.0)
    meshes = np.array([20, 40, 80])
    load = {"inertia": 2.0, "viscous": 8.0}
    found = [solved(shortest(0.5, int(n), limits={"force": 20.0}, load=load)).duration / exact - 1 for n in meshes]
    assert min(found) > 0
    assert -np.polyfit(np.log(meshes), np.log(found), 1)[0] == pytest.approx(1.0, abs=0.06)
    assert found[-1] < 6e-3


CASES: dict[str, dict[str, Any]] = {
    "acceleration": {"limits": {"velocity": 0.5, "acceleration": 4.905}},
    "jerk": {"limits": LIMITS},
    "snap": {"limits": {**LIMITS, "snap": 4000.0}},
    "asymmetric": {"limits": {"velocity": (-0.1, 0.5), "acceleration": (-3.0, 4.905), "jerk": 98.1}},
    "moving-start": {"limits": LIMITS, "start": {"velocity": 0.2, "acceleration": 1.0}},
    "moving-end": {"limits": LIMITS, "end": {"velocity": 0.3}},
    "backwards": {"limits": LIMITS, "distance": -0.254},
    "force": {"limits": {**LIMITS, "force": 30.0}, "load": {"inertia": 10.0, "viscous": 2.0}},
    "coulomb": {
        "limits": {"velocity": (0.0, 0.5), "jerk": 98.1, "force": 30.0},
        "load": {"inertia": 10.0, "viscous": 2.0, "coulomb": 4.0},
    },
    "euler": {"limits": LIMITS, "scheme": "euler"},
}


@pytest.mark.parametrize("case", list(CASES))
def test_search_and_free_step_agree(case: str) -> None:
    """Two formulations, two models, two solvers: the same duration to 1e-7."""
    search = solved(shortest(**CASES[case]))
    step = solved(shortest(**CASES[case], solver="ipopt"))
    assert (search.route.model, step.route.model) == ("cvxpy", "pyomo")
    assert step.duration == pytest.approx(search.duration, rel=1e-7)
    assert (search.status, step.status) == (trajopt.Verdict.SOLVED, trajopt.Verdict.SOLVED_LOCAL)


def test_the_bound_on_the_duration_is_below_and_close() -> None:
    solution = solved(shortest(limits=LIMITS))
    assert 0 < solution.duration - solution.certificate["lower_bound"] <= 2e-7 * solution.duration


@pytest.mark.parametrize("solver", ["auto", "ipopt"])
def test_a_range_of_times_that_excludes_the_shortest(solver: str) -> None:
    """Waiting is possible, so the shortest allowed time is taken."""
    problem = axis("time", time=(0.8, 2.0), distance=0.254, limits=LIMITS, intervals=40, solver=solver)
    assert solved(problem).duration == pytest.approx(0.8, rel=1e-7)


def test_time_weighed_against_smoothness() -> None:
    """min T + w·(rms j): rms j = 26.9 D/T³ here, so T⁴ = 3·26.9 w D, independent of how Ipopt gets there."""
    weight, intervals = 1e-3, 30
    problem = axis(
        [trajopt.Term(minimize="time"), trajopt.Term(minimize="jerk", norm="l2", weight=weight)],
        time="free",
        distance=0.3,
        intervals=intervals,
    )
    solution = solved(problem)
    rms = sqrt(known.least_square(3, intervals))
    assert solution.duration == pytest.approx((3 * weight * rms * 0.3) ** 0.25, rel=1e-6)


@pytest.mark.parametrize("solver", ["auto", "ipopt"])
def test_a_range_of_times_that_is_too_short(solver: str) -> None:
    """0.66 s are needed: no numbers, and never SOLVED."""
    problem = axis("time", time=(0.3, 0.6), distance=0.254, limits=LIMITS, intervals=40, solver=solver)
    solution = trajopt.solve(problem)
    assert not solution.status.solved
    assert solution.duration is None
    if solver == "auto":
        assert solution.status in (trajopt.Verdict.IMPOSSIBLE, trajopt.Verdict.IMPOSSIBLE_ON_GRID)
