"""Loads over position: the slider-crank of the reference, in the builder, through Ipopt, and checked."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest

import norms
import trajopt
from problems import slider_crank
from tests.conftest import solved, term
from trajopt import checker, preflight
from trajopt.attempt import Clock, NonconvexProgram, nonconvex, to
from trajopt.checker.splines import Spline
from trajopt.metrics import metrics
from trajopt.rebuild import rebuild
from trajopt.several_starts import best_of_starts, from_several_starts, starts
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Setting

FREE_PROFILE = 9.593082  # N m RMS, of the reference


def crank(minimize: Any = "force", norm: Any = "l2", *, intervals: int = 40, load: Any = None, **more: Any) -> Any:
    """The crank's move with free accelerations at its ends; ``more`` goes to limits, but time, places, ``ends``."""
    terms = minimize if isinstance(minimize, list) else [term(minimize, norm)]
    free = {"acceleration": more.pop("ends", "free")}
    return trajopt.Problem(
        move=trajopt.Move(
            time=more.pop("time", slider_crank.DURATION),
            start=trajopt.State(position=more.pop("start", 0.0), **free),
            end=trajopt.State(position=more.pop("end", slider_crank.TURN), **free),
            dwell=more.pop("dwell", 0.0),
        ),
        limits=trajopt.Limits(**more),
        load=load or slider_crank.load(),
        objective=trajopt.Objective(terms=tuple(terms)),
        transcription=trajopt.Transcription(intervals=intervals),
        rotary=True,
    )


@pytest.fixture(scope="session")
def free_profile() -> trajopt.Solution:
    return solved(trajopt.load("slider_crank"))


def test_the_mechanism_is_that_of_the_reference() -> None:
    at = np.deg2rad([0.0, 74.295, 173.0])
    np.testing.assert_allclose(
        slider_crank.inertia(at), [0.0027421875, 0.0117777633, 0.0028017542], rtol=0, atol=5e-11
    )
    torque = slider_crank.load_torque(np.linspace(0.0, np.deg2rad(173), 200_001))
    assert np.max(torque) == pytest.approx(1.9112839, abs=5e-8)
    fine = np.linspace(0.1, 3.0, 50)
    slope = (slider_crank.inertia(fine + 1e-6) - slider_crank.inertia(fine - 1e-6)) / 2e-6
    np.testing.assert_allclose(slider_crank.inertia_slope(fine), slope, atol=1e-10)


def test_a_table_a_degree_apart_gives_the_curve_and_its_slope() -> None:
    load, at = slider_crank.load(), np.linspace(0.0, slider_crank.TURN, 1001)
    np.testing.assert_allclose(load.curves["inertia"].at(at), slider_crank.inertia(at), atol=1e-12)
    np.testing.assert_allclose(load.curves["force"].at(at), slider_crank.load_torque(at), atol=1e-12)
    np.testing.assert_allclose(load.curves["inertia"].at(at, 1), slider_crank.inertia_slope(at), atol=1e-11)
    ready = trajopt.load("slider_crank")
    assert isinstance(ready, trajopt.Problem) and len(ready.load.curves) == 2
    np.testing.assert_allclose(ready.load.curves["inertia"].value, load.curves["inertia"].value, rtol=1e-14)


@pytest.mark.parametrize("rows", [6, 7, 9, 30, 400])
def test_the_checker_has_the_same_splines_by_its_own_means(rows: int) -> None:
    rng = np.random.default_rng(rows)
    position = np.cumsum(rng.uniform(0.5, 1.5, rows))
    curve = trajopt.Curve(position=position, value=np.sin(position / rows * 6))
    spline = Spline(position, np.array(curve.value))
    at = rng.uniform(*curve.span, 200)
    for derivative in (0, 1):
        np.testing.assert_allclose(spline.at(at, derivative), curve.at(at, derivative), atol=1e-11)
    start, length = curve.span[0] + 0.2, 0.1  # a parabola of s within one stretch, put into the spline
    s = np.linspace(0.0, 1.0, 7)
    for derivative in (0, 1):
        rows_along = spline.along(np.array([[start, length, length]]), derivative)
        values = np.polynomial.polynomial.polyval(s, rows_along[0])
        np.testing.assert_allclose(values, curve.at(start + length * (s + s**2), derivative), atol=1e-11)


def test_the_free_profile_is_that_of_the_reference(free_profile: trajopt.Solution) -> None:
    assert free_profile.objective == pytest.approx(FREE_PROFILE, rel=1e-6)
    assert free_profile.metrics["rms_force"] == pytest.approx(FREE_PROFILE, rel=1e-6)
    assert free_profile.status is trajopt.Verdict.SOLVED_LOCAL
    assert free_profile.certificate["agreed"] == free_profile.certificate["starts"] == 3
    assert "depend on the position" in free_profile.route.reason
    position = free_profile.frame["position"].to_numpy()
    assert position.min() >= 0 and position.max() <= slider_crank.TURN * (1 + 1e-12)


def test_its_torque_is_equation_1(free_profile: trajopt.Solution) -> None:
    frame = free_profile.frame
    q, v, a = (frame[name].to_numpy() for name in ("position", "velocity", "acceleration"))
    torque = slider_crank.load_torque(q) + slider_crank.inertia_slope(q) * v**2 / 2 + slider_crank.inertia(q) * a
    np.testing.assert_allclose(frame["force"], torque, atol=1e-8)
    np.testing.assert_allclose(frame["power"], torque * v, atol=1e-6)
    energy = np.trapezoid(frame["power"], frame["time"])  # without friction: what gravity has stored
    along = np.linspace(0.0, slider_crank.TURN, 20_001)
    lifted = np.trapezoid(slider_crank.load_torque(along), along)
    assert energy == pytest.approx(lifted, rel=1e-3)


def test_forty_random_starts_reach_the_same_optimum() -> None:
    problem = crank(intervals=30)
    setting, rng, values = Setting.of(problem), np.random.default_rng(1), []
    for _ in range(40):
        top = rng.standard_normal(30) * setting.sizes.derivative[3]
        start = rebuild(problem, setting.mesh, setting.scheme, setting.sizes, slider_crank.DURATION, np.zeros(3), top)
        attempt = nonconvex(setting, to(problem.objective), Clock(), start)
        assert attempt.trajectory is not None, attempt.outcome.raw_status
        values.append(attempt.value)
    assert max(values) / min(values) - 1 < 1e-6


def test_a_run_depends_on_its_start_alone() -> None:
    """Not on the factor of the objective that Ipopt had asked the last Hessian for in the run before it."""
    problem = crank(intervals=40)
    setting = Setting.of(problem)
    program = NonconvexProgram(setting, to(problem.objective), Clock())
    start = next(starts(setting, Clock())).trajectory
    assert start is not None
    fresh = program.run(start)
    program._model._nlp.set_obj_factor(0.16)
    again = program.run(start)
    assert (again.outcome.iterations, again.value) == (fresh.outcome.iterations, fresh.value)


def test_starts_are_tried_on_a_coarse_mesh_and_lead_to_the_same_optimum() -> None:
    problem = crank(intervals=120)
    setting = Setting.of(problem)
    found = from_several_starts(setting, Clock())
    assert found.trajectory is not None and found.trajectory.mesh.intervals == 120
    assert found.notes["starts"] == found.notes["agreed"] == 3
    best = best_of_starts(setting, Clock())
    assert found.value == pytest.approx(best.value, rel=1e-9)


def test_ipopt_has_exact_derivatives_of_the_curves() -> None:
    from trajopt.model_pyomo import NonconvexModel
    from trajopt.objective import lower
    from trajopt.transcribe import transcribe

    problem = crank(intervals=4, force=30.0)
    setting, model = Setting.of(problem), NonconvexModel()
    transcript = transcribe(setting, model, slider_crank.DURATION)
    model.minimize(lower(transcript, problem.objective).expression)
    nlp, _, _ = model._interface(None)
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0.1, 0.9, nlp.n_primals()), rng.standard_normal(nlp.n_constraints())

    def lagrangian(at: Any) -> Any:
        nlp.set_primals(at)
        return nlp.evaluate_grad_objective() + nlp.evaluate_jacobian().T @ y

    nlp.set_duals(y)
    nlp.set_obj_factor(1.0)
    nlp.set_primals(x)
    jacobian, hessian = nlp.evaluate_jacobian().toarray(), nlp.evaluate_hessian_lag().toarray()
    hessian = np.tril(hessian) + np.tril(hessian, -1).T
    for k in rng.choice(len(x), 12, replace=False):
        step = np.zeros(len(x))
        step[k] = 1e-6
        nlp.set_primals(x + step)
        above = nlp.evaluate_constraints().copy()
        nlp.set_primals(x - step)
        column = (above - nlp.evaluate_constraints()) / 2e-6
        np.testing.assert_allclose(jacobian[:, k], column, atol=1e-6 * max(1.0, np.max(np.abs(column))))
        curvature = (lagrangian(x + step) - lagrangian(x - step)) / 2e-6
        np.testing.assert_allclose(hessian[:, k], curvature, atol=1e-5 * max(1.0, np.max(np.abs(curvature))))


MOTOR = {"torque_constant": 1.2, "resistance": 0.5, "recovery": 0.3, "viscous": 0.01}


@pytest.mark.parametrize(
    ("minimize", "norm", "limits", "load"),
    [
        ("force", "linf", {"velocity": 70.0}, {}),
        ("force", "l1", {"velocity": 70.0, "jerk": 2e6}, {}),
        ("power", "linf", {"velocity": 60.0, "acceleration": 9000.0}, {"viscous": 0.02}),
        ("energy", None, {"acceleration": 9000.0, "jerk": 3e6}, {"coulomb": 0.2}),
        ("copper_loss", None, {"current": 14.0, "voltage": 80.0}, MOTOR),
        ("electrical_energy", None, {"acceleration": 9000.0, "velocity": (0.0, 70.0), "brake_energy": 12.0}, MOTOR),
        ([term("force", "l2"), term("jerk", "l2", 1e-6)], None, {"force": 16.5}, {}),
        ("snap", "l2", {"force": 26.0}, {}),
    ],
)  # fmt: skip
def test_every_objective_and_limit_goes_through_the_same_builder(
    minimize: Any, norm: Any, limits: dict[str, Any], load: dict[str, Any]
) -> None:
    solution = solved(crank(minimize, norm, intervals=30, load=slider_crank.load(**load), **limits))
    assert solution.audit["passed"] and solution.audit["excess"] <= 1e-9, solution.audit
    assert checker.check(solution.to_dict(), strict=True).passed


def test_a_torque_limit_holds_between_the_samples() -> None:
    solution = solved(crank(force=14.0))
    assert solution.audit["excess"] <= 1e-9
    assert solution.metrics["peak_force"] == pytest.approx(14.0, rel=1e-3)  # drawn in by what sagged between, O(h²)
    assert solution.metrics["peak_force"] <= 14.0 * (1 + 2e-9)
    assert solution.objective is not None and solution.objective > FREE_PROFILE


def test_without_an_acceleration_the_order_is_two_and_costs_more() -> None:
    free = crank(intervals=40)
    coarse = solved(free.replace(move=free.move.model_copy(update={
        which: getattr(free.move, which).model_copy(update={"acceleration": None}) for which in ("start", "end")
    })))  # fmt: skip
    assert coarse.trajectory is not None and coarse.trajectory.order == 2
    assert FREE_PROFILE < coarse.metrics["rms_force"] < FREE_PROFILE * 1.01


def test_an_end_condition_on_acceleration_alone_is_void(free_profile: trajopt.Solution) -> None:
    """The same infimum, reached as O(h)."""
    held = [solved(crank(intervals=n, ends=None, jerk=1e12)).metrics["rms_force"] for n in (30, 60)]
    above = [rms / FREE_PROFILE - 1 for rms in held]
    assert 0 < above[1] < 0.7 * above[0]


def test_the_way_back_mirrors_the_way_there(free_profile: trajopt.Solution) -> None:
    back = solved(trajopt.load("slider_crank_return"))
    assert back.objective == pytest.approx(free_profile.objective, rel=1e-8)
    there, here = (solution.frame["position"].to_numpy() for solution in (free_profile, back))
    np.testing.assert_allclose(here[::-1], there, atol=1e-5)
    rms = slider_crank.cycle_rms(free_profile, back)
    assert rms == pytest.approx(FREE_PROFILE, rel=1e-6)  # without a dwell


def test_in_a_cycle_the_dwell_cools_the_motor() -> None:
    solution = solved(trajopt.load("slider_crank_dwell", ["transcription.intervals=30"]))
    problem = solution.problem
    held = slider_crank.load_torque(np.array(slider_crank.TURN))
    cycle = slider_crank.DURATION + problem.move.dwell
    rms = math.sqrt((solution.metrics["rms_force"] ** 2 * slider_crank.DURATION + held**2 * 0.04) / cycle)
    assert rms <= 8.2 * (1 + 1e-9)
    hotter = solved(problem.replace(limits=problem.limits.model_copy(update={"rms_force": trajopt.Limit(max=7.9)})))
    assert hotter.metrics["peak_force"] > solution.metrics["peak_force"] * 1.001


def test_the_fastest_move_under_a_torque_limit_is_bang_bang() -> None:
    solution = solved(crank("time", None, intervals=40, time="free", force=20.0, velocity=200.0, acceleration=3e4))
    assert solution.duration is not None and solution.duration < slider_crank.DURATION
    force = np.abs(solution.frame["force"].to_numpy())
    assert np.mean(force > 19.5) > 0.95 and solution.audit["excess"] <= 1e-9  # but where it changes its sign


def test_the_checker_finds_a_force_that_is_not_there(free_profile: trajopt.Solution) -> None:
    honest = free_profile.to_dict()
    assert checker.check(honest, strict=True).passed
    for edit in (
        lambda data: data.update(objective=data["objective"] * (1 - 3e-6)),
        lambda data: data["metrics"].update(peak_force=data["metrics"]["peak_force"] * (1 - 3e-6)),
        lambda data: data["metrics"].update(energy=data["metrics"]["energy"] * (1 + 3e-6)),
        lambda data: data["problem"]["load"]["inertia"]["value"].__setitem__(100, 0.0117),
        lambda data: data["problem"]["limits"].pop("position"),
    ):
        data = copy.deepcopy(honest)
        edit(data)
        assert not checker.check(data).passed


def test_the_checker_measures_what_scipy_integrates(free_profile: trajopt.Solution) -> None:
    from scipy.integrate import quad

    def torque(t: float) -> float:
        x = free_profile.at(t)
        q, v, a = (x[name] for name in ("position", "velocity", "acceleration"))
        turning = slider_crank.inertia_slope(q) * v**2 / 2 + slider_crank.inertia(q) * a
        return float(slider_crank.load_torque(q) + turning)

    time, measured = free_profile.frame["time"].to_numpy(), checker.measure(free_profile.to_dict())
    square = sum(quad(lambda t: torque(t) ** 2, a, b)[0] for a, b in zip(time[:-1:4], time[4::4], strict=True))
    assert measured["rms_force"] == pytest.approx(math.sqrt(square / time[-1]), rel=1e-9)


def test_a_linear_axis_has_a_mass_over_position_too() -> None:
    mass = trajopt.Curve.of(lambda x: 4 + np.cos(3 * x), -0.1, 1.1, 100)
    problem = trajopt.Problem(
        move=trajopt.Move(time=1.0, end=trajopt.State(position=1.0)), load=trajopt.Load(inertia=mass, viscous=0.5),
        objective=trajopt.Objective(terms=(term("energy"), term("jerk", norms.L2(), 1e-4))),
        limits=trajopt.Limits(jerk=500.0), transcription=trajopt.Transcription(intervals=30),
    )  # fmt: skip
    assert solved(problem).audit["passed"]


def test_a_constant_curve_is_a_constant() -> None:
    constant = {"inertia": 0.005}
    curve = {"inertia": trajopt.Curve.of(lambda q: 0.005 + 0 * q, -1.0, 4.0)}
    plain, along = (solved(crank(load=trajopt.Load(**load), intervals=40)) for load in (constant, curve))
    assert along.metrics["rms_force"] == pytest.approx(plain.metrics["rms_force"], rel=1e-5)


def test_degrees_taken_for_radians_are_warned_of() -> None:
    slip = trajopt.Load(inertia=trajopt.Curve.of(lambda q: 0.005 + 0 * q, 0.0, 173.0))
    (warning,) = preflight.warnings(crank(load=slip))
    assert "57 times the move; degrees taken for radians?" in warning
    assert preflight.warnings(crank()) == []


def test_the_table_is_a_position_limit_and_goes_into_the_hash() -> None:
    problem, narrow = crank(), crank(position=(-0.05, 4.0))
    low, high = problem.load.curves["inertia"].span
    assert problem.limits.position == trajopt.Limit(min=low, max=high)
    assert narrow.limits.position == trajopt.Limit(min=-0.05, max=high)
    assert trajopt.Problem.model_validate(problem.canonical()) == problem
    assert problem.hash != crank(load=slider_crank.load(step=0.5)).hash


@pytest.mark.parametrize("seed", range(12))
def test_metrics_and_checker_agree_on_moves_that_nobody_optimised(seed: int) -> None:
    """Smooth random moves of order 2 to 4, forwards and back, with friction and a motor: every number but those of
    limits and ends is found again."""
    rng = np.random.default_rng(seed)
    order, duration, count = 2 + seed % 3, 0.08, int(rng.integers(6, 40))
    load = slider_crank.load(
        step=float(rng.choice([0.5, 2.0, 8.0])), viscous=0.02, coulomb=0.3 * (seed % 2), torque_constant=1.1,
        resistance=0.4, switching=0.5, recovery=0.5,
    )  # fmt: skip
    name, norm = [("force", "l2"), ("power", "l1"), ("energy", None), ("electrical_energy", None)][seed % 4]
    limit = {2: {}, 3: {"jerk": 1e9}, 4: {"snap": 1e12}}[order]
    problem = crank(name, norm, intervals=count, load=load, time=duration, ends=None, **limit)
    setting = Setting.of(problem)
    s = (np.arange(count) + 0.5) / count
    wave = 1.5 * np.sin(2 * np.pi * s) + rng.standard_normal() * np.sin(4 * np.pi * s)
    top = wave * 3 / duration**order * (2 * np.pi) ** (order - 2)
    chain = setting.scheme.rollout(np.array([1.0, *np.zeros(order - 1)]), top, setting.mesh.steps * duration)
    low, high = min(chain[0]), max(chain[0])
    scale = min(1.0, 1.9 / (high - low))
    chain = [x * scale for x in chain]
    chain[0] = chain[0] - min(chain[0]) + 0.3
    trajectory = Trajectory(problem, setting.mesh, setting.scheme, setting.sizes, duration, 0.0, tuple(chain))
    found = metrics(trajectory)
    solution = trajopt.Solution(
        trajopt.Verdict.SOLVED_LOCAL, problem, trajopt.route(problem), trajectory.measure(problem.objective), duration,
        found, {"lower_bound": None, "gap": None}, trajectory=trajectory,
    )  # fmt: skip
    for strict in (False, True):
        failed = checker.check(solution.to_dict(), strict=strict).failed
        wrong = [str(check) for check in failed if not check.name.startswith(("limit", "start", "end"))]
        assert not wrong, wrong
