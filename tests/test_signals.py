"""Signals: Bernstein pieces are the polynomials, bound them, and multiply and add like them."""

from __future__ import annotations

from math import comb, factorial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.polynomial import Polynomial

from trajopt import signals
from trajopt.mesh import Mesh
from trajopt.schemes import EULER, EXACT
from trajopt.signals import OnFloats, Signal

FLOATS = OnFloats()
COEFFICIENT = st.floats(-100, 100).map(lambda x: round(x, 6))


def value(pieces: tuple[np.ndarray, ...], u: float) -> np.ndarray:
    """The polynomials at the fraction ``u`` of their intervals, by the definition of the Bernstein form."""
    n = len(pieces) - 1
    return np.asarray(sum(comb(n, b) * u**b * (1 - u) ** (n - b) * c for b, c in enumerate(pieces)))


def random_signal(degree: int, seed: int, intervals: int = 5) -> Signal:
    rng = np.random.default_rng(seed)
    return Signal(None, tuple(rng.normal(size=intervals) for _ in range(degree + 1)))


@pytest.mark.parametrize("order", [2, 3, 4])
def test_pieces_are_the_taylor_polynomials_of_the_chain(order: int) -> None:
    rng = np.random.default_rng(order)
    steps = rng.uniform(0.1, 0.9, 6)
    chain = EXACT.rollout(rng.normal(size=order), rng.normal(size=6), steps)
    for i in range(order + 1):
        signal = EXACT.signal(FLOATS, chain, i, steps)
        assert signal.degree == order - i
        for u in (0.0, 0.3, 0.77, 1.0):
            taylor = sum(
                (u * steps) ** r / factorial(r) * (chain[i + r] if i + r == order else chain[i + r][:-1])
                for r in range(order - i + 1)
            )
            assert value(signal.pieces, u) == pytest.approx(taylor, rel=1e-12, abs=1e-12)


def test_euler_signals_mean_something_at_nodes_only() -> None:
    chain = EULER.rollout(np.zeros(3), np.ones(4), np.full(4, 0.1))
    velocity = EULER.signal(FLOATS, chain, 1, np.full(4, 0.1))
    assert velocity.pieces == ()
    assert velocity.samples(FLOATS) is chain[1]
    assert EULER.signal(FLOATS, chain, 3, np.full(4, 0.1)).samples(FLOATS) is chain[3]


@given(coefficients=arrays(np.float64, (5, 1), elements=COEFFICIENT), u=st.floats(0, 1))
def test_pieces_bound_the_polynomial(coefficients: np.ndarray, u: float) -> None:
    x = value(tuple(coefficients), u)[0]
    slack = 1e-12 * (1 + np.max(np.abs(coefficients)))
    assert np.min(coefficients) - slack <= x <= np.max(coefficients) + slack


@pytest.mark.parametrize("a, b", [(0, 0), (0, 3), (1, 1), (1, 2), (2, 3), (4, 4)])
def test_products_and_sums_are_those_of_polynomials(a: int, b: int) -> None:
    """Against the values, at more points than the degree of either has."""
    left, right = random_signal(a, 10 * a + b), random_signal(b, 10 * b + a + 1)
    product, total = signals.product(FLOATS, left, right), signals.plus(FLOATS, left, right)
    assert (product.degree, total.degree) == (a + b, max(a, b))
    for u in np.linspace(0.0, 1.0, 12):
        x, y = value(left.pieces, u), value(right.pieces, u)
        assert value(product.pieces, u) == pytest.approx(x * y, rel=1e-12, abs=1e-13)
        assert value(total.pieces, u) == pytest.approx(x + y, rel=1e-12, abs=1e-13)


def test_a_product_against_numpys_polynomials() -> None:
    """(1 + 2t)(3 - t + t²) on [0, 1]."""
    p, q = Polynomial([1.0, 2.0]), Polynomial([3.0, -1.0, 1.0])
    left = Signal(None, (np.array([1.0]), np.array([3.0])))
    right = Signal(None, (np.array([3.0]), np.array([2.5]), np.array([3.0])))
    t = np.linspace(0.0, 1.0, 7)
    for u in t:
        assert value(right.pieces, u)[0] == pytest.approx(q(u), rel=1e-14)
        assert value(signals.product(FLOATS, left, right).pieces, u)[0] == pytest.approx((p * q)(u), rel=1e-14)


def test_nodes_are_kept_only_where_both_have_them() -> None:
    jumping = Signal(None, (np.ones(4),))
    steady = signals.linear(np.arange(5.0))
    for combine in (signals.product, signals.plus):
        assert combine(FLOATS, jumping, steady).nodes is None
        assert combine(FLOATS, steady, steady).nodes is not None
    assert list(signals.plus(FLOATS, steady, steady).nodes) == [0, 2, 4, 6, 8]
    assert list(signals.product(FLOATS, steady, steady).nodes) == [0, 1, 4, 9, 16]


def test_samples_are_both_ends_where_a_signal_jumps() -> None:
    ramps = Signal(None, (np.array([1.0, 5.0]), np.array([2.0, 7.0])))
    assert list(ramps.samples(FLOATS)) == [1.0, 5.0, 2.0, 7.0]


@pytest.mark.parametrize("degree, nodes", [(0, False), (1, False), (3, False), (2, True)])
def test_weights_are_fractions_of_the_duration(degree: int, nodes: bool) -> None:
    """Non-negative, one for each sample, and one in all; a constant has its own value as mean."""
    mesh = Mesh(np.array([0.0, 0.1, 0.4, 0.6, 1.0]))
    signal = Signal(np.ones(5) if nodes else None, tuple(np.ones(4) for _ in range(degree + 1)))
    weights = EXACT.weights(signal, mesh.steps)
    assert weights.shape == signal.samples(FLOATS).shape
    assert np.all(weights > 0)
    assert np.sum(weights) == pytest.approx(1.0, rel=1e-15)


def test_euler_weights_are_plain_sums() -> None:
    mesh = Mesh(np.arange(5) / 4)
    assert list(EULER.weights(Signal(np.ones(5), ()), mesh.steps)) == [1.0] * 5
    assert list(EULER.weights(Signal(None, (np.ones(4),)), mesh.steps)) == [1.0] * 4
