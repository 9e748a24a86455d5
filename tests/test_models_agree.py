"""One builder, several models: CVXPY with Clarabel or OSQP and Pyomo with Ipopt find the same optimum."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import piqp
import pytest

import trajopt
from tests.conftest import axis, solved, term
from trajopt.attempt import Clock, convex, smoothest, to
from trajopt.model_cvxpy import ConvexModel
from trajopt.transcribe import Setting, transcribe

LIMITS = {"velocity": (-0.1, 1.7), "acceleration": (-9.0, 7.0), "jerk": (-90.0, 70.0)}
LOAD = {"inertia": 2.0, "viscous": 3.0}
FRICTION = {**LOAD, "coulomb": 2.0}
HEAVIER = {"inertia": {"time": [0.0, 0.4, 1.0], "value": [2.0, 2.0, 5.0]}, "viscous": 1.0}
SLOWER = {
    "velocity": {"min": -0.5, "max": trajopt.Table(time=(0.0, 0.33, 0.6, 1.0), value=(2.0, 2.0, 1.1, 1.1))},
    "acceleration": {"time": [0.0, 0.5, 1.0], "value": [10.0, 6.0, 12.0]},
}

CASES: dict[str, dict[str, Any]] = {
    f"{name}-{norm}": {"minimize": name, "norm": norm, "limits": LIMITS, "load": LOAD}
    for name in ("position", "velocity", "acceleration", "jerk", "snap", "force")
    for norm in ("l1", "l2", "linf")
} | {
    "limits-by-time": {"minimize": "acceleration", "norm": "l2", "limits": SLOWER},
    "limits-by-time-l1": {"minimize": "acceleration", "norm": "l1", "limits": SLOWER},
    "via": {
        "minimize": "jerk",
        "norm": "l2",
        "via": (trajopt.Via(time=0.37, position=0.6, velocity=1.0), trajopt.Via(time=0.6, position=0.7)),
    },
    "via-linf": {"minimize": "acceleration", "norm": "linf", "via": (trajopt.Via(time=0.37, position=0.6),)},
    "free-end": {
        "minimize": "acceleration",
        "norm": "l1",
        "limits": LIMITS,
        "end": {"velocity": "free", "acceleration": "free"},
    },
    "free-end-position": {
        "minimize": "jerk",
        "norm": "l2",
        "distance": "free",
        "end": {"velocity": 1.5, "acceleration": "free"},
    },
    "free-start": {
        "minimize": "jerk",
        "norm": "linf",
        "limits": {"position": (-1.0, 2.0), "velocity": (-0.3, 2.0)},
        "start": {"position": "free", "velocity": -0.2, "acceleration": "free"},
    },
    "friction-l1": {
        "minimize": "force",
        "norm": "l1",
        "load": FRICTION,
        "limits": {"velocity": (0.0, 1.7), "acceleration": 9.0, "force": 25.0},
    },
    "friction-l2": {
        "minimize": "force",
        "norm": "l2",
        "load": FRICTION,
        "limits": {"velocity": (0.0, 1.7), "acceleration": 9.0, "jerk": 90.0},
    },
    "friction-backwards": {
        "minimize": "force",
        "norm": "linf",
        "load": FRICTION,
        "distance": -1.0,
        "limits": {"velocity": (-1.7, 0.0), "acceleration": 9.0},
    },
    "mass-by-time-l2": {"minimize": "force", "norm": "l2", "limits": {"jerk": 90.0}, "load": HEAVIER},
    "mass-by-time-linf": {"minimize": "force", "norm": "linf", "limits": {"acceleration": 9.0}, "load": HEAVIER},
    "sum-of-linear": {
        "minimize": [term("jerk", "l1", 0.1), term("velocity", "linf", 2.0)],
        "limits": LIMITS,
    },
    "sum-with-cones": {
        "minimize": [term("jerk", "l2", 0.1), term("velocity", "l2", 2.0), term("force", "linf", 0.1)],
        "limits": LIMITS,
        "load": LOAD,
    },
    "euler-jerk-l1": {"minimize": "jerk", "norm": "l1", "limits": LIMITS, "scheme": "euler"},
    "euler-force-l2": {
        "minimize": "force",
        "norm": "l2",
        "limits": {"velocity": (0.0, 1.7)},
        "load": FRICTION,
        "scheme": "euler",
    },
    "euler-sum": {
        "minimize": [term("acceleration", "l2"), term("jerk", "linf", 0.1)],
        "limits": LIMITS,
        "scheme": "euler",
    },
}
QUADRATIC = (
    "acceleration-l2",
    "jerk-l2",
    "snap-l2",
    "force-l2",
    "limits-by-time",
    "via",
    "free-end-position",
    "friction-l2",
    "mass-by-time-l2",
    "euler-force-l2",
)


@pytest.mark.parametrize("case", list(CASES))
def test_cvxpy_and_pyomo_agree(case: str) -> None:
    """The same convex problem to 1e-7; the profile as well, wherever a strictly convex norm determines it."""
    convex = solved(axis(**CASES[case], intervals=30))
    local = solved(axis(**CASES[case], intervals=30, solver="ipopt"))
    assert convex.route.model in ("cvxpy", "closed form") and local.route.solver == "ipopt"
    assert convex.status is trajopt.Verdict.SOLVED
    assert convex.objective == pytest.approx(local.objective, rel=1e-7)
    assert convex.certificate["lower_bound"] <= local.objective * (1 + 1e-9)
    if CASES[case].get("norm") == "l2" and CASES[case]["minimize"] not in ("position", "velocity"):
        top = convex.trajectory.chain[-1]
        assert np.max(np.abs(top - local.trajectory.chain[-1])) <= 1e-3 * np.max(np.abs(top))


@pytest.mark.parametrize("case", QUADRATIC)
def test_solvers_agree_on_quadratic_programs(case: str) -> None:
    asked = ("clarabel", "piqp", "osqp")
    found = [solved(axis(**CASES[case], intervals=30, solver=solver)) for solver in asked]
    assert [solution.route.solver for solution in found] == list(asked)
    clarabel, piqp, osqp = (solution.objective for solution in found)
    assert piqp == pytest.approx(clarabel, rel=1e-8)
    assert osqp == pytest.approx(clarabel, rel=1e-6)


@pytest.mark.parametrize("limits", [LIMITS, {"velocity": 1.7, "acceleration": (-9.0, 6.5), "jerk": 60.0}])
def test_multipliers_of_rows_with_two_sides_are_those_of_two_rows(limits: dict[str, Any]) -> None:
    found = [solved(axis("jerk", "l2", limits=limits, intervals=30, solver=solver)) for solver in ("piqp", "clarabel")]
    piqp, clarabel = ({row["name"]: row["per_unit"] for row in solution.prices} for solution in found)
    assert piqp == pytest.approx(clarabel, rel=1e-5, abs=1e-7) and any(piqp.values())


def test_piqp_gets_one_row_for_both_sides_of_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """And no row, and no variable, for position between the ends."""
    seen: list[int] = []

    class Watched(piqp.SparseSolver):
        def setup(self, **data: Any) -> None:
            seen.append(data["G"].shape[0])
            super().setup(**data)

    monkeypatch.setattr(piqp, "SparseSolver", Watched)
    model, count = ConvexModel(), 30
    free = axis("jerk", "l2", limits=LIMITS, intervals=count)
    transcribe(Setting.of(free), model, 1.0)
    program = model.program
    first, second = program.opposite
    inequalities = program.A[program.zero :]
    assert abs(inequalities[first] + inequalities[second]).max() == 0.0
    assert len(second) == inequalities.shape[0] / 2
    assert program.A.shape[1] == 2 + 2 * (count + 1) + count
    limited = axis("jerk", "l2", limits={**LIMITS, "position": (-9.0, 9.0)}, intervals=count)
    transcribe(Setting.of(limited), whole := ConvexModel(), 1.0)
    assert whole.program.A.shape[1] == program.A.shape[1] + count - 1
    found = [solved(problem).objective for problem in (limited, free)]
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    assert seen[-1] == len(second)


@pytest.mark.parametrize("first", [term("acceleration", "linf"), term("position", "l2")])
def test_rows_that_are_built_serve_another_objective(first: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the rows that its answer is far from, and solved to what a program of its own gives; rows cannot be added
    any more."""
    rows: list[int] = []

    class Watched(piqp.SparseSolver):
        def setup(self, G: Any, **data: Any) -> None:
            rows.append(G.shape[0])
            super().setup(G=G, **data)

    monkeypatch.setattr(piqp, "SparseSolver", Watched)
    setting = Setting.of(axis(first.minimize, "l2", limits=LIMITS, intervals=30))
    other = to(smoothest(setting.problem))
    once = convex(setting, 1.0, to(trajopt.Objective(terms=(first,))), Clock(), "piqp")
    again = convex(setting, 1.0, other, Clock(), "piqp", again=once)
    assert rows[1] < rows[0]
    alone = convex(setting, 1.0, other, Clock(), "piqp")
    assert again.value == pytest.approx(alone.value, rel=1e-9) and again.bound == pytest.approx(alone.bound, rel=1e-9)
    assert again.laid is not None
    with pytest.raises(RuntimeError, match="rows cannot be added"):
        again.laid[1].model.nonpositive(again.laid[1].chain[1])


@pytest.mark.parametrize("solver", ["piqp", "clarabel"])
def test_a_solver_that_is_missing_is_named(solver: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, solver, None)
    with pytest.raises(trajopt.MissingSolver, match=f"^{solver} is not installed; 'pip install {solver}'"):
        trajopt.solve(axis("jerk", "l2", intervals=20, solver=solver))


def test_a_large_mesh_is_solved_by_the_firm_setting() -> None:
    """Beyond N = 10000, where the quick one fails: the optimum of continuous time, but for a part of N^-2."""
    solution = solved(axis("jerk", "l2", distance=1.0, time=1.0, intervals=12_000, solver="piqp"))
    assert solution.route.solver == "piqp" and solution.certificate["gap"] <= 1e-7
    assert solution.objective == pytest.approx(720**0.5, rel=1e-7)  # the quintic: ∫j² dt = 720 D²/T⁵


@pytest.mark.parametrize("minimize", ["velocity", "acceleration"])
def test_a_tie_is_broken_alike_by_all_solvers(minimize: str) -> None:
    """Peaks leave the move open: the smoothest of the best is one, and costs nothing."""
    found = [solved(axis(minimize, "linf", intervals=40, solver=solver)) for solver in ("piqp", "clarabel")]
    tops = [solution.trajectory.chain[-1] for solution in found]
    assert np.max(np.abs(tops[0] - tops[1])) <= 1e-3 * np.max(np.abs(tops[0]))
    assert all("l2 minimised" in solution.route.tie_break for solution in found)
    assert all(s.objective - s.certificate["lower_bound"] <= 1e-8 * s.objective for s in found)


@pytest.mark.parametrize(
    "problem, words",
    [
        (axis("power", "l2", load=LOAD, solver="clarabel"), "product"),
        (axis("energy", load=LOAD, solver="osqp"), "product"),
        (axis("force", "l2", load=FRICTION, solver="clarabel"), "friction"),
        (axis([term("time"), term("jerk", "l2")], time="free", limits={"jerk": 50.0}, solver="clarabel"), "duration"),
        (axis([term("jerk", "l2"), term("velocity", "linf")], solver="osqp"), "second-order cone"),
    ],
    ids=["power", "energy", "friction", "free-time", "cone"],
)
def test_a_wrong_manual_choice_is_refused_with_the_reason(problem: trajopt.Problem, words: str) -> None:
    for ask in (trajopt.route, trajopt.solve):
        with pytest.raises(trajopt.BadInput, match=words) as refusal:
            ask(problem)
        assert problem.transcription.solver in str(refusal.value)
        assert "\n" not in str(refusal.value)
        assert refusal.value.exit_code == 2


def test_the_route_follows_the_curvature() -> None:
    routes = {
        "linear": axis("jerk", "l1"),
        "quadratic": axis("jerk", "l2"),
        "cone": axis([term("jerk", "l2"), term("velocity", "linf")]),
        "product": axis("power", "linf", load=LOAD),
        "search": axis("time", time="free", limits=LIMITS, solver="clarabel"),
        "switching times": axis("time", time="free", limits=LIMITS),
    }
    for word, problem in routes.items():
        route = trajopt.route(problem)
        assert word in route.reason
        assert route.model == {"product": "pyomo", "switching times": "arcs"}.get(word, "cvxpy")


@pytest.mark.parametrize("scheme", ["exact", "euler"])
def test_a_power_limit_that_stays_inactive_costs_nothing(scheme: str) -> None:
    """Solved as a convex program without it, and the check confirms that it holds."""
    limited = axis("jerk", "linf", limits={"power": 1e3}, load=LOAD, scheme=scheme)
    free = axis("jerk", "linf", load=LOAD, scheme=scheme)
    assert solved(limited).route.model == "cvxpy"
    assert solved(limited).objective == pytest.approx(solved(free).objective, rel=1e-9)


def test_an_active_power_limit_goes_to_ipopt_and_costs_something() -> None:
    free = solved(axis("jerk", "l2", load=LOAD))
    most = 0.8 * free.metrics["peak_power"]
    limited = solved(axis("jerk", "l2", limits={"power": most}, load=LOAD))
    assert limited.route.solver == "ipopt"
    assert "power" in limited.route.reason
    assert limited.metrics["peak_power"] <= most * (1 + 1e-6)
    assert limited.objective > free.objective
    assert limited.certificate["lower_bound"] <= limited.objective


def test_nonconvex_programs_do_not_depend_on_how_they_are_asked_for() -> None:
    """Energy is the L1 norm of power, and m v_peak² for a move one way."""
    limits = {"velocity": (0.0, 1.7), "acceleration": 9.0, "jerk": 90.0}
    energy = solved(axis("energy", limits=limits, load={"inertia": 2.0}, intervals=30))
    power = solved(axis("power", "l1", limits=limits, load={"inertia": 2.0}, intervals=30))
    peak = solved(axis("velocity", "linf", limits=limits, intervals=30))
    assert energy.objective == pytest.approx(power.objective, rel=1e-9)
    assert energy.objective >= 2.0 * peak.objective**2 * (1 - 3e-8)
    assert energy.metrics["energy"] == pytest.approx(2.0 * energy.metrics["peak_velocity"] ** 2, rel=1e-6)
