"""The smoothest move in closed form: the optimum of the program it stands for, and only where no limit acts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import trajopt
from tests.conftest import axis, solved
from trajopt.problem import DERIVATIVES

LIMITS = {"velocity": (0.0, 2.5), "acceleration": 8.0, "jerk": 100.0}
CASES: dict[str, dict[str, Any]] = {
    "rest to rest": {"limits": LIMITS},
    "without limits": {},
    "acceleration on top": {"minimize": "acceleration"},
    "snap on top": {"minimize": "snap"},
    "moving ends": {"start": {"velocity": 0.3, "acceleration": -1.0}, "end": {"velocity": -0.2}, "distance": -0.7},
    "free end": {"end": {"velocity": "free", "acceleration": "free"}},
    "via states": {"via": (trajopt.Via(time=0.3, position=0.5, velocity=-1.0), trajopt.Via(time=0.71, position=0.4))},
    "power limit": {"limits": {**LIMITS, "power": 60.0, "force": 20.0}, "load": {"inertia": 2.0, "viscous": 1.0}},
    "position limit": {"start": {"position": 3.0}, "distance": 3.5, "limits": {"position": (2.9, 3.6), "jerk": 100.0}},
    "Euler": {"scheme": "euler", "limits": {**LIMITS, "velocity": 2.5}},
    "far and slow": {"distance": 4e3, "time": 900.0, "limits": {"velocity": 20.0, "jerk": 3.0}},
}


def case(name: str, **changes: Any) -> trajopt.Problem:
    given = {"minimize": "jerk", "norm": "l2", **CASES[name], **changes}
    return axis(given.pop("minimize"), given.pop("norm"), **given)


@pytest.mark.parametrize("name", CASES)
def test_is_the_optimum_of_the_program(name: str) -> None:
    closed, program = solved(case(name)), solved(case(name, solver="clarabel"))
    assert (closed.route.model, program.route.model) == ("closed form", "cvxpy")
    assert closed.objective == pytest.approx(program.objective, rel=1e-8)
    assert closed.certificate["gap"] <= 1e-10 and closed.route.unique
    for column in closed.frame:
        size = np.max(np.abs(program.frame[column]))
        np.testing.assert_allclose(closed.frame[column], program.frame[column], rtol=0, atol=2e-5 * size)
    assert {row["name"] for row in closed.prices} >= {row["name"] for row in program.prices}
    for row in program.prices:
        same = next(other for other in closed.prices if other["name"] == row["name"])
        assert same["per_unit"] == pytest.approx(row["per_unit"], rel=1e-4, abs=1e-6 * abs(program.objective or 0.0))


@pytest.mark.parametrize("limit", ["velocity", "acceleration", "jerk", "power"])
def test_is_left_where_a_limit_acts(limit: str) -> None:
    """A limit a little above its peak does not, one a little below does, and costs little there."""
    load = {"inertia": 2.0}
    free = solved(case("without limits", load=load))
    peak = free.metrics[f"peak_{limit}"]
    above, below = (solved(case("without limits", load=load, limits={limit: peak * f})) for f in (1.02, 0.98))
    assert free.route.model == above.route.model == "closed form" and below.route.model != "closed form"
    assert above.objective == pytest.approx(free.objective, rel=1e-12)
    assert free.objective < below.objective < free.objective * 1.05


@pytest.mark.parametrize(
    "changes",
    [
        {"start": {"velocity": "free"}},
        {"norm": "l1"},
        {"minimize": "velocity"},
        {"limits": {"force": 50.0}, "load": {"inertia": 1.0, "coulomb": 0.1}},
        {"solver": "piqp"},
        {"time": (0.5, 1.0)},
    ],
)
def test_is_left_for_what_it_does_not_know(changes: dict[str, Any]) -> None:
    assert solved(case("rest to rest", **{"limits": LIMITS, **changes})).route.model != "closed form"


def test_states_that_contradict_each_other() -> None:
    """Two positions at via states too close to pass both within the limits are left to the program, which says why."""
    via = (trajopt.Via(time=0.5, position=0.5), trajopt.Via(time=0.5000001, position=0.6))
    assert not trajopt.solve(case("rest to rest", via=via)).status.solved


@pytest.mark.parametrize("seed", range(60))
def test_random_states(seed: int) -> None:
    """Moving ends and up to five via states, without limits: solved, and as by the program."""
    rng = np.random.default_rng(seed)
    order, time, distance = int(rng.integers(2, 5)), 10 ** rng.uniform(-3, 3), 10 ** rng.uniform(-6, 4)
    size = (distance, distance / time, distance / time**2)

    def state() -> dict[str, Any]:
        return {name: rng.normal() * size[i] for i, name in enumerate(("velocity", "acceleration")[: order - 1], 1)}

    at = np.cumsum(rng.uniform(0.02, 0.2, rng.integers(0, 6)))
    via = tuple(trajopt.Via(time=t * time, position=rng.normal() * distance) for t in at[at < 0.97])
    ends = {"start": state(), "end": state()}
    closed, program = (
        solved(
            axis(DERIVATIVES[order], "l2", distance=distance, time=time, via=via, intervals=40, solver=solver, **ends)
        )
        for solver in ("auto", "clarabel")
    )
    assert closed.objective == pytest.approx(program.objective, rel=1e-7)
    assert closed.certificate["lower_bound"] <= program.objective * (1 + 1e-9)
