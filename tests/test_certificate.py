"""Certificates: the bound never exceeds the optimum, and only what is infeasible is called so.

The programs are made from their answer: choose x, a slack s in the cone and a complementary dual z, then q and b such
that the optimality conditions hold. Their optimum is then known without a solver.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

import trajopt
from tests.conftest import axis, solved, term
from trajopt.certificate import REACH, ConeProgram, is_infeasible, lower_bound

SEEDS = st.integers(0, 2**32 - 1)
SCALES = st.sampled_from([0.0, 1e-12, 1e-8, 1e-4, 1e-2, 1.0, 100.0])


class Known(NamedTuple):
    """A program and its optimal pair."""

    program: ConeProgram
    x: np.ndarray
    z: np.ndarray

    @property
    def optimum(self) -> float:
        """Its optimal value."""
        return self.program.value(self.x)


def known_program(seed: int, quadratic: bool = True, bounded: bool = False) -> Known:
    """A random cone program with equalities, inequalities and two cones; ``bounded``: with bounds on all variables."""
    rng = np.random.default_rng(seed)
    n, zero, nonnegative, cones = 8, 3, 6, (3, 4)
    x = rng.normal(size=n)
    slack, z = [np.zeros(zero)], [rng.normal(size=zero)]
    active = rng.random(nonnegative) < 0.5
    slack.append(np.where(active, 0.0, rng.random(nonnegative)))
    z.append(np.where(active, rng.random(nonnegative), 0.0))
    A = rng.normal(size=(zero + nonnegative, n))
    if bounded:
        room = rng.random(2 * n) + 0.1
        A = np.vstack([A, np.eye(n), -np.eye(n)])
        slack.append(room)
        z.append(np.zeros(2 * n))
        nonnegative += 2 * n
    for size in cones:
        u = rng.normal(size=size - 1)
        length = float(np.linalg.norm(u))
        slack.append(np.array([length, *u]))
        z.append(rng.random() * np.array([length, *(-u)]))  # on the boundary, complementary
    A = np.vstack([A, rng.normal(size=(sum(cones), n))])
    root = rng.normal(size=(n, 4))
    P = root @ root.T if quadratic else np.zeros((n, n))
    s, dual = np.concatenate(slack), np.concatenate(z)
    program = ConeProgram(
        sparse.csc_array(P), -P @ x - A.T @ dual, sparse.csr_array(A), A @ x + s, zero, nonnegative, cones
    )
    return Known(program, x, dual)


@pytest.mark.parametrize("quadratic", [True, False])
@pytest.mark.parametrize("bounded", [True, False])
def test_the_optimal_pair_gives_the_optimum(quadratic: bool, bounded: bool) -> None:
    for seed in range(20):
        program, x, z = known = known_program(seed, quadratic, bounded)
        assert lower_bound(program, x, z) == pytest.approx(known.optimum, rel=1e-9, abs=1e-9)


@settings(max_examples=200, deadline=None)
@given(seed=SEEDS, primal=SCALES, dual=SCALES, quadratic=st.booleans(), bounded=st.booleans())
def test_no_pair_gives_more_than_the_optimum(
    seed: int, primal: float, dual: float, quadratic: bool, bounded: bool
) -> None:
    """Neither slightly wrong nor wildly wrong vectors fool the bound."""
    program, x, z = known = known_program(seed, quadratic, bounded)
    rng = np.random.default_rng(seed + 1)
    bound = lower_bound(program, x + primal * rng.normal(size=len(x)), z + dual * rng.normal(size=len(z)))
    assert bound <= known.optimum + 1e-10 * (1 + abs(known.optimum))


def test_the_bound_degrades_with_the_error_of_the_pair() -> None:
    """An error of 1e-6 in the multipliers of equalities is repaired; one in the primal costs its square."""
    program, x, z = known = known_program(7)
    rng = np.random.default_rng(8)
    off = z.copy()
    off[: program.zero] += 1e-6 * rng.normal(size=program.zero)
    assert lower_bound(program, x, off) == pytest.approx(known.optimum, rel=1e-9)
    assert lower_bound(program, x, z + 0.1 * rng.normal(size=len(z))) < known.optimum - 1e-3


def test_a_broken_vector_bounds_nothing() -> None:
    program, x, z = known_program(1)
    for broken in (np.nan, np.inf):
        bad_x, bad_z = x.copy(), z.copy()
        bad_x[0], bad_z[0] = broken, broken
        assert lower_bound(program, bad_x, z) == -np.inf
        assert lower_bound(program, x, bad_z) == -np.inf
        assert not is_infeasible(program, bad_z)
    assert not is_infeasible(program, np.zeros_like(z))


def test_dual_feasibility_is_imposed_not_assumed() -> None:
    """min x, x >= 1 (as -x + s = -1): z = 1 proves 1; z = 5 or z = -3, outside or off, prove no more."""
    program = ConeProgram(sparse.csc_array((1, 1)), np.array([1.0]), sparse.csr_array([[-1.0]]), np.array([-1.0]), 0, 1)
    assert lower_bound(program, np.array([1.0]), np.array([1.0])) == 1.0
    for z in (5.0, -3.0, 0.0, 1.5):
        assert lower_bound(program, np.array([1.0]), np.array([z])) <= 1.0


# --- infeasibility ---------------------------------------------------------------------------------------------------


def contradiction(gap: float) -> tuple[ConeProgram, np.ndarray]:
    """x = y, y >= 1 and x <= 1 - gap, with the ray that shows it."""
    A = sparse.csr_array([[1.0, -1.0], [0.0, -1.0], [1.0, 0.0]])
    program = ConeProgram(sparse.csc_array((2, 2)), np.zeros(2), A, np.array([0.0, -1.0, 1.0 - gap]), 1, 2)
    return program, np.array([-1.0, 1.0, 1.0])


@pytest.mark.parametrize("gap", [10.0, 1.0, 1e-3, 1e-6])
def test_an_infeasible_program_is_proved_so_by_its_ray(gap: float) -> None:
    program, ray = contradiction(gap)
    assert is_infeasible(program, ray)
    assert is_infeasible(program, 1e-6 * ray)
    assert is_infeasible(program, 1e6 * ray)
    assert not is_infeasible(program, -ray)


def test_stationarity_is_restored_where_the_objective_is_curved() -> None:
    """The least of |x|²/2 with x1 + ... + x8 = 1: one multiplier cannot make up for eight values that are off."""
    n = 8
    program = ConeProgram(sparse.csc_array(np.eye(n)), np.zeros(n), sparse.csr_array(np.ones((1, n))), np.ones(1), 1, 0)
    x = 1 / n + 1e-6 * np.random.default_rng(3).normal(size=n)
    assert lower_bound(program, x, np.array([-1 / n])) == pytest.approx(1 / (2 * n), rel=1e-9)


def test_a_feasible_program_is_not_proved_infeasible_by_the_same_ray() -> None:
    for gap in (-1.0, -1e-6):
        program, ray = contradiction(gap)
        assert not is_infeasible(program, ray)


def test_an_infeasible_cone_is_proved_so() -> None:
    """|(x, 1)| <= t with t <= 0.5."""
    A = sparse.csr_array([[0.0, 1.0], [0.0, -1.0], [-1.0, 0.0], [0.0, 0.0]])
    program = ConeProgram(sparse.csc_array((2, 2)), np.zeros(2), A, np.array([0.5, 0.0, 0.0, 1.0]), 0, 1, (3,))
    assert is_infeasible(program, np.array([1.0, 1.0, 0.0, -1.0]))
    wide = ConeProgram(sparse.csc_array((2, 2)), np.zeros(2), A, np.array([1.5, 0.0, 0.0, 1.0]), 0, 1, (3,))
    assert not is_infeasible(wide, np.array([1.0, 1.0, 0.0, -1.0]))


@settings(max_examples=200, deadline=None)
@given(seed=SEEDS, scale=SCALES, bounded=st.booleans())
def test_no_vector_proves_a_feasible_program_infeasible(seed: int, scale: float, bounded: bool) -> None:
    program, _, z = known_program(seed, bounded=bounded)
    rng = np.random.default_rng(seed + 1)
    assert not is_infeasible(program, rng.normal(size=len(z)))
    assert not is_infeasible(program, z + scale * rng.normal(size=len(z)))
    assert not is_infeasible(program, -z)


@settings(max_examples=100, deadline=None)
@given(seed=SEEDS)
def test_rounding_in_repeated_equalities_is_no_contradiction(seed: int) -> None:
    """Third row = first + second, right-hand sides from one point: consistent, but for the last bit."""
    rng = np.random.default_rng(seed)
    rows, x = rng.normal(size=(2, 4)), rng.normal(size=4)
    A = np.vstack([rows, rows.sum(axis=0)])
    program = ConeProgram(sparse.csc_array((4, 4)), np.zeros(4), sparse.csr_array(A), A @ x, 3, 0)
    for z in (np.array([1.0, 1.0, -1.0]), np.array([-1.0, -1.0, 1.0])):
        assert not is_infeasible(program, z)


def test_proofs_hold_for_points_within_reach() -> None:
    """A program whose only point lies far beyond REACH may be refused; one just within may not."""
    A = sparse.csr_array([[1.0]])
    near = ConeProgram(sparse.csc_array((1, 1)), np.zeros(1), A, np.array([0.99 * REACH]), 1, 0)
    for z in (-1.0, 1.0):
        assert not is_infeasible(near, np.array([z]))


# --- the certificates of solutions -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name, norm", [("jerk", "l2"), ("velocity", "linf"), ("acceleration", "l1"), ("jerk", "linf")])
def test_a_solutions_bound_is_below_every_other_answer(name: str, norm: str) -> None:
    """Bound by Clarabel's dual, answers by Clarabel and by Ipopt: bound <= both, and close to both."""
    limits = {"velocity": (-0.1, 1.7), "acceleration": 8.0, "jerk": 90.0}
    solution = solved(axis(name, norm, limits=limits, intervals=30))
    other = solved(axis(name, norm, limits=limits, intervals=30, solver="ipopt"))
    bound = solution.certificate["lower_bound"]
    assert bound <= min(solution.objective, other.objective) * (1 + 1e-9)
    assert bound >= solution.objective * (1 - 1e-6)
    assert solution.certificate["gap"] == pytest.approx(max(0.0, 1 - bound / solution.objective), abs=1e-12)
    assert "mesh" in solution.certificate["bounds"]


def test_the_bound_is_below_every_feasible_move() -> None:
    """Also below moves that are optimal for something else, in the same class."""
    objective = trajopt.Objective(terms=(term("jerk", "l2"),))
    limits = {"velocity": 1.7, "acceleration": 8.0, "jerk": 90.0}
    bound = solved(axis("jerk", "l2", limits=limits, intervals=30)).certificate["lower_bound"]
    for name, norm in (("velocity", "l2"), ("acceleration", "l2"), ("jerk", "linf"), ("jerk", "l1")):
        assert solved(axis(name, norm, limits=limits, intervals=30)).trajectory.measure(objective) >= bound


def test_a_local_optimum_claims_no_bound() -> None:
    solution = solved(axis("power", "linf", load={"inertia": 2.0}, intervals=20))
    assert solution.status is trajopt.Verdict.SOLVED_LOCAL
    assert solution.certificate["lower_bound"] is None
    assert solution.certificate["gap"] is None
    assert "local" in solution.certificate["bounds"]


@pytest.mark.parametrize("intervals", [10, 40])
def test_impossible_moves_are_found_out(intervals: int) -> None:
    """1 m in 1 s: least peak velocity 1 m/s, least peak acceleration 4 m/s², least peak jerk 32 m/s³."""
    for limits in ({"velocity": 0.9}, {"acceleration": 3.9}, {"jerk": 31.0}):
        solution = trajopt.solve(axis("jerk", "l2", limits=limits, intervals=intervals))
        assert solution.status in (trajopt.Verdict.IMPOSSIBLE, trajopt.Verdict.IMPOSSIBLE_ON_GRID)
        assert solution.objective is None
        with pytest.raises(trajopt.NoSolution, match="IMPOSSIBLE"):
            _ = solution.frame
