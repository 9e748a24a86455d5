"""Optima known in closed form: discrete ones to rounding, continuous ones at the order with which they are approached.

The exact scheme restricts the top derivative to steps, so its optima approach the continuous ones from above (a subset
of the moves, unless a signal is sampled by the norm), with order 2 where the optimal top derivative is smooth and on
average where it switches between mesh nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import sqrt
from typing import Any

import numpy as np
import pytest

import trajopt
from tests.conftest import axis, solved
from tests.reference import closed_forms as known

DOUBLINGS = (20, 40, 80, 160)
HELD = 3e-8  # relative: a tie-breaking solve gives way by up to 1e-8


def errors(make: Callable[[int], trajopt.Problem], exact: float, meshes: Sequence[int]) -> np.ndarray:
    """Relative errors of the objective over a row of meshes."""
    return np.array([solved(make(n)).objective / exact - 1 for n in meshes])


def order(errors: np.ndarray, meshes: Sequence[int]) -> float:
    """Observed order: the slope of log error over log step."""
    return float(-np.polyfit(np.log(meshes), np.log(np.abs(errors)), 1)[0])


def assert_second_order(make: Callable[[int], trajopt.Problem], exact: float, within: float = 0.03) -> None:
    """Errors fall by four at each doubling, towards zero."""
    found = errors(make, exact, DOUBLINGS)
    assert np.all(found > 0), "a restriction to steps cannot be better"
    assert order(found, DOUBLINGS) == pytest.approx(2.0, abs=within)
    assert found[-1] < 2e-3


# --- the smoothest moves -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("intervals", [8, 9, 50, 400])
@pytest.mark.parametrize("m", [2, 3, 4])
def test_discrete_optimum_to_rounding(m: int, intervals: int) -> None:
    """∫u² = T·rms² = c·∏ N²/(N²-i²), for any N."""
    solution = solved(axis(known.SMOOTHEST[m][0], "l2", intervals=intervals))
    assert solution.objective**2 == pytest.approx(known.least_square(m, intervals), rel=1e-9)


@pytest.mark.parametrize("m", [2, 3])
def test_discrete_optimum_against_typed_numbers(m: int) -> None:
    solution = solved(axis(known.SMOOTHEST[m][0], "l2", intervals=8))
    assert solution.objective**2 == pytest.approx(known.LEAST_SQUARE_AT_8[m], rel=1e-9)


@pytest.mark.parametrize("m", [2, 3, 4])
def test_smoothest_profiles_and_their_peak_velocity(m: int) -> None:
    name, square, peak = known.SMOOTHEST[m]
    solutions = [solved(axis(name, "l2", intervals=n)) for n in DOUBLINGS]
    value = np.array([s.objective**2 / square - 1 for s in solutions])
    velocity = np.array([s.metrics["peak_velocity"] / peak - 1 for s in solutions])
    u = np.linspace(0.0, 1.0, 1001)
    ideal = sum(c * u**k for k, c in known.PROFILES[m].items())
    position = np.array([np.max(np.abs(s.at(u)["position"] - ideal)) for s in solutions])
    for found in (value, velocity, position):
        assert order(found, DOUBLINGS) == pytest.approx(2.0, abs=0.05)
    assert position[-1] < 1e-4


def test_smoothest_move_scales_with_distance_and_time() -> None:
    """∫j² ~ D²/T⁵."""
    solution = solved(axis("jerk", "l2", distance=-0.3, time=0.2, intervals=40))
    assert 0.2 * solution.objective**2 == pytest.approx(known.least_square(3, 40) * 0.3**2 / 0.2**5, rel=1e-9)


# --- Bryson and Denham ---------------------------------------------------------------------------------------------


def _bryson_denham(highest: float, intervals: int) -> trajopt.Problem:
    return axis(
        "acceleration",
        "l2",
        distance=0.0,
        start={"velocity": 1.0},
        end={"velocity": -1.0},
        limits={"position": {"max": highest}},
        intervals=intervals,
    )


@pytest.mark.parametrize("intervals", [8, 50])
@pytest.mark.parametrize("highest", [0.3, 0.25])
def test_bryson_denham_untouched(highest: float, intervals: int) -> None:
    """A constant acceleration: exact on any mesh."""
    solution = solved(_bryson_denham(highest, intervals))
    assert solution.objective**2 / 2 == pytest.approx(known.bryson_denham(highest), rel=1e-7)


@pytest.mark.parametrize("highest", [0.22, 0.18, 0.1, 0.05], ids=["touch", "touch-deep", "arc", "arc-long"])
def test_bryson_denham_touching_and_on_the_limit(highest: float) -> None:
    assert_second_order(lambda n: _bryson_denham(highest, n), sqrt(2 * known.bryson_denham(highest)), within=0.12)


# --- least peaks ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name, factor, intervals",
    [("acceleration", 4.0, 8), ("acceleration", 4.0, 50), ("jerk", 32.0, 8), ("jerk", 32.0, 40)],
)
def test_least_peak_with_switches_on_the_mesh(name: str, factor: float, intervals: int) -> None:
    """4 D/T² and 32 D/T³: the switches, at halves and quarters, are nodes."""
    solution = solved(axis(name, "linf", distance=0.3, time=0.5, intervals=intervals))
    power = {"acceleration": 2, "jerk": 3}[name]
    assert solution.objective == pytest.approx(factor * 0.3 / 0.5**power, rel=HELD)


def test_least_peak_jerk_with_switches_between_nodes() -> None:
    meshes = (21, 41, 81, 161)
    found = errors(lambda n: axis("jerk", "linf", intervals=n), 32.0, meshes)
    assert np.all(found > 0)
    assert order(found, meshes) == pytest.approx(2.0, abs=0.2)


def test_least_peak_velocity_with_acceleration_and_jerk_limits() -> None:
    meshes = (20, 40, 80, 160, 320)
    exact = known.least_peak_velocity(0.254, 1.0, 4.905, 98.1)
    assert exact == pytest.approx(0.284771698055, rel=1e-11)  # power_energy.md
    limits = {"acceleration": 4.905, "jerk": 98.1}
    found = errors(lambda n: axis("velocity", "linf", distance=0.254, limits=limits, intervals=n), exact, meshes)
    assert np.all(found > 0)
    assert order(found, meshes) == pytest.approx(2.3, abs=0.5)  # the switches fall anywhere between nodes
    assert found[-1] < 5e-5


def test_least_peak_velocity_with_ramps_on_the_mesh() -> None:
    """D = 0.16, T = 1, a = 1: ramps of 0.2 s, five nodes each."""
    problem = axis("velocity", "linf", distance=0.16, limits={"acceleration": 1.0}, intervals=25)
    assert solved(problem).objective == pytest.approx(known.least_peak_velocity(0.16, 1.0, 1.0), rel=HELD)
    assert known.least_peak_velocity(0.16, 1.0, 1.0) == pytest.approx(0.2, rel=1e-12)


# --- power and energy ----------------------------------------------------------------------------------------------


def test_least_energy_is_mass_times_peak_velocity_squared() -> None:
    """min ∫|P|dt = m v_peak²; with ramps on the mesh it is the closed form itself."""
    limits = {"velocity": (0.0, 1.0), "acceleration": 1.0}
    problem = axis("energy", distance=0.16, limits=limits, load={"inertia": 3.0}, intervals=25)
    solution = solved(problem)
    assert solution.objective == pytest.approx(3.0 * 0.2**2, rel=1e-6)
    assert solution.metrics["peak_velocity"] == pytest.approx(0.2, rel=1e-6)


def test_least_energy_with_jerk_limit_approaches_the_closed_form() -> None:
    meshes = (25, 50, 100)
    exact = 10 * known.least_peak_velocity(0.254, 1.0, 4.905, 98.1) ** 2
    assert exact == pytest.approx(0.810949200133, rel=1e-11)  # power_energy.md
    limits = {"velocity": (0.0, 0.5), "acceleration": 4.905, "jerk": 98.1}
    found = errors(
        lambda n: axis("energy", distance=0.254, limits=limits, load={"inertia": 10.0}, intervals=n), exact, meshes
    )
    assert np.all(found > 0)
    assert order(found, meshes) == pytest.approx(2.0, abs=0.5)


@pytest.mark.parametrize("norm", ["linf", "l2"])
def test_power_without_other_limits(norm: str) -> None:
    """9/4 m D²/T³ and 125/36 m² D⁴/T⁵. Velocity leaves rest like the root of time, which steps of acceleration
    follow with first order only, times a logarithm for the peak."""
    meshes = (40, 80, 160)
    mass, distance, time = 2.0, 0.5, 0.8
    exact = {
        "linf": known.least_peak_power(mass, distance, time),
        "l2": sqrt(known.least_square_power(mass, distance, time) / time),
    }[norm]

    def make(n: int) -> trajopt.Problem:
        return axis("power", norm, distance=distance, time=time, load={"inertia": mass}, intervals=n)

    found = errors(make, exact, meshes)
    assert np.all(found > 0)
    assert order(found, meshes) == pytest.approx({"linf": 0.83, "l2": 0.97}[norm], abs=0.06)
    assert found[-1] < 0.06


def test_power_with_the_limits_of_the_paper() -> None:
    """Continuous optimum of power linf 1.681495190894 W (power_energy.md), approached with second order or so."""
    meshes = (50, 100, 200)
    limits = {"velocity": (0.0, 0.5), "acceleration": 4.905, "jerk": 98.1}
    found = errors(
        lambda n: axis("power", "linf", distance=0.254, limits=limits, load={"inertia": 10.0}, intervals=n),
        1.681495190894,
        meshes,
    )
    assert order(found, meshes) == pytest.approx(2.0, abs=0.5)
    assert 0 < found[-1] < 5e-4


# --- signals under a load, limits and via points -------------------------------------------------------------------


def test_least_square_acceleration_below_a_velocity() -> None:
    exact = sqrt(known.least_square_acceleration_below(1.2, 1.0, 1.0))
    assert_second_order(lambda n: axis("acceleration", "l2", limits={"velocity": 1.2}, intervals=n), exact, within=0.25)


def test_least_square_force_with_viscous_friction() -> None:
    exact = sqrt(known.least_square_viscous_force(2.0, 6.0, 1.0, 1.0))
    load = {"inertia": 2.0, "viscous": 6.0}
    assert_second_order(lambda n: axis("force", "l2", load=load, intervals=n), exact)


@pytest.mark.parametrize("at, position", [(0.4, 0.2), (0.37, 0.9)], ids=["on-the-mesh", "between-nodes"])
def test_minimum_jerk_through_a_via_point(at: float, position: float) -> None:
    via = (trajopt.Via(time=at, position=position),)
    exact = sqrt(known.minimum_jerk_through(position, at))
    assert_second_order(lambda n: axis("jerk", "l2", via=via, intervals=n), exact, within=0.05)


def test_via_point_is_met_to_rounding() -> None:
    via = (trajopt.Via(time=0.37, position=0.9, velocity=-0.5),)
    solution = solved(axis("jerk", "l2", via=via, intervals=50))
    state: dict[str, Any] = solution.at(0.37)
    assert state["position"] == pytest.approx(0.9, abs=1e-11)
    assert state["velocity"] == pytest.approx(-0.5, abs=1e-10)
