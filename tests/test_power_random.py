"""Power and energy on random moves from rest to rest: a small certified gap, and no better move known to Ipopt."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import trajopt
from tests.conftest import axis, term
from trajopt.errors import TrajoptError

LARGEST_GAP = 5e-3
OBJECTIVES: tuple[Any, ...] = (
    [term("energy")],
    [term("power", "l2")],
    [term("power", "linf")],
    [term("energy", weight=0.5), term("power", "linf", weight=0.5)],
)


def random_problem(seed: int, solver: str = "auto") -> trajopt.Problem:
    """A one-way move with limits from tight to loose on velocity, acceleration and (mostly) jerk."""
    rng = np.random.default_rng([7, seed])
    time, distance, mass = 10 ** rng.uniform(-1.5, 1), 10 ** rng.uniform(-2, 1), 10 ** rng.uniform(-1, 2)
    mean = distance / time
    limits: dict[str, Any] = {
        "velocity": (0.0, mean * 10 ** rng.uniform(0.15, 0.7)),
        "acceleration": mean / time * 10 ** rng.uniform(0.9, 1.8),
    }
    if seed % 5:
        limits["jerk"] = mean / time**2 * 10 ** rng.uniform(2.0, 3.2)
    objective = OBJECTIVES[seed % 4]
    given = {"distance": distance, "time": time, "limits": limits, "load": {"inertia": mass}, "intervals": 60}
    return axis(objective, solver=solver, **given)


def fault(seed: int) -> str:
    """What is wrong with the answer to a random problem; empty where it is certified within `LARGEST_GAP`, and Ipopt
    from several starts finds nothing below its bound and nothing better than it. An impossible draw is no fault."""
    try:
        ours = trajopt.solve(random_problem(seed))
        if ours.status in (trajopt.Verdict.IMPOSSIBLE, trajopt.Verdict.IMPOSSIBLE_ON_GRID):
            return ""
        ipopt = trajopt.solve(random_problem(seed, "ipopt"))
    except TrajoptError as error:
        return f"{type(error).__name__}: {error}"
    if not ours.status.solved or ours.objective is None:
        return f"{ours.status.value}: {ours.message}"
    best = ours.objective if ipopt.objective is None else min(ours.objective, ipopt.objective)
    if ours.certificate["lower_bound"] > best * (1 + 1e-8):
        return f"bound {ours.certificate['lower_bound']:.9g} above the best known {best:.9g}"
    if ours.objective > best * (1 + 1e-6):
        return f"{ours.objective:.9g}, but Ipopt finds {best:.9g}"
    return "" if ours.certificate["gap"] <= LARGEST_GAP else f"gap {ours.certificate['gap']:.2g}"


@pytest.mark.parametrize("seed", range(24))
def test_random_moves_are_certified(seed: int) -> None:
    assert fault(seed) == ""


def test_most_draws_are_possible() -> None:
    statuses = [trajopt.solve(random_problem(seed)).status for seed in range(4)]
    assert sum(status.solved for status in statuses) >= 3
