"""The expressions of convex programs do what arrays do, and become the matrices that solvers are given."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trajopt.affine import Affine, in_cones, stacked

X = np.array([0.3, -1.2, 2.0, 0.7, -0.4])  # of the stacked variable


def expression(first: int, count: int) -> tuple[Affine, np.ndarray]:
    return Affine.variables(first, count), X[first : first + count]


def same(found: Affine, expected: Any) -> None:
    assert found.at(X) == pytest.approx(np.atleast_1d(expected), rel=1e-14, abs=1e-14)
    if not found.squares:
        by_matrix = found.matrix(len(X)) @ X + found.constant
        assert by_matrix == pytest.approx(np.atleast_1d(expected), rel=1e-14, abs=1e-14)


def test_arithmetic_is_that_of_arrays() -> None:
    (a, x), (b, y), weights = expression(0, 3), expression(2, 3), np.array([2.0, -3.0, 0.5])
    for found, expected in (
        (a + b, x + y),
        (a - b, x - y),
        (-a, -x),
        (2.0 * a / 4.0, x / 2),
        (weights * a, weights * x),
        (a * weights - 1.0, x * weights - 1),
        (weights - a, weights - x),
        (a - b[1], x - y[1]),
        (weights * a[0], weights * x[0]),
        (weights + a[-1], weights + x[-1]),
        (a[1:] - 2 * a[:-1], x[1:] - 2 * x[:-1]),
        ((a + b)[np.array([2, 0])], (x + y)[[2, 0]]),
        (a.total(weights) + 1.0, weights @ x + 1),
        (stacked([a, Affine.of([7.0]), b[::2]]), np.concatenate([x, [7.0], y[::2]])),
        (weights * (a + 1.0).squared()[:], weights * (x + 1) ** 2),
        (((a - b).squared() + b)[1:], ((x - y) ** 2 + y)[1:]),
        ((a - b).squared().total(weights), weights @ (x - y) ** 2),
        (stacked([b, a.squared()]), np.concatenate([y, x**2])),
    ):
        same(found, expected)


def test_a_single_expression_stands_for_many_and_other_lengths_are_refused() -> None:
    a, b = Affine.variables(0, 3), Affine.variables(3, 2)
    with pytest.raises(ValueError, match="2 expressions where 3 are needed"):
        _ = a + b
    with pytest.raises(ValueError, match="square of a square"):
        a.squared().squared()


def test_a_quadratic_objective_becomes_its_matrix() -> None:
    a, b, weights = Affine.variables(0, 3), Affine.variables(2, 3), np.array([2.0, 3.0, 0.5])
    value = (a - 2.0 * b + 1.0).squared().total(weights) + b.total(weights) + 4.0
    P, q, constant = value.quadratic(len(X))
    assert 0.5 * X @ (P @ X) + q @ X + constant == pytest.approx(float(value.at(X)[0]), rel=1e-14)
    with pytest.raises(ValueError, match="no convex program"):
        (-a.squared()).total(weights).quadratic(len(X))


@given(st.lists(st.floats(-3, 3), min_size=5, max_size=5), st.lists(st.floats(0, 2), min_size=3, max_size=3))
def test_cones_hold_exactly_where_the_squares_are_bounded(point: list[float], weights: list[float]) -> None:
    """Σ w y² + z <= 0 at a point, or not, and the vectors are inside their cones there, or not."""
    x, w = np.array(point), np.array(weights)
    rows = (Affine.variables(0, 3) - 0.5).squared() * w + Affine.variables(2, 3) - 1.0
    rows = rows + 0.5 * Affine.variables(1, 3).squared()
    inside, sizes = in_cones(rows)
    values = np.split(inside.at(x), np.cumsum(sizes)[:-1])
    assert sizes == [4, 4, 4]
    for value, bounded in zip(values, rows.at(x), strict=True):
        margin = value[0] - np.linalg.norm(value[1:])
        assert bounded == pytest.approx(0.0, abs=1e-9) or (margin >= 0) == (bounded <= 0)


def test_a_concave_square_is_no_cone() -> None:
    with pytest.raises(ValueError, match="no convex program"):
        in_cones(-Affine.variables(0, 3).squared())
