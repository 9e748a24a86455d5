"""The relaxation that every continuous move satisfies: its moments, and how sharp it is with nodes at the switches."""

from __future__ import annotations

from dataclasses import replace
from math import factorial

import numpy as np
import pytest

from tests.conftest import axis
from trajopt.attempt import Clock
from trajopt.mesh import Mesh
from trajopt.outer import _moment, is_impossible
from trajopt.schemes import EXACT
from trajopt.signals import OnFloats
from trajopt.transcribe import Setting

GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(8)


@pytest.mark.parametrize("order", [2, 3, 4])
def test_moments_are_the_integrals_they_stand_for(order: int) -> None:
    rng = np.random.default_rng(order)
    steps = rng.uniform(0.2, 0.6, 5)
    chain = EXACT.rollout(rng.normal(size=order), rng.normal(size=5), steps)
    points = np.outer(steps, (GAUSS + 1) / 2)
    for i in range(1, order + 1):
        left = [x[:5, None] for x in chain[i:]]
        values = sum(points**r / factorial(r) * x for r, x in enumerate(left))
        for a, b in ((a, r - 1 - a) for r in range(1, i + 1) for a in range(r)):
            kernel = (steps[:, None] - points) ** a / factorial(a) * points**b / factorial(b)
            integral = steps / 2 * ((kernel * values) @ WEIGHTS)
            assert _moment(OnFloats(), chain, steps, i, a, b) == pytest.approx(integral, rel=1e-9, abs=1e-11)


S_CURVE = {"velocity": 0.5, "acceleration": 4.905, "jerk": 98.1}
RAMP, HOLD = 4.905 / 98.1, 0.5 / 4.905 - 4.905 / 98.1
S_SWITCHES = np.cumsum([RAMP, HOLD, RAMP, 0.254 / 0.5 - 0.5 / 4.905 - RAMP, RAMP, HOLD, RAMP])
SNAP_SWITCHES = (384 * 0.01 / 1e5) ** 0.25 * (1 - np.cos(np.pi * np.arange(1, 5) / 4)) / 2


@pytest.mark.parametrize(
    ("limits", "distance", "switches"),
    [(S_CURVE, 0.254, S_SWITCHES), ({"snap": 1e5}, 0.01, SNAP_SWITCHES)],
    ids=["jerk", "snap"],
)
@pytest.mark.parametrize("intervals", [4, 20])
def test_with_nodes_at_the_switches_the_least_time_is_proven(
    limits: dict[str, float], distance: float, switches: np.ndarray, intervals: int
) -> None:
    shortest = float(switches[-1])
    problem = axis("jerk", "l2", distance=distance, time=shortest, limits=limits, intervals=intervals)
    setting = Setting.of(problem)
    fractions = np.unique(np.concatenate([setting.mesh.fractions, switches[:-1] / shortest]))
    setting = replace(setting, mesh=Mesh(fractions))
    assert is_impossible(setting, shortest * (1 - 1e-7), Clock())
    assert not is_impossible(setting, shortest * (1 + 1e-7), Clock())
