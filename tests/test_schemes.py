"""Schemes: rollout against integration, influence against differences, the builder's own rows on floats."""

from __future__ import annotations

from math import factorial
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import trajopt
from tests.conftest import axis
from trajopt.mesh import Mesh, mesh_for
from trajopt.scaling import sizes_of
from trajopt.schemes import EULER, EXACT, SCHEMES, Scheme
from trajopt.signals import OnFloats
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Setting, transcribe

RNG_SEED = 20230101


def uneven(intervals: int, seed: int = RNG_SEED) -> Mesh:
    """A mesh of random steps."""
    steps = np.random.default_rng(seed).uniform(0.5, 1.5, intervals)
    fractions = np.concatenate([[0.0], np.cumsum(steps)])
    return Mesh(fractions / fractions[-1])


@pytest.mark.parametrize("order", [2, 3, 4])
def test_exact_rollout_is_the_integral(order: int) -> None:
    """Against an adaptive Runge-Kutta integration, interval by interval, on uneven steps."""
    rng = np.random.default_rng(order)
    steps = uneven(12).steps * 1.7
    start, top = rng.normal(size=order), rng.normal(size=12) * 10
    chain = EXACT.rollout(start, top, steps)
    state = start.copy()
    for k, (h, u) in enumerate(zip(steps, top, strict=True)):
        run = solve_ivp(lambda _, x, u=u: np.append(x[1:], u), (0.0, h), state, rtol=1e-12, atol=1e-13)
        state = run.y[:, -1]
        assert [chain[i][k + 1] for i in range(order)] == pytest.approx(list(state), rel=1e-9, abs=1e-9)


def test_euler_rollout_is_equation_4() -> None:
    """x_{k+1} = x_k + h·dx_k, each derivative with the value at the left (Clemen & Rupp eq. 4)."""
    start, top = np.array([0.3, -1.0, 2.0]), np.array([5.0, -7.0, 11.0])
    q, v, a, j = EULER.rollout(start, top, np.full(3, 0.1))
    assert list(j) == [5.0, -7.0, 11.0]
    assert a == pytest.approx([2.0, 2.5, 1.8, 2.9], rel=1e-14)
    assert v == pytest.approx([-1.0, -0.8, -0.55, -0.37], rel=1e-14)
    assert q == pytest.approx([0.3, 0.2, 0.12, 0.065], rel=1e-14)


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=lambda s: s.name)
def test_observed_order_of_accuracy(scheme: Scheme) -> None:
    """Against jerk cos(3t), sampled in the middle (exact) or at the left (euler) of every interval."""
    errors = []
    meshes = np.array([20, 40, 80, 160])
    for n in meshes:
        t = np.arange(n) / n + (0.5 / n if scheme is EXACT else 0.0)
        velocity = scheme.rollout(np.zeros(3), np.cos(3 * t), np.full(n, 1 / n))[1]
        errors.append(abs(velocity[-1] - (1 - np.cos(3.0)) / 9))
    assert -np.polyfit(np.log(meshes), np.log(errors), 1)[0] == pytest.approx(scheme.accuracy, abs=0.1)


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=lambda s: s.name)
def test_influence_is_the_difference_of_rollouts(scheme: Scheme, order: int) -> None:
    intervals = 9
    steps = np.full(intervals, 0.13) if scheme is EULER else uneven(intervals).steps * 1.3
    base = scheme.rollout(np.zeros(order), np.zeros(intervals), steps)
    for i in range(order):
        for node in (0, 1, 5, intervals):
            effect = scheme.influence(i, order, node, steps)
            for k in range(intervals):
                pushed = scheme.rollout(np.zeros(order), np.eye(intervals)[k], steps)
                assert effect[k] == pytest.approx(pushed[i][node] - base[i][node], rel=1e-10, abs=1e-14), (i, node, k)


@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=lambda s: s.name)
@pytest.mark.parametrize("order", [2, 3, 4])
def test_rollout_has_no_defects(scheme: Scheme, order: int) -> None:
    rng = np.random.default_rng(1)
    steps = uneven(15).steps
    chain = scheme.rollout(rng.normal(size=order), rng.normal(size=15), steps)
    for i in range(order):
        grown = chain[i][:-1] + scheme.change(OnFloats(), chain, i, steps)
        assert chain[i][1:] == pytest.approx(grown, rel=1e-12, abs=1e-13)


# --- the builder on floats -------------------------------------------------------------------------------------------


class Recorder(OnFloats):
    """A model whose variables are given floats: it notes by how much each row is violated, in its own size."""

    convex = False

    def __init__(self, chain: list[np.ndarray]) -> None:
        self._chain = iter(chain)
        self.equalities: list[float] = []
        self.bounds: list[float] = []
        self.rows: list[float] = []

    def vector(self, count: int, size: float, lower: Any, upper: Any, *_: Any, **__: Any) -> np.ndarray:
        values = next(self._chain)
        assert len(values) == count
        self.bounds += [float(np.max((lower - values) / size)), float(np.max((values - upper) / size))]
        return values

    def zero(self, residual: Any, size: float = 1.0) -> None:
        self.equalities.append(float(np.max(np.abs(residual)) / size))

    def nonpositive(self, residual: Any, size: float = 1.0, name: str = "", *_: Any, **__: Any) -> None:
        self.rows.append(float(np.max(residual) / size))


def monomial(mesh: Mesh, order: int) -> list[np.ndarray]:
    """A polynomial of degree ``order`` from rest, which the exact scheme must follow without defect."""
    t = mesh.fractions
    chain = [12.0 * t ** (order - i) / factorial(order - i) for i in range(order)]
    return [*chain, np.full(mesh.intervals, 12.0)]


@pytest.mark.parametrize("order", [2, 3, 4])
def test_the_builders_rows_hold_on_a_known_polynomial(order: int) -> None:
    """Constant top derivative, uneven mesh (via points): no defect, no violated limit, all boundary states met."""
    end = {name: 12.0 / factorial(order - i) for i, name in enumerate(trajopt.problem.DERIVATIVES[:order])}
    top = trajopt.problem.DERIVATIVES[order]
    problem = axis(
        top,
        "l2",
        distance=end["position"],
        end=end,
        load={"inertia": 2.0, "viscous": 3.0},
        limits={name: 24.1 for name in ("velocity", "acceleration", top)} | {"force": 90.0},
        via=(trajopt.Via(time=0.123, position=12.0 * 0.123**order / factorial(order)),),
        intervals=20,
    )
    mesh = mesh_for(problem)
    assert mesh.intervals == 21
    recorder = Recorder(monomial(mesh, order))
    transcribe(Setting.of(problem), recorder, 1.0)
    assert len(recorder.equalities) >= 2 * order  # of each derivative its integration and its states
    assert max(recorder.equalities) <= 1e-13
    assert max(recorder.bounds) < 0
    assert max(recorder.rows) < 0


def test_the_builders_rows_see_what_is_wrong() -> None:
    """The same rows on a spoilt trajectory: one defect of its size, one violated limit between nodes."""
    problem = axis("jerk", "l2", distance="free", end={"velocity": "free", "acceleration": "free"}, intervals=10)
    mesh = mesh_for(problem)
    sizes = sizes_of(problem)
    chain = monomial(mesh, 3)
    recorder = Recorder(chain)
    transcribe(Setting.of(problem), recorder, 1.0)
    assert max(recorder.equalities) <= 1e-13
    chain[1][5] += 0.01
    spoilt = Recorder(chain)
    transcribe(Setting.of(problem), spoilt, 1.0)
    assert max(spoilt.equalities) == pytest.approx(0.01 / sizes.derivative[1], rel=1e-9)


def test_a_limit_between_nodes_is_a_row() -> None:
    """Velocity is 0.95 at every node and swings to 1.025 between: the variables' bounds see nothing, the rows do."""
    problem = axis(
        "jerk",
        "l2",
        distance="free",
        start={"velocity": 0.95, "acceleration": 1.2},
        end={"velocity": "free", "acceleration": "free"},
        limits={"velocity": 1.0},
        intervals=4,
    )
    mesh = mesh_for(problem)
    chain = EXACT.rollout(np.array([0.0, 0.95, 1.2]), np.array([-9.6, 9.6, -9.6, 9.6]), np.full(4, 0.25))
    assert chain[1] == pytest.approx(np.full(5, 0.95), rel=1e-13)
    assert np.max(velocity_at(problem, mesh, chain, np.linspace(0.0, 1.0, 2001))) == pytest.approx(1.025, rel=1e-6)
    recorder = Recorder(chain)
    transcribe(Setting.of(problem), recorder, 1.0)
    assert max(recorder.equalities) <= 1e-12
    assert max(recorder.bounds) < 0 < max(recorder.rows)


def velocity_at(problem: trajopt.Problem, mesh: Mesh, chain: list[np.ndarray], t: np.ndarray) -> np.ndarray:
    """Velocity of the exact interpolant."""
    trajectory = Trajectory(problem, mesh, EXACT, sizes_of(problem), 1.0, 0.0, tuple(chain))
    return np.asarray(trajectory.at(t)["velocity"])


# --- the interpolant -------------------------------------------------------------------------------------------------


def wild(order: int, scheme: Scheme, duration: float = 0.7, origin: float = 5.0) -> Trajectory:
    """A trajectory of random top derivative."""
    names = {2: "acceleration", 3: "jerk", 4: "snap"}
    problem = axis(names[order], "l2", intervals=11, scheme=scheme.name)
    mesh = uneven(11) if scheme is EXACT else Mesh(np.arange(12) / 11)
    rng = np.random.default_rng(order)
    start = np.concatenate([[0.0], rng.normal(size=order - 1)])
    chain = scheme.rollout(start, rng.normal(size=11), mesh.steps * duration)
    return Trajectory(problem, mesh, scheme, sizes_of(problem), duration, origin, tuple(chain))


@pytest.mark.parametrize("order, scheme", [(2, EXACT), (3, EXACT), (4, EXACT), (3, EULER)], ids=str)
def test_interpolant_meets_the_nodes_and_is_continuous(order: int, scheme: Scheme) -> None:
    trajectory = wild(order, scheme)
    names = trajopt.problem.DERIVATIVES
    at_nodes = trajectory.at(trajectory.time)
    inner = trajectory.time[1:-1]
    before, after = trajectory.at(inner * (1 - 1e-12)), trajectory.at(inner * (1 + 1e-12))
    for i in range(order):
        shift = 5.0 if i == 0 else 0.0
        assert at_nodes[names[i]] == pytest.approx(trajectory.chain[i] + shift, rel=1e-12, abs=1e-12)
        assert before[names[i]] == pytest.approx(after[names[i]], rel=1e-9, abs=1e-9)
    assert at_nodes[names[order]][:-1] == pytest.approx(trajectory.chain[order])


@pytest.mark.parametrize("order", [2, 3, 4])
def test_interpolant_is_consistent_with_its_derivatives(order: int) -> None:
    trajectory = wild(order, EXACT)
    names = trajopt.problem.DERIVATIVES
    h = 1e-6
    middles = (trajectory.time[1:] + trajectory.time[:-1]) / 2
    left, right, here = (trajectory.at(middles + d) for d in (-h, h, 0.0))
    for i in range(order):
        slope = (right[names[i]] - left[names[i]]) / (2 * h)
        assert slope == pytest.approx(here[names[i + 1]], rel=1e-6, abs=1e-8)


def test_interpolant_refuses_times_outside_the_move() -> None:
    trajectory = wild(3, EXACT)
    for t in (-1e-9, 0.7001, [0.1, np.nan]):
        with pytest.raises(ValueError, match="0 to 0.7 s"):
            trajectory.at(t)
    assert set(trajectory.at(0.7)) == {"position", "velocity", "acceleration", "jerk"}


@settings(max_examples=40, deadline=None)
@given(
    intervals=st.integers(4, 40),
    corners=st.lists(st.floats(0.01, 0.99), min_size=1, max_size=4, unique=True),
)
def test_via_states_and_corners_are_nodes(intervals: int, corners: list[float]) -> None:
    """Every via time is a node, steps stay positive, and no node is lost but to a neighbour within 1e-3 steps."""
    times = sorted(2.0 * c for c in corners)
    assume(min(np.diff([0.0, *times, 2.0])) > 1e-6)
    via = tuple(trajopt.Via(time=t, position=0.5) for t in times)
    mesh = mesh_for(axis("jerk", "l2", time=2.0, via=via, intervals=intervals))
    assert np.all(mesh.steps > 0)
    assert (mesh.fractions[0], mesh.fractions[-1]) == (0.0, 1.0)
    for t in times:
        assert mesh.fractions[mesh.node_at(t / 2.0)] == pytest.approx(t / 2.0, abs=1e-15)
    uniform = np.arange(intervals + 1) / intervals
    assert np.max(np.min(np.abs(uniform[:, None] - mesh.fractions), axis=1)) <= 1e-3 / intervals
