"""Studies from the file to the table: the same bytes however they came about, and the command line around them."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import trajopt
from tests.study_faults import HEAD, STILL, files, kills, stills
from trajopt import checker, worker
from trajopt.study import answer, export, picture, plan, rows
from trajopt.study.run import Options, Report, run
from trajopt.study.store import Kept, Store

SMALL: dict[str, Any] = {
    "title": "Small",
    "problem": {
        "move": {"time": "1 s", "end": {"position": "0.1 m"}},
        "limits": {"acceleration": "4 m/s^2"},
        "load": {"mass": "2 kg"},
        "objective": {"minimize": "jerk", "norm": "l2"},
        "transcription": {"intervals": 8},
    },
    "grid": {"move.time": ["1 s", "800 ms", "0.1 s"], "objective.norm": ["l1", "l2", "linf"]},
    "plot": {"x": "move.time", "y": "peak_force", "series": "objective.norm"},
}


def command(*words: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-c", "from trajopt.cli import main; main()", "study", *map(str, words)]
    return subprocess.run(line, capture_output=True, text=True, timeout=120, check=False, **options)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> tuple[Report, Path]:
    folder = tmp_path_factory.mktemp("small")
    return run(plan.from_dict(SMALL), folder, Options(workers=1, trajectories=True)), folder


def test_one_tidy_row_a_case_with_units_in_the_headings(small: tuple[Report, Path]) -> None:
    report, folder = small
    table = pd.read_csv(folder / "study.csv")
    assert table["move.time [s]"].tolist() == [1.0] * 3 + [0.8] * 3 + [0.1] * 3
    assert table["status"].tolist() == ["SOLVED"] * 6 + ["IMPOSSIBLE"] * 3
    assert table["minimised"].dropna().tolist() == ["jerk l1", "jerk l2", "jerk linf"] * 2
    alone = trajopt.solve(trajopt.from_dict(report.plan.content(report.plan.cases[1])))
    assert table.loc[1, "objective"] == pytest.approx(alone.objective, rel=1e-12)
    assert table.loc[1, "peak_force [N]"] == pytest.approx(alone.metrics["peak_force"], rel=1e-9)
    assert (table["gap"].dropna() <= 1e-6).all() and table["duration [s]"].tolist()[:4] == [1.0, 1.0, 1.0, 0.8]
    unsolved = table[table["status"] == "IMPOSSIBLE"]
    assert unsolved[["objective", "duration [s]", "energy [J]"]].isna().all(axis=None)
    assert unsolved["message"].str.contains("in 0.1 s this move is impossible").all()


def test_parquet_and_csv_say_the_same(small: tuple[Report, Path]) -> None:
    table, parquet = pd.read_csv(small[1] / "study.csv"), pd.read_parquet(small[1] / "study.parquet")
    assert list(table.columns) == list(parquet.columns)
    for heading in table:
        pd.testing.assert_series_equal(table[heading], parquet[heading], check_dtype=False, check_exact=True)


def test_the_moves_pass_the_check(small: tuple[Report, Path]) -> None:
    moves = sorted((small[1] / "trajectories").glob("*.json"))
    assert [path.name for path in moves] == [f"case{i}.json" for i in range(1, 7)]
    assert all(checker.check_file(path).passed for path in moves)
    assert pd.read_csv(moves[0].with_suffix(".csv"), comment="#").shape[0] == 9


def test_the_same_bytes_with_two_and_four_workers_resumed_or_not(small: tuple[Report, Path], tmp_path: Path) -> None:
    """The recorded times inside the moves' result files alone differ."""
    stated, expected = plan.from_dict(SMALL), _without_timings(small[1])
    for workers in (2, 4):
        folder = tmp_path / str(workers)
        run(plan.Plan(stated.title, stated.bases, stated.cases[3:5], None), folder, Options(trajectories=True))
        report = run(stated, folder, Options(workers=workers, trajectories=True))
        assert report.reused == 2 and _without_timings(folder) == expected


def _without_timings(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = files(folder)
    for name, content in found.items():
        if name.endswith(".json"):
            found[name] = {key: value for key, value in json.loads(content).items() if key not in ("timings", "seal")}
    return found


def test_texts_that_a_spreadsheet_would_run_are_quoted_and_numbers_are_not() -> None:
    texts = ["=HYPERLINK(1)", "+1", "-1+2", "@SUM(A1)", "\tx", "\rx", "\0x", "plain", "a=b"]
    table = pd.DataFrame({"=run": texts, "number": [-1.5] * 9})
    read = pd.read_csv(io.BytesIO(export.as_csv(table).replace(b"\0", b"0")))
    assert list(read.columns) == ["'=run", "number"] and (read["number"] == -1.5).all()
    assert [text[0] for text in read["'=run"]] == ["'"] * 7 + ["p", "a"]


def test_a_hostile_name_is_a_cell_and_no_path(tmp_path: Path) -> None:
    names = ["=cmd|' /C calc'!A0", "../../outside", "/etc/passwd"]
    cases = [{"name": name, "limits.velocity": f"{i} m/s"} for i, name in enumerate(names, 1)]
    stated = plan.from_dict({"problem": STILL, "case": cases})
    run(stated, tmp_path / "out", Options(workers=1, trajectories=True))
    table = pd.read_csv(tmp_path / "out" / "study.csv")
    assert table["name"].tolist() == ["'" + names[0], *names[1:]]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]
    moves = {path.name for path in (tmp_path / "out" / "trajectories").iterdir()}
    assert moves == {f"case{i}.{ending}" for i in (1, 2, 3) for ending in ("json", "csv")}


@pytest.mark.parametrize(
    ("values", "heading", "column"),
    [
        (["1 s", "900 ms"], "move.time [s]", [1.0, 0.9]),
        (["250 mm", "300 mm"], "move.time [mm]", [250.0, 300.0]),
        (["free", "1 s"], "move.time", ["free", "1 s"]),
        (["1 s", "1 m"], "move.time", ["1 s", "1 m"]),
        ([8, 9], "move.time", [8, 9]),
        ([0.5, 1], "move.time", [0.5, 1.0]),
        ([["0 s", "1 s"], "1 s"], "move.time", ['["0 s", "1 s"]', "1 s"]),
        ([True, False], "move.time", ["true", "false"]),
    ],
)
def test_overrides_become_numbers_where_they_can(values: list[Any], heading: str, column: list[Any]) -> None:
    cases = tuple(plan.Case(i, 0, (("move.time", value),), "") for i, value in enumerate(values, 1))
    assert rows.overrides(plan.Plan("", (("", {}),), cases)) == [(heading, column)]


def test_rotary_and_linear_cases_have_their_own_units() -> None:
    cases = tuple(plan.Case(i, 0, (), "") for i in (1, 2))
    metrics = [{"peak_force": i, "distance": i} for i in (1, 2)]
    both = [{"status": "SOLVED", "message": "", "metrics": m, "rotary": m["distance"] == 2} for m in metrics]
    found = [Kept("", given, 1.0, 1) for given in both]
    table = rows.table(plan.Plan("", (("", {}),), cases), found)
    expected = {"peak_force [N]": [1, np.nan], "peak_force [N m]": [np.nan, 2], "distance [rad]": [np.nan, 2]}
    for heading, values in expected.items():
        np.testing.assert_array_equal(table[heading], values)


def test_a_mistake_of_ours_is_one_crashed_case_that_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(*_: Any) -> None:
        raise RuntimeError("a mistake")

    monkeypatch.setattr(worker, "solve_here", wrong)
    found = json.loads(answer.solve(answer.question(STILL, 1.0, False)))
    assert found["status"] == "CRASHED" and "a bug in trajopt: RuntimeError('a mistake')" in found["message"]


def test_a_missing_solver_stops_the_study_and_an_answer_to_another_problem_is_a_bug(tmp_path: Path) -> None:
    expected = {"missing": trajopt.MissingSolver, "mistaken": trajopt.InternalError, "older": trajopt.BadInput}
    for function, error in expected.items():
        with pytest.raises(error):
            run(stills(2), tmp_path, Options(workers=1, function=f"tests.test_study:{function}"))
    with Store(tmp_path) as store:
        assert not list(store.answers())


def missing(asked: str) -> str:
    return json.dumps({"status": "UNDECIDED", "message": "no Ipopt", "stop": True})


def mistaken(asked: str) -> str:
    return json.dumps({"status": "SOLVED", "message": "", "problem": "another", "trajopt": trajopt.__version__})


def older(asked: str) -> str:
    return json.dumps({"status": "SOLVED", "message": "", "problem": "another", "trajopt": "0.0.9"})


@pytest.fixture
def study(tmp_path: Path) -> Path:
    path = tmp_path / "study.toml"
    path.write_text(HEAD + '["1 m/s", "2 m/s", "3 m/s"]\n')
    return path


def test_the_command_solves_resumes_and_summarises(study: Path, tmp_path: Path) -> None:
    done = command(study, "-o", tmp_path / "out", "--workers", "1")
    assert done.returncode == 0, done.stderr
    assert "3  SOLVED" in done.stdout and "wrote" in done.stdout and "study: 3 of 3" in done.stderr
    again = command(study, "-o", tmp_path / "out", "--json")
    found = json.loads(again.stdout)
    assert again.returncode == 0 and (found["status"], found["cases"], found["reused"]) == ("SOLVED", 3, 3)


def test_a_case_without_solution_exits_3_and_is_named_with_its_reason(study: Path, tmp_path: Path) -> None:
    text = study.read_text().replace('"0 m"', '"0.4 m"').replace('"2 m/s"', '"0.1 m/s"')
    study.write_text(text.replace('"3 m/s"', '"-3 m/s"'))
    refused = command(study, "-o", tmp_path / "out")
    assert refused.returncode == 2 and "limits.velocity: must be > 0" in refused.stderr
    assert not (tmp_path / "out").exists()
    done = command(study, "-o", tmp_path / "out", "--keep-going", "--workers", "1")
    assert done.returncode == 3
    words = ("IMPOSSIBLE in case 2:", "in 1 s this move is impossible", "BAD_INPUT in case 3:", "must be > 0")
    assert [word for word in words if word not in done.stdout] == []


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("--workers", "-1"), 2, "--workers must be 0"),
        (("--seconds", "0"), 2, "--seconds must be 0.1"),
        (("--memory", "0.1"), 2, "--memory must be 0.5"),
        (("--scheduler", "tcp://192.0.2.1:8786"), 2, "use tls://"),
    ],
)
def test_bad_options_are_refused(study: Path, tmp_path: Path, words: tuple[str, ...], code: int, message: str) -> None:
    done = command(study, "-o", tmp_path / "out", *words)
    assert done.returncode == code and message in done.stderr and done.stderr.count("\n") <= 2


def test_a_thousand_thousand_cases_by_accident_are_not_begun(study: Path, tmp_path: Path) -> None:
    many = ", ".join(f'"{i + 1} s"' for i in range(4000))
    study.write_text(study.read_text() + f'"move.time" = [{many}]\n')
    done = command(study, "-o", tmp_path / "out", stdin=subprocess.DEVNULL)
    assert done.returncode == 2 and "12,000 cases" in done.stderr and "--yes" in done.stderr


def test_a_study_in_use_is_refused_at_once(study: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with Store(tmp_path / "out"):
        done = command(study, "-o", tmp_path / "out")
    assert done.returncode == 4 and f"locked by process {os.getpid()} on " in done.stderr
    assert done.stderr.count("\n") == 1


SLOW = """
from tests import study_faults
from trajopt.study import pool, run
pool.PRELOAD.clear()
defaults = run.Options.__init__.__defaults__
run.Options.__init__.__defaults__ = (*defaults[:-1], "tests.study_faults:slow")
from trajopt.cli import main
main()
"""


@pytest.mark.parametrize("times", [1, 2])
def test_ctrl_c_keeps_what_is_finished(times: int, study: Path, tmp_path: Path) -> None:
    """A second Ctrl-C ends it at once, and harms the store no more than the first."""
    many = ", ".join(f'"{i + 1} m/s"' for i in range(50))
    study.write_text(HEAD + f"[{many}]\n")
    line = [sys.executable, "-c", SLOW, "study", str(study), "-o", str(tmp_path / "out"), "--workers", "2"]
    running = subprocess.Popen(line, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, process_group=0)
    _wait_for_rows(tmp_path / "out", 4)
    since = time.monotonic()
    for _ in range(times):
        os.killpg(running.pid, signal.SIGINT)
    _, errors = running.communicate(timeout=20)
    assert running.returncode == 130 and time.monotonic() - since < 10
    assert "the same command resumes" in errors and "Traceback" not in errors
    with Store(tmp_path / "out") as store:
        assert 4 <= len(list(store.answers())) < 50


def _wait_for_rows(folder: Path, count: int) -> None:
    import sqlite3

    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        try:
            with sqlite3.connect(f"file:{folder / 'study.sqlite'}?mode=ro", uri=True) as reader:
                if reader.execute("SELECT count(*) FROM answers").fetchone()[0] >= count:
                    return
        except sqlite3.OperationalError:
            pass
        time.sleep(0.02)
    raise AssertionError("the study does not get on")


def test_a_parent_killed_at_random_loses_nothing_that_it_announced(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text(HEAD + f"[{', '.join(repr(f'{i + 1} m/s') for i in range(300))}]\n")
    calm, found = (kills(study, tmp_path / str(count), count, seed=1) for count in (0, 6))
    assert found["lost"] == 0 and found["announced"] > 0 and found["files"] == calm["files"]


def test_the_picture_shows_curves_and_where_there_is_no_move(small: tuple[Report, Path]) -> None:
    stated, table = small[0].plan, pd.read_csv(small[1] / "study.csv")
    assert stated.plot is not None
    drawn = picture.figure(stated.plot, table, "Small")
    (axes,) = drawn.axes
    labels = [str(line.get_label()) for line in axes.lines]
    assert labels == ["norm l1", "norm l2", "norm linf", "no move"]
    assert axes.get_ylabel() == "peak force [N]" and axes.get_xlabel() == "move.time [s]"
    np.testing.assert_allclose(np.asarray(axes.lines[3].get_xdata(), float), [0.1])
    assert (small[1] / "study.png").read_bytes().startswith(b"\x89PNG")


def test_a_picture_of_nothing_says_so() -> None:
    table = pd.DataFrame({"move.time [s]": [1.0, 2.0], "status": ["LIMIT"] * 2})
    drawn = picture.figure(plan.Plot(x="move.time", y="energy"), table, "")
    assert [text.get_text() for text in drawn.axes[0].texts] == ["no case has energy"]
