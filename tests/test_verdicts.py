"""Verdicts at the edges: what must not be called impossible, solved or a bug, and what a failure leaves behind."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import trajopt
from tests.conftest import axis
from trajopt.attempt import Clock
from trajopt.explain import explain
from trajopt.transcribe import Setting
from trajopt.verdict import Verdict


@pytest.mark.parametrize(("minimize", "norm"), [("jerk", "l2"), ("jerk", "l1"), ("acceleration", "linf")])
def test_coasting_costs_nothing(minimize: str, norm: str) -> None:
    moving = {"velocity": 0.254}
    solution = trajopt.solve(axis(minimize, norm, distance=0.254, start=moving, end=moving, limits={"jerk": 98.0}))
    assert solution.status is Verdict.SOLVED and solution.objective == 0.0
    assert solution.metrics["peak_velocity"] == pytest.approx(0.254)


def test_standing_still_is_solved() -> None:
    solution = trajopt.solve(axis("jerk", "l2", distance=0.0))
    assert solution.status is Verdict.SOLVED and solution.objective == 0.0


def test_a_state_outside_its_limit_by_a_rounding_is_taken_as_on_it() -> None:
    limits = {"velocity": (0.0, 0.5), "acceleration": 4.905, "jerk": 98.1}
    inside, outside = (
        trajopt.solve(axis("jerk", "l2", distance=0.3, start={"velocity": v}, limits=limits))
        for v in (0.5, 0.5 * (1 + 1e-10))
    )
    assert outside.status is Verdict.SOLVED
    assert outside.objective == pytest.approx(inside.objective, rel=1e-8)


@pytest.mark.parametrize(
    ("intervals", "via"),
    [
        (17, ((0.0748, 1.6), (0.0946, 0.1), (0.5891, -1.2), (0.871, 0.7))),
        (17, ((0.0748, 1.6), (0.0946, -1.1), (0.5891, -1.2), (0.871, 0.7))),
        (5, ((0.05, -1.0), (0.067, 0.5), (0.69, 0.3), (0.83, 1.2), (0.86, -0.4))),
    ],
)
def test_via_states_close_to_each_other_are_no_proof_of_impossibility(intervals: int, via: Sequence[Any]) -> None:
    """Without limits: snaps of 1e5 times what the stroke needs by itself."""
    states = tuple(trajopt.Via(time=time, position=position) for time, position in via)
    auto, piqp, clarabel = (
        trajopt.solve(axis("snap", "l2", intervals=intervals, via=states, solver=solver))
        for solver in ("auto", "piqp", "clarabel")
    )
    assert auto.status is clarabel.status is Verdict.SOLVED and piqp.status in (Verdict.SOLVED, Verdict.UNDECIDED)
    assert auto.objective == pytest.approx(clarabel.objective, rel=1e-7)


def test_the_last_solver_out_of_iterations_is_no_limit_of_the_user() -> None:
    """The jerk rings where hardly anything limits it: no solver comes near."""
    time, distance = 0.0020514241481960583, 3.074883650159047e-06
    via = (trajopt.Via(time=0.0007029870076552056, position=-2.216372912147409e-06),)
    end, limits = {"velocity": -0.0014370740376889752}, {"snap": 173622831010388.72}
    solution = trajopt.solve(
        axis("velocity", "l2", intervals=200, time=time, distance=distance, via=via, end=end, limits=limits)
    )
    assert solution.status in (Verdict.UNDECIDED, Verdict.SOLVED)


def test_too_few_intervals_for_the_states_are_named() -> None:
    """Without limits there is none to widen."""
    close = tuple(trajopt.Via(time=time, position=position) for time, position in ((0.2, 1.0), (0.4, -1.0), (0.6, 1.0)))
    solution = trajopt.solve(axis("jerk", "l2", intervals=5, via=close, end={"velocity": 3.0, "acceleration": 50.0}))
    assert solution.status is Verdict.IMPOSSIBLE_ON_GRID and solution.explanation["conflict"] == []
    assert "too few for the states; raise transcription.intervals" in " ".join(solution.explanation["text"])


def test_friction_at_rest_is_no_proof_of_impossibility() -> None:
    """Coasting with F = 0 against 5 N of friction stops after 0.1 m; the force limit of 2 N would not hold it moving,
    but nothing need hold it at rest."""
    limits = {"velocity": (0.0, 2.0), "force": (-10.0, 2.0)}
    load = {"inertia": 1.0, "coulomb": 5.0}
    problem = axis("acceleration", "l2", distance=0.1, start={"velocity": 1.0}, limits=limits, load=load)
    assert not trajopt.solve(problem).status.value.startswith("IMPOSSIBLE")


def test_an_explanation_cut_short_claims_nothing() -> None:
    limits = {"velocity": (0.0, 0.5), "acceleration": 4.905, "jerk": 98.1}
    for seconds in (0.05, 0.2, 0.4):
        text = " ".join(
            trajopt.solve(axis(distance=0.254, norm="l2", time=0.55, limits=limits), seconds=seconds).explanation.get(
                "text", ()
            )
        )
        if "no value of" in text:
            assert "velocity.max" not in text.partition("no value of")[2].partition(" alone")[0]


class Impatient(Clock):
    """A time limit that strikes at the n-th look at the clock."""

    def __init__(self, looks: int) -> None:
        super().__init__()
        self.looks = looks

    @property
    def over(self) -> bool:
        self.looks -= 1
        return self.looks < 0


@pytest.mark.parametrize("ends", [{}, {"velocity": 0.2}], ids=["at rest", "moving"])
def test_a_limit_that_strikes_at_any_moment_of_an_explanation_is_no_bug(ends: dict[str, float]) -> None:
    limits = {"velocity": (0.0, 0.5), "acceleration": 4.905, "jerk": 98.1}
    given = {"distance": 0.254, "time": 0.5, "limits": limits, "start": ends, "end": ends, "intervals": 8}
    setting = Setting.of(axis("jerk", "l2", **given))
    for looks in range(0, 30, 5):
        assert explain(setting, Impatient(looks))["text"]


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), float("inf")])
def test_a_time_limit_that_is_none_is_refused(seconds: float) -> None:
    with pytest.raises(trajopt.BadInput, match="seconds: must be > 0 and finite"):
        trajopt.solve(axis("jerk", "l2"), seconds=seconds)


def test_a_failure_leaves_no_numbers_of_an_earlier_answer(tmp_path: Path) -> None:
    trajopt.solve(axis("jerk", "l2", distance=0.1)).save(tmp_path)
    assert (tmp_path / "trajectory.csv").exists()
    failed = trajopt.solve(axis("jerk", "l2", distance=0.1, time=0.01, limits={"velocity": 1.0}))
    assert failed.status is Verdict.IMPOSSIBLE
    failed.save(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["result.json"]
    with pytest.raises(trajopt.NoSolution):
        _ = failed.frame


def test_a_limit_of_nothing_is_a_limit() -> None:
    solution = trajopt.solve(axis("jerk", "l1", intervals=5000, limits={"jerk": 98.0}), seconds=0.01)
    assert solution.status is Verdict.LIMIT
    assert solution.objective is None and not solution.metrics and solution.trajectory is None
