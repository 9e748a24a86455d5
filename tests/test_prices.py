"""Prices, each verified by a re-solve."""

from __future__ import annotations

from typing import Any

import pytest

import trajopt
from trajopt import prices
from trajopt.prices import _time
from trajopt.problem import Problem


def clemen_rupp(*overrides: str) -> Problem:
    """The axis of Table I with overrides."""
    return trajopt.load("clemen_rupp_jerk_l2", overrides)


CASES = {
    "jerk l1": ('objective={minimize="jerk", norm="l1"}',),
    "velocity l2, tight": ('objective={minimize="velocity", norm="l2"}', 'move.time="0.7 s"'),
    "weighted": ('objective.terms=[{minimize="acceleration", norm="linf"}, {minimize="jerk", norm="l2", weight=0.1}]',),
    "force": ('objective={minimize="force", norm="linf"}', 'load.viscous="30 N s/m"', 'limits.force="60 N"'),
    "force without friction": ('objective={minimize="force", norm="linf"}', 'limits.force="60 N"'),
    "power l2": ('objective={minimize="power", norm="l2"}',),
    "power limit": ('objective={minimize="jerk", norm="l2"}', 'limits.power="2 W"'),
    "euler": ('objective={minimize="jerk", norm="l1"}', 'transcription.scheme="euler"'),
}
STEP = 1e-3


@pytest.mark.parametrize("case", CASES)
def test_prices_are_what_a_resolve_costs(case: str) -> None:
    problem = clemen_rupp("transcription.intervals=100", *CASES[case])
    solution = trajopt.solve(problem)
    assert solution.prices
    for price in solution.prices:
        if price["per_percent"] is None or abs(price["per_percent"]) < 1e-5:  # lost in the solver's tolerance
            continue
        more, less = (trajopt.solve(changed(problem, price["name"], 1 + s)).objective for s in (STEP, -STEP))
        measured = (more - less) / (2 * STEP) / solution.objective / 100  # type: ignore[operator]
        assert price["per_percent"] == pytest.approx(measured, rel=2e-3), price["name"]


@pytest.mark.parametrize("case", ["jerk l1", "weighted", "force without friction", "power limit"])
def test_two_ways_to_the_price_of_the_time(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the prices of the limits, and as the slope of the Lagrangian."""
    problem, asked = clemen_rupp("transcription.intervals=100", *CASES[case]), 0

    def price() -> float:
        return next(row["per_unit"] for row in trajopt.solve(problem).prices if row["name"] == "time")

    def slope(*arguments: Any) -> float | None:
        nonlocal asked
        asked += 1
        return _time(*arguments)

    monkeypatch.setattr(prices, "_time", slope)
    stretched = price()
    assert not asked
    monkeypatch.setattr(prices, "_by_stretching", lambda *_: None)
    assert price() == pytest.approx(stretched, rel=1e-7)
    assert asked


@pytest.mark.parametrize(("solver", "model"), [("clarabel", "cvxpy"), ("auto", "arcs")])
def test_price_of_a_least_time(solver: str, model: str) -> None:
    overrides = ('objective={minimize="time"}', 'move.time="free"', "transcription.intervals=100")
    problem = clemen_rupp(*overrides, f"transcription.solver={solver}")
    solution = trajopt.solve(problem)
    assert solution.route.model == model
    acting = [price for price in solution.prices if price["per_unit"]]
    assert {price["name"] for price in acting} == {"velocity.max", "acceleration", "jerk"}
    assert {price["name"] for price in solution.prices} == {"velocity.max", "velocity.min", "acceleration", "jerk"}
    for price in acting:
        more, less = (trajopt.solve(changed(problem, price["name"], 1 + s)).duration for s in (STEP, -STEP))
        assert price["per_percent"] == pytest.approx((more - less) / (2 * STEP) / solution.duration / 100, rel=2e-3)  # type: ignore[operator]


@pytest.mark.parametrize("load", [(), ('limits.force="40 N"',), ('limits.force="40 N"', 'load.coulomb="10 N"')])
def test_prices_of_a_least_time_from_rest_to_rest(load: tuple[str, ...]) -> None:
    """All of them, also the one that is not measured but follows from the others."""
    problem = clemen_rupp('objective={minimize="time"}', 'move.time="free"', *load)
    solution = trajopt.solve(problem)
    assert solution.route.model == "arcs"
    acting = [price for price in solution.prices if price["per_unit"]]
    assert len(acting) >= 3
    for price in acting:
        more, less = (trajopt.solve(changed(problem, price["name"], 1 + s)).duration for s in (STEP, -STEP))
        assert price["per_percent"] == pytest.approx((more - less) / (2 * STEP) / solution.duration / 100, rel=1e-4)  # type: ignore[operator]


def changed(problem: Problem, name: str, factor: float) -> Problem:
    if name == "time":
        return problem.replace(move=problem.move.model_copy(update={"time": problem.move.fixed_time * factor}))  # type: ignore[operator]
    quantity, _, side = name.partition(".")
    limit = getattr(problem.limits, quantity)
    return problem.with_limit(name, (limit.lowest if side == "min" else limit.highest) * factor)
