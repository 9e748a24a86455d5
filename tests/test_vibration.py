"""Residual vibration as rows: against a simulated oscillator, published commands, and the checker's own swinging."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import trajopt
from tests.conftest import axis, solved, table_i
from trajopt import checker, vibration

MODE = {"frequency": 4.0, "damping": 0.05}


def quiet(problem: trajopt.Problem, *modes: dict[str, Any]) -> trajopt.Problem:
    return problem.replace(vibration=tuple(trajopt.Vibration(**mode) for mode in modes))


@pytest.mark.parametrize(("minimize", "order"), [("acceleration", 2), ("jerk", 3), ("snap", 4)])
@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_the_rows_are_what_an_oscillator_does(minimize: str, order: int, damping: float) -> None:
    trajectory = solved(axis(minimize, "l2", intervals=12)).trajectory
    assert trajectory is not None and trajectory.order == order
    w = 2 * np.pi * 1.7

    def swing(t: float, y: np.ndarray) -> list[float]:
        a = float(trajectory.at(min(t, 1.0))["acceleration"])
        return [y[1], -a - 2 * damping * w * y[1] - w * w * y[0]]

    end = np.array([0.0, 0.0])
    for k in range(12):  # a step at a time: the acceleration may jump at nodes
        left, right = trajectory.time[k], trajectory.time[k + 1] * (1 - 1e-13)
        end = solve_ivp(swing, (left, right), end, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    x, rate = end
    amplitude = np.hypot(x, (rate + damping * w * x) / (w * np.sqrt(1 - damping**2)))
    assert vibration.residual(trajectory, 1.7, damping)[0] == pytest.approx(amplitude, rel=1e-8)


@pytest.mark.parametrize("minimize", ["acceleration", "jerk", "snap"])
def test_the_derivative_by_the_frequency_is_that_of_the_kernel(minimize: str) -> None:
    steps, count = np.array([0.1, 0.3, 0.05]), {"acceleration": 1, "jerk": 2, "snap": 3}[minimize]
    w, step = 9.0, 1e-4
    higher, lower = (vibration.kernels(vibration.Mode(x, 0.1, 0.0, True), steps, count) for x in (w + step, w - step))
    slope = vibration.kernels(vibration.Mode(w, 0.1, 0.0, True), steps, count, derivative=True)
    assert slope == pytest.approx(w * (higher - lower) / (2 * step), rel=1e-6)


@pytest.mark.parametrize(("minimize", "norm"), [("jerk", "l2"), ("acceleration", "linf"), ("jerk", "l1")])
def test_any_objective_can_be_quiet(minimize: str, norm: str) -> None:
    problem = axis(minimize, norm, limits={"jerk": 900.0})
    loud, silent, robust = (solved(quiet(problem, *m)) for m in ((), (MODE,), (MODE | {"robust": True},)))
    left = [float(s.residual_vibration(4.0, 0.05)[0]) for s in (loud, silent, robust)]
    assert left[0] > 1e-4 and max(left[1:]) < 1e-9
    assert loud.objective < silent.objective < robust.objective  # type: ignore[operator]
    near = [float(np.max(s.residual_vibration([3.8, 4.2], 0.05))) for s in (silent, robust)]
    assert near[1] < near[0] / 3
    assert silent.metrics["residual_vibration_1"] == pytest.approx(left[1], abs=1e-12)


def test_a_band_stays_below_its_bound_everywhere() -> None:
    band = {"frequency": (3.5, 4.5), "residual": 1e-3}
    solution = solved(quiet(axis("jerk", "l2"), band))
    left = solution.residual_vibration(np.linspace(3.5, 4.5, 400))
    assert 0.96e-3 < left.max() <= 1e-3 * (1 + 1e-7)


def test_a_power_objective_can_be_quiet_and_keeps_its_bound() -> None:
    problem = table_i("power", "linf", intervals=60)
    loud, silent = solved(problem), solved(quiet(problem, {"frequency": 3.0}))
    assert silent.route.model == "cvxpy"
    assert float(silent.residual_vibration(3.0)[0]) < 1e-8 < float(loud.residual_vibration(3.0)[0])
    assert loud.certificate["lower_bound"] <= silent.certificate["lower_bound"] <= silent.objective


def test_ipopt_agrees() -> None:
    modes = ({"frequency": (3.5, 4.5), "residual": 1e-3}, {"frequency": 7.0})
    ours, other = (solved(quiet(axis("jerk", "l2", intervals=30, solver=s), *modes)) for s in ("auto", "ipopt"))
    assert other.objective == pytest.approx(ours.objective, rel=1e-7)


def test_least_time_with_a_quiet_mode_is_that_of_two_masses_and_a_spring() -> None:
    """A force of 1 N on one of two masses of 1 kg with a spring of 1 N/m between them, moved by 1 m: 4.217866510451 s.
    Their centre has half the acceleration, their distance swings at sqrt(2) rad/s (Tuttle & Seering's plant)."""
    mode = {"frequency": np.sqrt(2) / (2 * np.pi)}
    problem = quiet(axis("time", time="free", limits={"acceleration": 0.5}, intervals=160), mode)
    solution = solved(problem)
    assert solution.duration == pytest.approx(4.217866510451, rel=2e-4)
    assert solution.duration > 4.217866510451
    assert float(solution.residual_vibration(mode["frequency"])[0]) < 1e-8


def test_the_checker_catches_a_move_that_swings() -> None:
    loud = solved(axis("jerk", "l2")).to_dict()
    silent = solved(quiet(axis("jerk", "l2"), MODE | {"robust": True})).to_dict()
    assert checker.check(silent).passed
    for key in ("trajectory", "objective", "metrics", "certificate"):
        silent[key] = copy.deepcopy(loud[key])
    failed = [check.name for check in checker.check(silent).failed]
    assert failed == ["vibration 1", "vibration 1 slope"]
    quiet_claim = solved(quiet(axis("jerk", "l2"), MODE)).to_dict()
    quiet_claim["metrics"]["residual_vibration_1"] = 1e-3
    assert [check.name for check in checker.check(quiet_claim).failed] == ["metric residual_vibration_1"]


def test_units_do_not_matter() -> None:
    base = solved(quiet(axis("jerk", "l2"), MODE)).objective
    for length, time in ((1e-9, 1.0), (1e4, 1.0), (1.0, 1e-3), (1.0, 1e3)):
        modes = {"frequency": 4.0 / time, "damping": 0.05}
        other = solved(quiet(axis("jerk", "l2", distance=length, time=time), modes)).objective
        assert other == pytest.approx(base * length / time**3, rel=1e-9)
