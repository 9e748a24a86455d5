"""Metrics: exact between the nodes, against dense sampling; and ties, which decide what profile is measured."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import sparse

import trajopt
from tests.conftest import axis, solved, table_i
from trajopt import convex_solvers
from trajopt.certificate import ConeProgram
from trajopt.mesh import Mesh
from trajopt.metrics import metrics
from trajopt.model import Claim
from trajopt.scaling import sizes_of
from trajopt.schemes import EULER, EXACT
from trajopt.trajectory import Trajectory

LOADS: dict[str, dict[str, Any]] = {
    "mass": {"inertia": 2.5},
    "viscous": {"inertia": 2.5, "viscous": 4.0},
    "by-time": {"inertia": {"time": [0.0, 0.6], "value": [1.0, 3.0]}, "viscous": 1.0},
}


def wild(order: int, load: dict[str, Any], intervals: int = 7, seed: int = 0) -> Trajectory:
    """A trajectory whose every signal changes sign and peaks between nodes."""
    name = trajopt.problem.DERIVATIVES[order]
    problem = axis(name, "l2", time=0.6, distance="free", load=load, intervals=intervals)
    mesh = Mesh(np.arange(intervals + 1) / intervals)
    rng = np.random.default_rng(seed + order)
    start = np.concatenate([[0.0], rng.normal(size=order - 1)])
    top = rng.normal(size=intervals) * 60.0 ** (order - 1)
    chain = EXACT.rollout(start, top, mesh.steps * 0.6)
    return Trajectory(problem, mesh, EXACT, sizes_of(problem), 0.6, 0.0, tuple(chain))


def sampled(trajectory: Trajectory, name: str, each: int) -> tuple[np.ndarray, np.ndarray]:
    """(intervals, each+1) times and values of a signal, by its definition, within every interval."""
    problem, time = trajectory.problem, trajectory.time
    u = np.linspace(1e-12, 1 - 1e-12, each + 1)
    t = time[:-1, None] + np.diff(time)[:, None] * u
    states = trajectory.at(t.ravel())
    if name in ("force", "power"):
        v, a = states["velocity"], states["acceleration"]
        inertia = problem.load.inertia
        mass = inertia if isinstance(inertia, float) else np.interp(t.ravel(), inertia.time, inertia.value)
        force = mass * a + problem.load.viscous * v
        return t, (force if name == "force" else force * v).reshape(t.shape)
    return t, states[name].reshape(t.shape)


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize("load", list(LOADS))
def test_metrics_against_dense_sampling(order: int, load: str) -> None:
    """2000 samples an interval: peaks to 1e-6, integrals by the trapezoidal rule to 1e-6."""
    trajectory = wild(order, LOADS[load])
    found = metrics(trajectory)
    names = [*trajopt.problem.DERIVATIVES[1 : order + 1], "force", "power"]
    for name in names:
        t, x = sampled(trajectory, name, 2000)
        assert np.min(x) < 0 < np.max(x), "a dull signal tests nothing"
        assert found[f"peak_{name}"] == pytest.approx(np.max(np.abs(x)), rel=1e-6)
        mean_square = np.sum(np.trapezoid(x**2, t, axis=1)) / 0.6
        assert found[f"rms_{name}"] == pytest.approx(np.sqrt(mean_square), rel=1e-6)
    for key, name in (("distance", "velocity"), ("energy", "power")):
        t, x = sampled(trajectory, name, 2000)
        assert found[key] == pytest.approx(np.sum(np.trapezoid(np.abs(x), t, axis=1)), rel=1e-6)
    assert set(found) == {"distance", "energy"} | {f"{kind}_{name}" for name in names for kind in ("peak", "rms")}


def test_peaks_between_nodes_are_found() -> None:
    """Parabola of velocity over one interval: 1 in the middle of a node-to-node 0."""
    problem = axis("jerk", "l2", distance="free", intervals=4)
    mesh = Mesh(np.arange(5) / 4)
    top = np.array([-128.0, 128.0, -128.0, 128.0])  # v = ±(16 s - 64 s²): peaks of 1 at s = 1/8
    chain = EXACT.rollout(np.array([0.0, 0.0, 16.0]), top, np.full(4, 0.25))
    found = metrics(Trajectory(problem, mesh, EXACT, sizes_of(problem), 1.0, 0.0, tuple(chain)))
    assert np.max(np.abs(chain[1])) <= 1e-14
    assert found["peak_velocity"] == pytest.approx(1.0, rel=1e-12)
    assert found["distance"] == pytest.approx(2 / 3, rel=1e-12)
    assert found["rms_velocity"] == pytest.approx(np.sqrt(8 / 15), rel=1e-12)
    assert found["peak_jerk"] == 128.0


def test_coulomb_friction_one_way() -> None:
    """Constant velocity profile of a trapezoid: F = m a + b v + c."""
    load = {"inertia": 2.0, "viscous": 3.0, "coulomb": 4.0}
    solution = solved(
        axis(
            "velocity",
            "linf",
            distance=0.16,
            limits={"velocity": (0.0, 1.0), "acceleration": 1.0},
            load=load,
            intervals=25,
        )
    )  # v = 0.2, a = 1
    assert solution.metrics["peak_force"] == pytest.approx(2.0 + 3.0 * 0.2 + 4.0, rel=1e-5)
    assert solution.metrics["peak_power"] == pytest.approx(0.2 * (2.0 + 3.0 * 0.2 + 4.0), rel=1e-5)


def test_coulomb_friction_both_ways() -> None:
    """There and back: the force jumps by twice the friction where the velocity changes its sign, between nodes."""
    load = {"inertia": 2.0, "coulomb": 4.0}
    problem = axis(
        "acceleration", "l2", distance=0.0, start={"velocity": 1.0}, end={"velocity": -1.0}, load=load, intervals=7
    )  # a = -2 throughout
    solution = solved(problem)
    assert solution.metrics["peak_force"] == pytest.approx(8.0, rel=1e-9)
    assert solution.metrics["rms_force"] == pytest.approx(np.sqrt((0.0 + 64.0) / 2), rel=1e-9)
    assert solution.metrics["peak_power"] == pytest.approx(8.0, rel=1e-9)
    assert solution.metrics["energy"] == pytest.approx(8.0 * 0.25, rel=1e-9)


def test_euler_metrics_are_sums_over_nodes() -> None:
    problem = axis("jerk", "l2", load={"inertia": 2.0}, intervals=10, scheme="euler", distance="free")
    mesh = Mesh(np.arange(11) / 10)
    chain = EULER.rollout(np.zeros(3), np.cos(np.arange(10.0)), np.full(10, 0.1))
    found = metrics(Trajectory(problem, mesh, EULER, sizes_of(problem), 1.0, 0.0, tuple(chain)))
    power = 2.0 * chain[2] * chain[1]
    assert found["peak_power"] == np.max(np.abs(power))
    assert found["energy"] == pytest.approx(np.trapezoid(np.abs(power), dx=0.1), rel=1e-13)
    assert found["peak_velocity"] == np.max(np.abs(chain[1]))


def test_known_metrics_of_a_minimum_jerk_move() -> None:
    """10u³-15u⁴+6u⁵: peaks 15/8, 5.7735, 60; rms jerk √720 (closed_forms.md)."""
    solution = solved(axis("jerk", "l2", load={"inertia": 3.0}, intervals=400))
    assert solution.metrics["peak_velocity"] == pytest.approx(15 / 8, rel=1e-4)
    assert solution.metrics["peak_acceleration"] == pytest.approx(10 / np.sqrt(3), rel=1e-4)
    assert solution.metrics["peak_jerk"] == pytest.approx(60.0, rel=2e-2)
    assert solution.metrics["rms_jerk"] == pytest.approx(np.sqrt(720), rel=1e-4)
    assert solution.metrics["energy"] == pytest.approx(3.0 * (15 / 8) ** 2, rel=1e-4)
    assert solution.metrics["distance"] == pytest.approx(1.0, rel=1e-12)


# --- ties ------------------------------------------------------------------------------------------------------------


def test_a_tie_is_broken_by_smoothness_and_said() -> None:
    """L1 of velocity is the distance for every move one way: what comes out is the minimum-jerk profile."""
    tied = solved(table_i("velocity", "l1"))
    smooth = solved(table_i("jerk", "l2"))
    assert not tied.route.unique
    assert "velocity l1 held, jerk l2 minimised" in tied.route.tie_break
    assert tied.objective == pytest.approx(0.254, rel=1e-9)
    for i, size in ((0, 0.254), (1, 0.5), (2, 4.905)):
        assert np.max(np.abs(tied.trajectory.chain[i] - smooth.trajectory.chain[i])) <= 1e-5 * size
    assert smooth.route.tie_break == ""


@pytest.mark.parametrize(
    "name, norm",
    [("velocity", "l1"), ("acceleration", "l1"), ("velocity", "linf"), ("acceleration", "linf"), ("jerk", "linf")],
)
def test_a_broken_tie_gives_the_same_profile_again(name: str, norm: str) -> None:
    """The same move in other units takes another path through the solver; the profile must not notice."""
    limits = {"velocity": (0.0, 1.8), "acceleration": 9.0, "jerk": 120.0}
    scale = 1e-3 / 7.0
    small = {k: tuple(scale * x for x in v) if isinstance(v, tuple) else scale * v for k, v in limits.items()}
    one = solved(axis(name, norm, limits=limits, intervals=50))
    other = solved(axis(name, norm, distance=scale, limits=small, intervals=50))
    velocity = one.trajectory.chain[1]
    assert np.max(np.abs(velocity - other.trajectory.chain[1] / scale)) <= 1e-4 * np.max(velocity)


def test_a_broken_tie_does_not_depend_on_the_mesh() -> None:
    """Minimum-jerk profiles approach each other as the mesh is refined; untamed optima of L1 would not."""
    limits = {"velocity": (0.0, 2.5)}
    load = {"inertia": 1.0}
    coarse, fine = (
        solved(axis("velocity", "l1", limits={**limits, "jerk": 200.0}, load=load, intervals=n)) for n in (40, 160)
    )
    t = np.linspace(0.0, 1.0, 101)
    assert coarse.at(t)["velocity"] == pytest.approx(fine.at(t)["velocity"], abs=5e-3)


@pytest.mark.parametrize("name, norm", [("velocity", "linf"), ("acceleration", "l1")])
def test_a_tie_broken_near_the_first_optimum_is_the_one_of_all_rows(
    name: str, norm: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = table_i(name, norm, intervals=1000)
    near = solved(problem)
    monkeypatch.setattr(convex_solvers, "_FAR", np.inf)
    full = solved(problem)
    assert near.objective == pytest.approx(full.objective, rel=1e-9)
    for ours, theirs in zip(near.trajectory.chain[:3], full.trajectory.chain[:3], strict=True):
        assert np.max(np.abs(ours - theirs)) <= 1e-4 * np.max(np.abs(theirs))


def test_rows_far_from_a_point_count_as_well() -> None:
    """min x² - 6x + y² within x <= 1, x + y = 2: from x = 0 the limit is far, and without it x is 2.5."""
    A = sparse.csr_array([[1.0, 1.0], [1.0, 0.0], [0.0, -1.0]])
    program = ConeProgram(sparse.csc_array(2 * np.eye(2)), np.array([-6.0, 0.0]), A, np.array([2.0, 1.0, 9.0]), 1, 2)
    for rung in convex_solvers.QUADRATIC:
        claim, _, _, x, z = convex_solvers.run(rung, program, None, near=np.array([0.0, 2.0]))
        assert claim is Claim.OPTIMAL
        assert x == pytest.approx([1.0, 1.0], abs=1e-7)
        assert z == pytest.approx([-2.0, 6.0, 0.0], abs=1e-6)
        claim, _, _, x, z = convex_solvers.run(rung, program, None, near=np.array([1.0, 1.0]))
        assert (claim, x) == (Claim.OPTIMAL, pytest.approx([1.0, 1.0], abs=1e-7))
        assert z == pytest.approx([-2.0, 6.0, 0.0], abs=1e-6)


@pytest.mark.parametrize("name", ["acceleration", "jerk"])
def test_a_strictly_convex_norm_says_nothing(name: str) -> None:
    solution = solved(table_i(name, "l2"))
    assert solution.route.tie_break == ""
    assert solution.route.unique


def test_a_tie_breaking_solve_does_not_spoil_the_optimum() -> None:
    """Held to 1e-8 or better: against Ipopt, which breaks no ties."""
    limits = {"velocity": (0.0, 1.8), "acceleration": 9.0, "jerk": 120.0}
    tied = solved(axis("acceleration", "linf", limits=limits))
    raw = solved(axis("acceleration", "linf", limits=limits, solver="ipopt"))
    assert tied.objective == pytest.approx(raw.objective, rel=2.5e-8)
