"""A slice of the random campaign (`make soak`), the cases it found, and tests of its generator and judge."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests import campaign, soak
from tests.campaign import Spec, draw, judge

SLICE = range(1, 121)
CASES: list[dict[str, Any]] = tomllib.loads(Path(__file__).with_name("regressions.toml").read_text())["case"]


@pytest.mark.slow
def test_no_random_problem_is_answered_wrongly() -> None:
    records = [judge(draw(seed)) for seed in SLICE]
    summary = soak.summarise(records, sum(record.seconds for record in records))
    print(summary["verdicts"], summary["counts"])
    assert not summary["failures"]
    assert summary["undecided_share"] <= 1 / len(SLICE)  # the target is 0.1 % of 20,000
    assert summary["verdicts"]["SOLVED"] > len(SLICE) / 3
    assert sum(n for name, n in summary["verdicts"].items() if name.startswith("IMPOSSIBLE")) > len(SLICE) / 20


@pytest.mark.parametrize("case", CASES, ids=[case["why"][:40] for case in CASES])
def test_what_once_went_wrong_stays_right(case: dict[str, Any]) -> None:
    spec = Spec.from_dict(case["spec"])
    record = judge(spec)
    assert not record.failures
    wanted = case["verdict"]
    if wanted.startswith("not "):
        assert not record.status.startswith(wanted[4:])
    else:
        assert record.status == wanted, record.message
    assert record.seconds < case.get("seconds", 60.0)
    if "objective" in case:
        import trajopt

        found = trajopt.solve(spec.problem()).objective
        assert found == pytest.approx(case["objective"] * spec.objective_unit(), abs=1e-9)


def test_a_spec_is_made_from_its_seed_alone() -> None:
    assert draw(17) == draw(17) != draw(18)
    assert Spec.from_dict(draw(17).to_dict()) == draw(17)


def test_guises_undo_themselves() -> None:
    for seed in range(40):
        spec = draw(seed)
        assert spec.mirrored().mirrored().sections() == spec.sections()
        if isinstance(spec.duration, float) and not spec.tables and not spec.via:
            assert spec.backwards().backwards().state("start") == spec.state("start")


def test_ruckig_and_the_closed_forms_agree_with_the_published_least_times() -> None:
    limits = {"velocity": [-0.5, 0.5], "acceleration": [-4.905, 4.905], "jerk": [-98.1, 98.1]}
    for distance, least in ((0.254, 0.6599367992), (0.05, 0.2580257669), (0.005, 0.1177109844)):
        spec = Spec(end={"position": distance}, limits=limits)
        assert campaign.least_time(spec) == pytest.approx(least, abs=1e-10)
    no_jerk = Spec(
        end={"position": 0.254},
        limits={k: limits[k] for k in ("velocity", "acceleration")},
        terms=[["acceleration", "l2", 1]],
    )
    assert campaign.least_time(no_jerk) == pytest.approx(0.254 / 0.5 + 0.5 / 4.905, rel=1e-9)


def test_our_own_program_finds_the_edge_that_closed_forms_know() -> None:
    spec = Spec(limits={"acceleration": [-1.0, 1.0]}, terms=[["acceleration", "linf", 1.0]], intervals=20, duration=2.0)
    assert abs(campaign.Program(spec).margin()) < 1e-8
    assert campaign.Program(spec.changed(duration=2.01)).margin() > 1e-3
    assert campaign.Program(spec.changed(duration=1.99)).margin() < -1e-3
    assert campaign.Program(spec.changed(limits={}, duration=3.0)).least() == pytest.approx(4 / 9)


def test_the_reach_in_closed_form_is_that_of_a_fine_program() -> None:
    start, end = {"velocity": 0.4}, {"position": 0.3, "velocity": -0.2}
    spec = Spec(
        start=start,
        end=end,
        limits={"velocity": [-0.5, 0.8], "acceleration": [-1.0, 2.0]},
        terms=[["acceleration", "l2", 1]],
    )
    low, high = campaign.reach_second_order(spec, 1.5)  # type: ignore[misc]
    for target, margin in ((low, 0.0), (high, 0.0), ((low + high) / 2, 1.0)):
        own = campaign.Program(spec.changed(end=end | {"position": target}, duration=1.5, intervals=120))
        assert (own.margin() > 1e-3) == bool(margin)


def test_the_judge_catches_planted_lies(monkeypatch: pytest.MonkeyPatch) -> None:
    import dataclasses

    import trajopt
    from trajopt.verdict import Verdict

    spec = Spec(limits={"jerk": [-1000.0, 1000.0]}, duration=1.0)
    true = trajopt.solve(spec.problem())

    def judged(**lie: Any) -> str:
        monkeypatch.setattr(campaign.solving, "solve", lambda *_, **__: dataclasses.replace(true, **lie))
        record = judge(spec)
        monkeypatch.undo()
        return " ".join(failure.partition(":")[0] for failure in record.failures)

    nothing: dict[str, Any] = {
        "objective": None,
        "duration": None,
        "metrics": {},
        "certificate": {},
        "trajectory": None,
    }
    assert judged() == ""
    assert "false impossible" in judged(status=Verdict.IMPOSSIBLE, **nothing)
    assert "checker" in judged(objective=true.objective * (1 - 1e-5))  # type: ignore[operator]
    assert "gap" in judged(certificate={**true.certificate, "gap": 1e-5})
    top = [*true.trajectory.chain[:-1], np.roll(true.trajectory.chain[-1], 1)]  # type: ignore[union-attr]
    assert "checker" in judged(trajectory=dataclasses.replace(true.trajectory, chain=tuple(top)))  # type: ignore[type-var]
    assert math.isfinite(true.objective or math.nan)


def test_a_soak_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    path = tmp_path / "1_4.jsonl"
    first = soak.Journal(path)
    first.add(campaign.Record(1, "SOLVED", counts=["not strict"]))
    first.ran(2.0)
    with path.open("a") as file:
        file.write('{"seed": 2, "sta')  # killed while it wrote
    again = soak.Journal(path)
    again.add(campaign.Record(3, "UNDECIDED", failures=["gap: too wide"]))
    last = soak.Journal(path)
    assert [record.seed for record in last.records] == [1, 3]
    assert soak.summarise(last.records, last.seconds)["failures"][0]["seed"] == 3
    assert last.seconds == 2.0
    assert not soak.Journal(path, afresh=True).records


def test_an_impossible_move_may_go_unexplained() -> None:
    spec = Spec(limits={"velocity": [-0.5, 0.5], "jerk": [-30.0, 30.0]}, duration=1.5, intervals=12)
    records = [judge(spec, explained=explained) for explained in (True, False)]
    assert [record.status for record in records] == ["IMPOSSIBLE", "IMPOSSIBLE"]
    assert not any(record.failures for record in records)
    assert records[1].solves < records[0].solves
