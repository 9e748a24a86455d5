"""Study files: grids, lists, tables and many problems become cases; what cannot be meant is refused in one line."""

from __future__ import annotations

import itertools
import json
import time
from pathlib import Path
from typing import Any

import pytest

import trajopt
from problems import clemen_rupp
from tests.bad_studies import CASES, Bad, write
from tests.study_faults import STILL
from trajopt import problem_file
from trajopt.study import plan

GRID: dict[str, Any] = {"move.time": ["1 s", "1.2 s"], "objective.norm": ["l1", "l2", "linf"]}


def _hashes(cases: plan.Plan) -> list[str]:
    return [problem_file.from_dict(cases.content(case)).hash for case in cases.cases]


def test_a_grid_is_every_combination_the_last_key_fastest() -> None:
    made = plan.from_dict({"problem": STILL, "grid": GRID})
    assert [case.overrides for case in made.cases][:2] == [
        (("move.time", "1 s"), ("objective.norm", "l1")),
        (("move.time", "1 s"), ("objective.norm", "l2")),
    ]
    assert [case.number for case in made.cases] == [1, 2, 3, 4, 5, 6]
    assert len({case.key for case in made.cases}) == 6


def test_overrides_mean_what_set_means_on_the_command_line() -> None:
    grid = {"objective.norm": ["linf"], "move.time": ["1.5 s"]}
    made = plan.from_dict({"problem": "clemen_rupp_power_l1", "grid": grid})
    stated = trajopt.load("clemen_rupp_power_l1", ["objective.norm=linf", "move.time=1.5 s"])
    assert _hashes(made) == [stated.hash]


def test_keys_may_be_written_with_or_without_quotes() -> None:
    quoted = plan.from_dict({"problem": STILL, "grid": GRID})
    nested = {"move": {"time": GRID["move.time"]}, "objective": {"norm": GRID["objective.norm"]}}
    assert _hashes(plan.from_dict({"problem": STILL, "grid": nested})) == _hashes(quoted)


def test_a_quoted_key_sets_a_table_as_a_whole() -> None:
    limit = {"time": ["0 s", "1 s"], "value": ["1 m/s", "2 m/s"]}
    (case,) = plan.from_dict({"problem": STILL, "case": [{"limits.velocity": limit}]}).cases
    assert case.overrides == (("limits.velocity", limit),)


def test_a_table_is_a_list_in_a_file(tmp_path: Path) -> None:
    (tmp_path / "cases.csv").write_text(
        "name,move.time,limits.velocity,transcription.intervals\nslow,2 s,,9\n"
        '"quick, light",1 s,"[""0 m/s"", ""1 m/s""]",\n'
    )
    made = plan.from_dict({"problem": STILL, "table": "cases.csv"}, folder=tmp_path)
    listed = [
        {"name": "slow", "move.time": "2 s", "transcription.intervals": 9},
        {"name": "quick, light", "move.time": "1 s", "limits.velocity": ["0 m/s", "1 m/s"]},
    ]
    same = plan.from_dict({"problem": STILL, "case": listed})
    assert _hashes(made) == _hashes(same) and [case.name for case in made.cases] == ["slow", "quick, light"]
    assert [case.where for case in made.cases] == [f"{tmp_path / 'cases.csv'}, line {i}" for i in (2, 3)]


def test_problems_times_cases_times_grid(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text('move = { time = "1 s", end = { position = "0.3 m" } }\n[objective]\n'
                                       'minimize = "jerk"\nnorm = "l2"\n')
    (tmp_path / "study.toml").write_text(
        'problems = ["own.toml", "clemen_rupp_jerk_l2"]\n[[case]]\ntranscription.intervals = 8\n'
        '[[case]]\ntranscription.intervals = 10\n[grid]\nmove.time = ["1 s", "2 s"]\n'
    )
    made = plan.load(tmp_path / "study.toml")
    assert len(made.cases) == 8 and [name for name, _ in made.bases] == ["own", "clemen_rupp_jerk_l2"]
    assert len(set(_hashes(made))) == 8


@pytest.mark.parametrize("name", problem_file.ready_made("studies"))
def test_ready_made_studies_load(name: str) -> None:
    made = plan.load(name)
    assert made.title and len(made.cases) >= 30 and all(case.key for case in made.cases)


def test_the_study_of_the_tables_is_the_paper_s_cases_by_both_schemes() -> None:
    cases = itertools.product(clemen_rupp.PRINTED, clemen_rupp.SCHEMES)
    stated = [trajopt.load(f"clemen_rupp_{name}", [f"transcription.scheme={scheme}"]).hash for name, scheme in cases]
    assert sorted(_hashes(plan.load("clemen_rupp_tables"))) == sorted(stated)


def test_keep_going_keeps_what_cannot_be_meant_as_such(tmp_path: Path) -> None:
    rows = ("move.time,limits.velocity", "1 s,1 m/s", "1 s", "1 s,-1 m/s", "1000 ms,1 m/s", "2 s,1 m/s")
    (tmp_path / "cases.csv").write_text("\n".join(rows))
    stated = {"problem": STILL, "table": "cases.csv"}
    made = plan.from_dict(stated, folder=tmp_path, keep_going=True)
    assert [bool(case.fault) for case in made.cases] == [False, True, True, True, False]
    for case, words in zip(made.cases[1:4], ("line 3: has 1 cells", "line 4", "same problem as"), strict=True):
        assert words in case.fault
    with pytest.raises(trajopt.BadInput, match="line 3: has 1 cells.*line 4, line 5; mend them, or do without"):
        plan.from_dict(stated, folder=tmp_path)


def test_nothing_is_left_to_keep_going_with() -> None:
    with pytest.raises(trajopt.BadInput, match="limits.velcity: unknown key; did you mean 'velocity'"):
        plan.from_dict({"problem": STILL, "grid": {"limits.velcity": ["1 m/s", "2 m/s"]}}, keep_going=True)


def test_the_faults_of_a_large_table_are_found_up_to_twenty(tmp_path: Path) -> None:
    (tmp_path / "cases.csv").write_text("move.time\n" + "".join(f"{i + 1} s\n" for i in range(900)) + "nix\n" * 9000)
    since = time.monotonic()
    with pytest.raises(trajopt.BadInput) as refused:
        plan.from_dict({"problem": STILL, "table": "cases.csv"}, folder=tmp_path)
    assert "line 902" in str(refused.value) and "line 921" in str(refused.value)
    assert "line 922" not in str(refused.value) and time.monotonic() - since < 30


def test_a_grid_of_many_cases_is_asked_about_and_one_of_millions_refused() -> None:
    axis = [f"{i} m/s" for i in range(1, 102)]
    grid = {"limits.velocity": axis, "move.time": [f"{i} s" for i in range(1, 101)]}
    with pytest.raises(plan.TooMany, match="10,100 cases; more than 10,000 need --yes"):
        plan.from_dict({"problem": STILL, "grid": grid})
    grid["limits.jerk"] = [f"{i} m/s^3" for i in range(1, 101)]
    with pytest.raises(trajopt.BadInput, match="1,010,000 cases; at most 1,000,000"):
        plan.from_dict({"problem": STILL, "grid": grid}, many=True)


@pytest.mark.parametrize("bad", CASES, ids=lambda bad: bad.name)
def test_bad_studies_are_refused_in_one_line(bad: Bad, tmp_path: Path) -> None:
    with pytest.raises(trajopt.BadInput) as refused:
        plan.load(write(bad, tmp_path))
    message = str(refused.value)
    assert "\n" not in message and message.isprintable()
    assert [word for word in bad.words if word not in message] == [], message


def test_a_plan_is_frozen_and_its_content_a_copy() -> None:
    made = plan.from_dict({"problem": STILL, "grid": GRID})
    made.content(made.cases[0])["move"]["time"] = "7 s"
    assert json.dumps(made.content(made.cases[0]))[:40] == json.dumps(made.content(made.cases[1]))[:40]
    with pytest.raises(AttributeError):
        made.cases[0].number = 3  # type: ignore[misc]


def test_the_tables_that_a_problem_names_beside_its_file_come_with_its_cases(tmp_path: Path) -> None:
    """A worker, perhaps on another machine, sees the content of a case and no folder."""
    made = plan.from_dict({"problem": "slider_crank", "grid": {"move.time": ["73.5 ms", "80 ms"]}})
    assert _hashes(made)[0] == trajopt.load("slider_crank").hash
    (tmp_path / "other.csv").write_text("theta [deg],T [N m]\n" + "".join(f"{20 * i},0.5\n" for i in range(10)))
    varied = {"load.torque": [{"csv": "slider_crank.csv"}, {"csv": "other.csv"}]}
    with pytest.raises(trajopt.BadInput, match=r"load.torque: .*slider_crank.csv: cannot be read"):
        plan.from_dict({"problem": "slider_crank", "grid": varied}, folder=tmp_path)
    del varied["load.torque"][0]
    made = plan.from_dict({"problem": "slider_crank", "grid": varied}, folder=tmp_path)
    problem = problem_file.from_dict(made.content(made.cases[0]))
    assert isinstance(problem, trajopt.Problem) and problem.load.force is not None
    assert set(problem.load.force.value) == {0.5}
