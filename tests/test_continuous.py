"""What solutions say of the optimum in continuous time, and the arcs of a motor's move, through the whole chain."""

from __future__ import annotations

from typing import Any

import pytest

import trajopt
from tests.conftest import axis, solved, table_i
from trajopt import continuous
from trajopt.transcribe import Setting

SERVO = {  # reference energies, J; peak speed, rad/s; arcs and switch times, s
    "servomotor_case_1": (
        0.2187656327, 20.7507933, "PA-PU-Z-NU-NA", (0.05305068, 0.10894992, 0.36615178, 0.39199477), 0.175,
    ),
    "servomotor_case_3": (
        6.3348573325, 150.0, "PA-PU-PV-PU-Z-NA",
        (0.01602446, 0.08760647, 0.10858089, 0.11177943, 0.46305523), 0.151,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SERVO)
def test_the_servomotor_cases_of_the_paper(name: str) -> None:
    energy, peak, sequence, switches, saving = SERVO[name]
    solution = solved(trajopt.load(name))
    assert solution.certificate["continuous_optimum"] == pytest.approx(energy, rel=1e-8)
    assert 0 <= solution.certificate["above_continuous"] < 5e-4
    structure = solution.structure
    assert structure["sequence"] == sequence
    assert [arc["to"] for arc in structure["arcs"][:-1]] == pytest.approx(switches, abs=1e-6)
    assert structure["peak_velocity"] == pytest.approx(peak, rel=1e-6)
    conditions = structure["conditions"]
    assert conditions["hamiltonian_spread"] < 1e-7 and conditions["costate_jump"] < 1e-6
    assert conditions["subtrajectory_order"] and conditions["s11_order"] and conditions["s12_order"]
    rows = {row["profile"]: row for row in solution.comparison()}
    ideal = 1 - energy / rows["best trapezoid"]["objective"]
    assert ideal == pytest.approx(saving, abs=1e-3)


TABLE_I = [("energy", None, 0.810949200133), ("power", "linf", 1.681495190894), ("power", "l2", 1.8564080358**0.5)]


@pytest.mark.parametrize(("minimize", "norm", "optimum"), TABLE_I)
def test_the_axis_of_table_i(minimize: str, norm: str | None, optimum: float) -> None:
    certificate = solved(table_i(minimize, norm, intervals=80)).certificate
    assert certificate["continuous_optimum"] == pytest.approx(optimum, rel=1e-9)
    assert 0 < certificate["above_continuous"] < 0.06
    finer = solved(table_i(minimize, norm, intervals=240)).certificate
    assert 0 < finer["above_continuous"] < certificate["above_continuous"] / 2


@pytest.mark.parametrize(("minimize", "norm", "optimum"), TABLE_I)
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_move_of_an_optimum_has_its_value_and_goes_there(
    minimize: str, norm: str | None, optimum: float, way: float
) -> None:
    limits = {"velocity": (0.0, 0.5) if way > 0 else (-0.5, 0.0), "acceleration": 4.905, "jerk": 98.1}
    problem = axis(minimize, norm, distance=way * 0.254, limits=limits, load={"inertia": 10.0}, intervals=2000)
    known = continuous.mass_optimum(problem)
    assert known is not None and known.value == pytest.approx(optimum, rel=1e-9)
    move = known.on(Setting.of(problem))
    assert move.chain[0][-1] == pytest.approx(way * 0.254, rel=2e-4)
    assert move.measure(problem.objective) == pytest.approx(optimum, rel=1e-3)


def test_backwards_is_forwards() -> None:
    limits = {"acceleration": 4.905, "jerk": 98.1}
    given: dict[str, Any] = {"load": {"inertia": 10.0}, "intervals": 40}
    there = solved(axis("energy", distance=0.254, limits=limits | {"velocity": (0.0, 0.5)}, **given))
    back = solved(axis("energy", distance=-0.254, limits=limits | {"velocity": (-0.5, 0.0)}, **given))
    optimum = there.certificate["continuous_optimum"]
    assert back.certificate["continuous_optimum"] == pytest.approx(optimum, rel=1e-12)


@pytest.mark.parametrize(
    "problem",
    [
        table_i("power", "linf", start={"velocity": 0.1}, intervals=30),
        table_i("power", "linf", load={"inertia": 10.0, "viscous": 1.0}, intervals=30),
        table_i("force", "l2", intervals=30),
    ],
    ids=["moving", "friction", "force"],
)
def test_nothing_is_said_where_nothing_is_known(problem: trajopt.Problem) -> None:
    assert "continuous_optimum" not in solved(problem).certificate


def test_an_answer_below_the_optimum_is_our_bug() -> None:
    solution = solved(table_i("energy", intervals=40))
    assert solution.trajectory is not None
    lie = {**solution.metrics, "energy": 0.81}
    with pytest.raises(trajopt.InternalError, match="below the optimum in continuous time"):
        continuous.findings(solution.problem, solution.trajectory, lie, continuous.mass_optimum(solution.problem))


def test_arcs_are_read_off_the_trajectory_where_the_optimum_is_not_known() -> None:
    problem = trajopt.load("servomotor_case_1")
    limits = problem.limits.model_copy(update={"jerk": trajopt.Limit(min=-2e5, max=2e5)})
    structure = solved(problem.replace(limits=limits)).structure
    assert structure["of"] == "the trajectory, to an interval"
    names = [arc["name"] for arc in structure["arcs"]]
    assert names[0].startswith("P") and "Z" in names and names[-1].startswith("N")
    assert structure["arcs"][0]["from"] == 0.0 and structure["arcs"][-1]["to"] == pytest.approx(0.4)
