"""Minimum time by switching times: exact, proven, checked, priced; and what happens where there are none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import trajopt
from tests.conftest import axis, solved
from trajopt.verdict import Verdict

S_LIMITS = {"velocity": 0.5, "acceleration": 4.905, "jerk": 98.1}
A3 = {"velocity": 1.0, "acceleration": 20.0, "jerk": 1000.0, "snap": 1e5}


def shortest(distance: float = 0.254, **changes: Any) -> trajopt.Problem:
    return axis("time", time="free", distance=distance, **changes)


SNAP = [
    (10.0, {"velocity": 1.0, "snap": 1.0}, 13.170782519490599, 13.174802103936399),
    (0.3, A3, 0.37998685322106738, 0.38),
    (40.0, {"velocity": 4.0, "acceleration": 1.5, "jerk": 1.0, "snap": 1.0}, 15.164534602867765, 15.166666666666667),
    (0.01, A3, 0.08034787028105637, 0.08465373194496847),
    (0.01, {"snap": 1e5}, (384 * 0.01 / 1e5) ** 0.25, (512 * 0.01 / 1e5) ** 0.25),
]


@pytest.mark.parametrize(("distance", "limits", "least", "s_curve"), SNAP)
def test_snap_limited_moves(distance: float, limits: dict[str, float], least: float, s_curve: float) -> None:
    solution = solved(shortest(distance, limits=limits))
    assert solution.status is Verdict.SOLVED and solution.route.model == "arcs"
    assert solution.duration == pytest.approx(least, rel=1e-9)
    low, high = solution.structure["bracket"]
    assert low <= least * (1 + 1e-12) and high == solution.duration
    assert solution.certificate["bounds"] == "every move in continuous time"
    assert solution.structure["s_curve"]["duration"] == pytest.approx(s_curve, rel=1e-12)
    assert solution.structure["s_curve"]["loss"] == pytest.approx(s_curve / least - 1, rel=1e-5)


MOVING = [  # v0 a0 pf vf af vmin vmax amin amax j, least time
    (-0.5, 0.8, 1.04, 0.54, -0.37, -1.79, 1.11, -1.94, 1.52, 3.76, 1.9483442630157684),
    (0.69, 0.23, -4.46, 0.68, 0.64, -1.89, 1.35, -1.69, 1.28, 1.69, 5.792630075297437),
    (-0.01, -0.68, -0.81, 0.05, -0.22, -1.78, 1.32, -1.69, 1.64, 4.57, 1.7781605884595963),
    (0.72, 0.71, -4.07, 0.41, -0.65, -1.5, 1.78, -1.73, 1.38, 3.44, 5.871399854849041),
    (0.77, -0.5, -1.79, -0.64, -0.78, -1.53, 1.54, -1.3, 1.44, 1.58, 3.778862565129892),
]


@pytest.mark.parametrize("row", MOVING)
def test_moving_ends_and_asymmetric_limits(row: tuple[float, ...]) -> None:
    v0, a0, distance, vf, af, *limits, jerk, least = row
    ends = {"start": {"velocity": v0, "acceleration": a0}, "end": {"velocity": vf, "acceleration": af}}
    given = {"velocity": tuple(limits[:2]), "acceleration": tuple(limits[2:]), "jerk": jerk}
    solution = solved(shortest(distance, limits=given, **ends))
    assert solution.duration == pytest.approx(least, rel=1e-12)
    assert "enumeration" in solution.certificate["bounds"]
    assert trajopt.check(solution.to_dict(), strict=True).passed


def test_the_arcs_say_where_the_limits_are() -> None:
    solution = solved(shortest(limits=S_LIMITS, intervals=20))
    arcs = solution.structure["arcs"]
    assert [arc["limit"] for arc in arcs] == [
        "jerk.max", "acceleration.max", "jerk.min", "velocity.max", "jerk.min", "acceleration.min", "jerk.max",
    ]  # fmt: skip
    for before, after in zip(arcs, arcs[1:], strict=False):
        assert before["to"] == after["from"]
    cruise = arcs[3]
    inside = solution.at(np.linspace(cruise["from"], cruise["to"], 20))
    np.testing.assert_allclose(inside["velocity"], 0.5, rtol=1e-12)
    at_switches = [arc["to"] for arc in arcs[:-1]]
    assert np.min(np.abs(solution.frame["time"].to_numpy()[:, None] - at_switches), axis=0).max() < 1e-15
    assert len(solution.frame) >= 21


def test_limits_hold_at_every_instant_of_a_chattering_move() -> None:
    solution = solved(shortest(0.3, limits=A3))
    assert solution.structure["chatters"] and len(solution.structure["touches"]) >= 2
    report = trajopt.check(solution.to_dict(), strict=True)
    assert report.passed, report.summary()
    period = solution.sampled(1e-3)  # as a controller samples it
    assert period["time"].iloc[-1] == solution.duration and len(period) == 381
    for name, limit in A3.items():
        assert np.max(np.abs(period[name])) <= limit * (1 + 1e-9)
    with pytest.raises(ValueError, match="period: must be > 0"):
        solution.sampled(1.0)


@pytest.mark.parametrize("limits", [{"velocity": 1.0, "snap": 1.0}, {"velocity": 1.0, "jerk": 2.0, "snap": 1.0}])
def test_chattering_is_cut_off_where_asked_and_its_loss_is_certified(limits: dict[str, float]) -> None:
    ideal = solved(shortest(10.0, limits=limits))
    problem = ideal.problem
    grid = problem.transcription
    durations = []
    for touches in (0, 1, 2):
        cut = solved(problem.replace(transcription=grid.model_copy(update={"touches": touches})))
        assert cut.duration > ideal.duration * (1 - 1e-12)
        assert cut.structure["bracket"][0] <= ideal.duration
        durations.append(cut.duration)
    assert durations[0] >= durations[1] >= durations[2]
    assert durations[1] == pytest.approx(ideal.duration, rel=1e-6)
    slow = solved(problem.replace(transcription=grid.model_copy(update={"min_dwell": 0.1})))
    arcs = slow.structure["arcs"]
    assert min(arc["to"] - arc["from"] for arc in arcs) >= 0.1
    assert slow.duration < ideal.structure["s_curve"]["duration"]


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e6])
def test_units_do_not_matter(scale: float) -> None:
    base = solved(shortest(0.3, limits=A3)).duration
    scaled = {name: limit * scale for name, limit in A3.items()}
    assert solved(shortest(0.3 * scale, limits=scaled)).duration == pytest.approx(base, rel=1e-11)
    assert solved(shortest(-0.3, limits=A3)).duration == pytest.approx(base, rel=1e-11)


def test_a_force_limit_is_an_acceleration_limit() -> None:
    force = solved(shortest(0.5, limits={"velocity": 1.0, "force": 20.0}, load={"inertia": 4.0}))
    plain = solved(shortest(0.5, limits={"velocity": 1.0, "acceleration": 5.0}))
    assert force.route.model == "arcs" and force.duration == pytest.approx(plain.duration, rel=1e-12)
    assert {price["name"] for price in force.prices if price["per_unit"]} == {"velocity", "force"}
    one_way = {"velocity": (0.0, 1.0), "force": 20.0}
    friction = solved(shortest(0.5, limits=one_way, load={"inertia": 4.0, "coulomb": 4.0}))
    assert friction.route.model == "arcs" and friction.metrics["peak_force"] <= 20.0 * (1 + 1e-9)
    viscous = shortest(0.5, limits={"force": 20.0}, load={"inertia": 4.0, "viscous": 4.0})
    assert trajopt.route(viscous).model == "cvxpy"


def test_what_is_no_chain_is_searched_on_the_mesh() -> None:
    for problem in (
        shortest(limits={**S_LIMITS, "power": 1.0}, load={"inertia": 1.0}, intervals=30),
        shortest(limits={"velocity": 0.5, "jerk": 9.0, "position": (-1.0, 0.2540001)}, intervals=30),
        shortest(limits=S_LIMITS, scheme="euler", intervals=30),
    ):
        assert solved(problem).duration is not None
    assert trajopt.route(shortest(limits=S_LIMITS, scheme="euler")).model == "cvxpy"


def test_a_direction_that_the_limits_forbid_is_impossible() -> None:
    solution = trajopt.solve(shortest(-0.254, limits={**S_LIMITS, "velocity": (0.0, 0.5)}))
    assert solution.status is Verdict.IMPOSSIBLE and solution.duration is None
    assert "no move covers -0.254" in solution.explanation["text"][0]


def test_a_power_limit_that_stays_inactive_leaves_the_arcs() -> None:
    solution = solved(shortest(limits={**S_LIMITS, "power": 100.0}, load={"inertia": 10.0}))
    assert solution.route.model == "arcs" and solution.status is Verdict.SOLVED
    limited = solved(shortest(limits={**S_LIMITS, "power": 5.0}, load={"inertia": 10.0}, intervals=40))
    assert limited.duration > solution.duration and limited.metrics["peak_power"] <= 5.0 * (1 + 1e-6)


@pytest.mark.parametrize("limits", [A3, {name: A3[name] for name in ("velocity", "acceleration", "jerk")}])
@pytest.mark.parametrize("distance", [30.0, 1000.0])
def test_long_cruises_do_not_drift(distance: float, limits: dict[str, float]) -> None:
    solution = solved(shortest(distance, limits=limits))
    assert solution.route.model == "arcs" and solution.status is Verdict.SOLVED
    assert solution.duration == pytest.approx(distance + (0.08 if "snap" in limits else 0.07), rel=1e-6)
    assert trajopt.check(solution.to_dict(), strict=True).passed


def test_a_dwell_that_no_move_keeps_is_not_put_aside() -> None:
    problem = shortest(0.3, limits=A3)
    grid = problem.transcription.model_copy(update={"min_dwell": 10.0})
    solution = trajopt.solve(problem.replace(transcription=grid))
    assert solution.status is Verdict.UNDECIDED and "spacing" in solution.message


def test_a_move_that_ends_in_its_first_state_is_refused() -> None:
    moving = {"velocity": 0.5}
    with pytest.raises(trajopt.BadInput, match="in the state in which it starts"):
        shortest(0.0, limits=S_LIMITS, start=moving, end=moving)


def test_a_velocity_that_may_not_rest_is_no_bug() -> None:
    limits = {"velocity": (0.5, 4.0), "snap": 10.0}
    ends = {"velocity": 1.0}
    solution = trajopt.solve(shortest(1.0, limits=limits, start=ends, end=ends, intervals=30))
    assert solution.status.solved
    assert solution.metrics["peak_velocity"] <= 4.0 * (1 + 1e-9)


def test_vibration_with_a_time_that_is_no_search_is_refused() -> None:
    problem = shortest(0.3, limits={**S_LIMITS, "power": 4.0}, load={"inertia": 10.0}, intervals=20)
    quiet = problem.replace(vibration=(trajopt.Vibration(frequency=3.0),))
    with pytest.raises(trajopt.BadInput, match="vibration: a free time"):
        trajopt.solve(quiet)
    moving = shortest(0.3, limits=S_LIMITS, start={"velocity": 0.1}, end={"velocity": 0.3}, intervals=20)
    with pytest.raises(trajopt.BadInput, match="vibration: a free time"):
        trajopt.solve(moving.replace(vibration=(trajopt.Vibration(frequency=3.0),)))


def test_chattering_with_a_moving_end_is_said() -> None:
    limits = {"velocity": 1.0, "acceleration": 1.5, "jerk": 4.0, "snap": 20.0}
    solution = solved(shortest(6.0, limits=limits, start={"velocity": 1.0}))
    assert solution.route.model == "arcs" and solution.structure["chatters"]
    assert len(solution.plot_arcs()) == 2  # with the panel over the logarithm of time


def test_time_may_run_backwards() -> None:
    """Forwards no structure is found for the second; it is the first, run backwards."""
    limits = {"velocity": 1.0, "acceleration": 1.5, "jerk": 4.0, "snap": 20.0}
    first = solved(shortest(6.0, limits=limits, start={"velocity": 1.0}))
    second = solved(shortest(6.0, limits=limits, end={"velocity": 1.0}))
    assert first.route.model == second.route.model == "arcs"
    assert second.duration == pytest.approx(first.duration, rel=1e-9)
    assert second.duration == pytest.approx(6.6206426, rel=1e-7)
    assert trajopt.check(second.to_dict(), strict=True).passed


def test_a_stiff_snap_limit_with_moving_ends_is_exact() -> None:
    limits = {"velocity": 1.0, "acceleration": 2.0, "jerk": 20.0, "snap": 5e4}
    ends: dict[str, Any] = {"start": {"velocity": 0.3}, "end": {"velocity": -0.4}}
    stiff = solved(shortest(1.5, limits=limits, intervals=80, **ends))
    third = solved(shortest(1.5, limits={k: x for k, x in limits.items() if k != "snap"}, **ends))
    assert stiff.route.model == "arcs"
    assert stiff.certificate["lower_bound"] == pytest.approx(stiff.duration, rel=1e-8)
    assert third.duration < stiff.duration <= third.duration * 1.001
    assert trajopt.check(stiff.to_dict()).passed


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("jerk", [None, 60.0])
def test_friction_gives_no_reason_to_turn_back(way: float, jerk: float | None) -> None:
    """Between rests the least time of both directions is that of one."""
    limits: dict[str, Any] = {"velocity": 1.0, "force": 20.0} | ({"jerk": jerk} if jerk else {})
    load = {"inertia": 4.0, "coulomb": 4.0}
    both = solved(shortest(0.5 * way, limits=limits, load=load))
    one = solved(shortest(0.5 * way, limits=limits | {"velocity": (0.0, 1.0) if way > 0 else (-1.0, 0.0)}, load=load))
    assert both.route.model == "arcs" and both.duration == pytest.approx(one.duration, rel=1e-12)
    assert both.certificate["gap"] < 1e-8
    assert trajopt.check(both.to_dict(), strict=True).passed


RUNNING = {"velocity": 1.0}
RUN: dict[str, Any] = {  # possible from 0.9 s to 1.28344 s, and again from 3.11709 s
    "distance": 1.0,
    "limits": {"velocity": 1.2, "acceleration": 1.0, "jerk": 5.0},
    "start": RUNNING,
    "end": RUNNING,
    "intervals": 60,
}


@pytest.mark.parametrize(
    ("time", "least"),
    [((0.5, 2.0), 0.9), ((0.5, 9.0), 0.9), ((1.1, 5.0), 1.1), ((2.0, 5.0), 3.11709), ((4.0, 5.0), 4.0)],
)
def test_a_range_around_blocked_times(time: tuple[float, float], least: float) -> None:
    solution = solved(axis("time", time=time, **RUN))
    assert solution.duration == pytest.approx(least, rel=2e-3) and solution.duration >= least * (1 - 1e-5)
    assert solution.certificate["gap"] < 1e-6


@pytest.mark.parametrize("time", [(0.3, 0.8), (1.5, 3.0)])
def test_a_range_of_blocked_times(time: tuple[float, float]) -> None:
    solution = trajopt.solve(axis("time", time=time, **RUN))
    assert solution.status in (Verdict.IMPOSSIBLE, Verdict.IMPOSSIBLE_ON_GRID) and solution.duration is None
    assert solution.explanation["text"]
