"""Norms: definitions, norm axioms, and a user's own one end to end."""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import norms
import trajopt
from tests.conftest import axis, solved, term

UNIFORM = np.array([0.125, 0.25, 0.25, 0.25, 0.125])  # the trapezoidal weights of four intervals


# --- a user's own norms: everything trajopt needs to know of them ----------------------------------------------------


class L1AndPeak(norms.Norm):
    """(1/T)∫|x|dt + max|x|."""

    name = "l1+linf"

    def measure(self, x: Any, weights: Any, duration: float) -> float:
        return float(weights @ np.abs(x) + np.max(np.abs(x)))

    def lower(self, model: norms.Rows, x: Any, weights: Any, duration: Any) -> Any:
        peak, bound = model.variable(1)[0], model.variable(len(weights))
        model.nonpositive(x - bound)
        model.nonpositive(-x - bound)
        model.nonpositive(bound - peak)
        return model.total(weights, bound) + peak


class L4(norms.Norm):
    """((1/T)∫x⁴dt)^(1/4), through y >= x² and the length of y; for use alone, since its square is what is lowered."""

    name = "l4"
    strictly_convex = True

    def measure(self, x: Any, weights: Any, duration: float) -> float:
        return float(weights @ x**4) ** 0.25

    def lower_alone(self, model: norms.Rows, x: Any, weights: Any, duration: Any) -> Any:
        square, length = model.variable(len(weights)), model.variable(1)[0]
        model.nonpositive(model.squares(x) - square)
        model.at_least_length(length, square, np.sqrt(weights))
        return length

    def alone(self, value: float) -> float:
        return value**2

    def value_alone(self, value: float) -> float:
        return sqrt(max(value, 0.0))


ALL = (norms.L1(), norms.L2(), norms.Linf(), L1AndPeak(), L4())


@pytest.fixture
def registered() -> Iterator[None]:
    """The user's norms known by name, for one test."""
    before = dict(norms._KNOWN)
    for norm in (L1AndPeak(), L4()):
        norms.register(norm)
    yield
    norms._KNOWN.clear()
    norms._KNOWN.update(before)


# --- definitions -----------------------------------------------------------------------------------------------------


def test_measures_are_the_definitions() -> None:
    x = np.array([1.0, -2.0, 3.0, -4.0, 0.0])
    assert norms.L1().measure(x, UNIFORM, 2.0) == pytest.approx(2.0 * (0.125 + 0.5 + 0.75 + 1.0), rel=1e-15)
    assert norms.L2().measure(x, UNIFORM, 2.0) == pytest.approx(sqrt(0.125 + 1.0 + 2.25 + 4.0), rel=1e-15)
    assert norms.Linf().measure(x, UNIFORM, 2.0) == 4.0


def test_measures_are_time_integrals() -> None:
    """|sin 2πt| over 3 s: means 2/π and 1/√2, whatever the mesh."""
    for intervals in (1000, 4000):
        x = np.sin(2 * np.pi * np.arange(intervals + 1) / intervals)
        weights = np.full(intervals + 1, 1 / intervals)
        weights[[0, -1]] /= 2
        assert norms.L1().measure(x, weights, 3.0) == pytest.approx(3.0 * 2 / np.pi, rel=1e-5)
        assert norms.L2().measure(x, weights, 3.0) == pytest.approx(sqrt(0.5), rel=1e-5)
        assert norms.Linf().measure(x, weights, 3.0) == pytest.approx(1.0, rel=1e-5)


def test_only_l2_claims_a_unique_optimum() -> None:
    assert {norm.name: norm.strictly_convex for norm in ALL[:3]} == {"l1": False, "l2": True, "linf": False}


SAMPLES = arrays(np.float64, 5, elements=st.floats(-1e3, 1e3).map(lambda x: round(x, 6)))


@pytest.mark.parametrize("norm", ALL, ids=lambda n: n.name)
@settings(max_examples=60, deadline=None)
@given(x=SAMPLES, y=SAMPLES, factor=st.floats(-100, 100))
def test_norm_axioms(norm: norms.Norm, x: np.ndarray, y: np.ndarray, factor: float) -> None:
    def size(z: np.ndarray) -> float:
        return norm.measure(z, UNIFORM, 0.7)

    slack = 1e-9 * (1 + size(x) + size(y))
    assert size(x + y) <= size(x) + size(y) + slack
    assert size(factor * x) == pytest.approx(abs(factor) * size(x), rel=1e-12, abs=1e-12)
    assert size(np.zeros(5)) == 0.0
    assert (size(x) > 0) == bool(np.any(x))


@pytest.mark.parametrize("norm", ALL, ids=lambda n: n.name)
@given(value=st.floats(1e-6, 1e6), step=st.floats(1.001, 10))
def test_alone_is_increasing_and_inverted(norm: norms.Norm, value: float, step: float) -> None:
    assert norm.value_alone(norm.alone(value)) == pytest.approx(value, rel=1e-12)
    assert norm.alone(step * value) > norm.alone(value)


LOWERED = [(norm, alone) for norm in ALL for alone in (False, True) if alone or not isinstance(norm, L4)]


@pytest.mark.parametrize("norm, alone", LOWERED, ids=lambda x: getattr(x, "name", x))
def test_lowered_on_either_model_equals_the_measure(norm: norms.Norm, alone: bool) -> None:
    """Minimised over fixed samples, the lowered expression is the norm of those samples."""
    from trajopt.model_cvxpy import ConvexModel
    from trajopt.model_pyomo import NonconvexModel

    x = np.array([0.3, -1.1, 0.7, 0.2, -0.4])
    for model, solver in ((ConvexModel(), "clarabel"), (NonconvexModel(), "ipopt")):
        samples = model.vector(5, 1.0, np.full(5, -np.inf), np.full(5, np.inf), name="x")
        model.zero(samples - x)
        lower = norm.lower_alone if alone else norm.lower
        model.minimize(lower(model, samples, UNIFORM, 0.7))
        value = model.run(solver).value
        if alone:
            value = norm.value_alone(value)
        assert value == pytest.approx(norm.measure(x, UNIFORM, 0.7), rel=1e-6), solver


# --- by name, and end to end -----------------------------------------------------------------------------------------


def test_known_by_name() -> None:
    assert norms.names() == ("l1", "l2", "linf")
    assert isinstance(norms.get("l2"), norms.L2)
    own = L4()
    assert norms.get(own) is own
    assert norms.get(None) is None
    with pytest.raises(ValueError, match="unknown norm 'l3'; one of l1, l2, linf"):
        norms.get("l3")


@pytest.mark.usefixtures("registered")
def test_a_name_is_given_once() -> None:
    assert norms.names()[-2:] == ("l1+linf", "l4")
    for taken in (L4(), norms.L1(), norms.Norm()):
        with pytest.raises(ValueError, match="name of its own"):
            norms.register(taken)


@pytest.mark.usefixtures("registered")
def test_a_registered_norm_can_be_asked_for_by_name() -> None:
    """As a problem file would, with the same answer as the class itself."""
    problem = axis("jerk", "l1+linf", limits={"velocity": 1.7}, intervals=20)
    assert problem.objective.terms[0].label == "jerk l1+linf"
    by_class = axis("jerk", L1AndPeak(), limits={"velocity": 1.7}, intervals=20)
    assert solved(problem).objective == pytest.approx(solved(by_class).objective, rel=1e-12)


def test_own_linear_norm_end_to_end() -> None:
    """A mixture costs no less than the sum of what its parts cost each alone, and as much as the sum of two terms."""
    limits = {"velocity": 1.7}
    own, convex_sum = (
        solved(axis(m, n, limits=limits, intervals=30))
        for m, n in (("jerk", L1AndPeak()), ([term("jerk", "l1"), term("jerk", "linf")], None))
    )
    assert own.objective == pytest.approx(convex_sum.objective, rel=3e-8)
    parts = sum(solved(axis("jerk", n, limits=limits, intervals=30)).objective for n in ("l1", "linf"))
    assert own.objective > parts
    assert "minimised" in own.route.tie_break
    local = solved(axis("jerk", L1AndPeak(), limits=limits, intervals=30, solver="ipopt"))
    assert local.objective == pytest.approx(own.objective, rel=1e-7)


def test_own_smooth_norm_end_to_end() -> None:
    """L4 lies between L2 and L∞, on both models, without a line of the core knowing it."""
    value = {n: solved(axis("acceleration", n, intervals=30)).objective for n in ("l2", "linf")}
    own = solved(axis("acceleration", L4(), intervals=30))
    assert own.status is trajopt.Verdict.SOLVED
    assert own.route.tie_break == ""
    assert value["l2"] < own.objective < value["linf"]
    local = solved(axis("acceleration", L4(), intervals=30, solver="ipopt"))
    assert local.objective == pytest.approx(own.objective, rel=1e-7)


def test_least_l4_of_acceleration_in_closed_form() -> None:
    """Stationarity: a³ is linear in time, a = c·(1-2t)^(1/3); D = c/2·3/7, so ∫a⁴ = c⁴·3/7 with c = 14/3."""
    own = solved(axis("acceleration", L4(), intervals=200))
    assert own.objective == pytest.approx(14 / 3 * (3 / 7) ** 0.25, rel=1e-3)


def test_osqp_does_not_take_a_norm_it_cannot_know() -> None:
    with pytest.raises(trajopt.BadInput, match="'l4'"):
        trajopt.solve(axis("acceleration", L4(), solver="osqp"))
