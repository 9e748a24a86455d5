"""Residual vibration of impulses, against the formulas of input shaping."""

from __future__ import annotations

from math import exp, pi, sqrt

import numpy as np
import pytest

from trajopt.plant import residual_vibration


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
    assert residual_vibration(times, amplitudes, np.full((2, 3), 2.0)).shape == (2, 3)


@pytest.mark.parametrize(
    ("times", "amplitudes", "frequency", "damping"),
    [([0.0, 1.0], [1.0], 2.0, 0.0), ([0.0], [1.0], 0.0, 0.0), ([0.0], [1.0], 2.0, 1.0), ([], [], 2.0, 0.0)],
)
def test_refusals(times: list[float], amplitudes: list[float], frequency: float, damping: float) -> None:
    with pytest.raises(ValueError, match=r"needs|give"):
        residual_vibration(times, amplitudes, frequency, damping)
