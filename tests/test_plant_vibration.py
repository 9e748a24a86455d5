"""Residual vibration of impulses and of profiles, against an ODE solver and the formulas of input shaping."""

from __future__ import annotations

from math import exp, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from trajopt.plant import (
    mode_derivative_weights,
    mode_pole,
    mode_weights,
    profile_vibration,
    residual_amplitude,
    residual_vibration,
    start_weights,
)

NODES = np.array([0.0, 0.11, 0.3, 0.38, 0.7, 0.75, 1.2])


def left_over(top: np.ndarray, start: np.ndarray, w: float, damping: float) -> complex:
    """V by an ODE solver: q'' + 2ζω q' + ω² q = a(t), with a the integral of the piecewise-constant top derivative."""
    degree = len(start)
    x = np.concatenate([[0.0, 0.0], start])
    for begin, end, u in zip(NODES[:-1], NODES[1:], top, strict=True):

        def slope(_: float, x: np.ndarray, u: float = u) -> np.ndarray:
            chain = [*x[2:], u]
            return np.array([x[1], chain[0] - 2 * damping * w * x[1] - w**2 * x[0], *chain[1:]])

        x = solve_ivp(slope, (begin, end), x, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    assert len(x) == 2 + degree
    p = mode_pole(w, damping)
    return complex(x[1] - p.conjugate() * x[0])


@pytest.mark.parametrize("degree", [0, 1, 2])
@pytest.mark.parametrize(("w", "damping"), [(0.05, 0.0), (3.0, 0.1), (25.0, 0.02), (60.0, 0.7)])
def test_weights_against_an_ode_solver(degree: int, w: float, damping: float) -> None:
    rng = np.random.default_rng(degree)
    top, start = rng.standard_normal(6), rng.standard_normal(degree)
    weights, initial = mode_weights(NODES, degree, w, damping), start_weights(NODES[-1], degree, w, damping)
    assert weights.shape == (6,) and initial.shape == (degree,)
    whole = weights @ top + initial @ start
    assert whole == pytest.approx(left_over(top, start, w, damping), rel=1e-9, abs=1e-10)


@pytest.mark.parametrize("degree", [0, 1, 2])
@pytest.mark.parametrize("w", [0.01, 2.0, 40.0])
def test_derivative_by_frequency(degree: int, w: float) -> None:
    step = 1e-4 * w
    values = [mode_weights(NODES, degree, w + k * step, 0.05) for k in (-2, -1, 1, 2)]
    difference = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * step)
    exact = mode_derivative_weights(NODES, degree, w, 0.05)
    assert exact == pytest.approx(difference, rel=1e-8, abs=1e-9 * float(np.max(np.abs(values[0]))) / w)


def test_a_profile_with_both_rows_zero_keeps_no_vibration_near_the_mode() -> None:
    w, damping, times = 9.0, 0.03, np.linspace(0, 1.5, 31)
    rows = [mode_weights(times, 1, w, damping), mode_derivative_weights(times, 1, w, damping)]
    chain = [np.ones(30), 30 - np.arange(30) - 0.5]  # acceleration and velocity at the end
    a = np.array([part for row in rows for part in (row.real, row.imag)] + chain)
    u = np.linalg.lstsq(a, np.array([0, 0, 0, 0, 0, 1.0]), rcond=None)[0]
    at = profile_vibration(times, u, 1, np.array([w, 1.001 * w, 1.01 * w]), damping)
    assert at[0] < 1e-12 < at[1] and at[2] / at[1] == pytest.approx(100, rel=0.1)


def test_profile_vibration_is_the_amplitude_of_the_swing() -> None:
    w, top = 11.0, np.array([1.0, -2.0, 0.5, 1.5, -1.0, 0.3])
    v = left_over(top, np.empty(0), w, 0.0)
    assert profile_vibration(NODES, top, 0, w) == pytest.approx(abs(v) / w, rel=1e-9)
    assert profile_vibration(NODES, top, 0, np.full((2, 3), w)).shape == (2, 3)


def test_shaper_of_two_impulses_for_a_damped_mode() -> None:
    w, damping = 5.0, 0.1
    damped = w * sqrt(1 - damping**2)
    k = exp(-damping * pi / sqrt(1 - damping**2))
    times, amplitudes = np.array([0, pi / damped]), np.array([1, k]) / (1 + k)
    assert residual_vibration(times, amplitudes, w, damping) == pytest.approx(0, abs=1e-12)
    w = 6.0
    damped = w * sqrt(1 - damping**2)
    phase, growth = damped * times, np.exp(damping * w * times)
    sums = [np.sum(amplitudes * growth * f(phase)) for f in (np.cos, np.sin)]
    expected = 100 * exp(-damping * w * times[-1]) * np.hypot(*sums)
    assert residual_vibration(times, amplitudes, w, damping) == pytest.approx(expected, rel=1e-12)


def test_impulses_in_step_leave_all_of_it() -> None:
    times, amplitudes = np.array([0.0, pi, 2 * pi]), np.array([1.0, -2.0, 1.0])
    assert residual_vibration(times, amplitudes, np.array([1.0, 2.0])) == pytest.approx([100.0, 0.0], abs=1e-10)
    assert residual_amplitude(times, amplitudes, 1.0) == pytest.approx(4.0)


@pytest.mark.parametrize(
    "ask",
    [
        lambda: mode_weights(NODES, 1, 0.0),
        lambda: mode_weights(NODES, 1, 2.0, 1.0),
        lambda: mode_weights(NODES, -1, 2.0),
        lambda: mode_weights(NODES[::-1], 1, 2.0),
        lambda: residual_vibration([0.0, 1.0], [1.0], 2.0),
    ],
)
def test_refusals(ask: object) -> None:
    with pytest.raises(ValueError, match=r"needs|give|is constant"):
        ask()  # type: ignore[operator]
