"""The command line as a user meets it: one JSON object, exit codes, files, interrupts and limits."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

TABLE_I = """
title = "Clemen & Rupp 2023, Table I"
[move]
time  = "1 s"
start = { position = "0 m" }
end   = { position = "0.254 m" }
[limits]
velocity     = ["0 m/s", "0.5 m/s"]
acceleration = "4.905 m/s^2"
jerk         = "98.1 m/s^3"
power        = "100 W"
[load]
mass = "10 kg"
[objective]
minimize = "jerk"
norm     = "l2"
[transcription]
intervals = 40
"""
KEYS = {"status", "objective", "duration", "metrics", "certificate", "audit", "route", "timings"}


def run(*words: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from trajopt.cli import main; main()", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture
def move(tmp_path: Path) -> Path:
    path = tmp_path / "move.toml"
    path.write_text(TABLE_I)
    return path


def test_solve_prints_one_json_object(move: Path) -> None:
    done = run("solve", move, "--json")
    result = json.loads(done.stdout)
    assert done.returncode == 0 and result.keys() >= KEYS
    assert result["status"] == "SOLVED" and result["route"].keys() >= {"model", "solver", "reason"}


def test_solve_for_people_names_units_solver_and_reason(move: Path) -> None:
    done = run("solve", move, "--timings", "--set", "objective.norm=l1")
    assert done.returncode == 0
    spent = {line.split()[0] for line in done.stdout.splitlines() if line.endswith(" %")}
    assert spent >= {"model", "solve", "bound", "check", "total"}
    for word in ("SOLVED", "m/s^2", "piqp", "convex", "checked independently", "+1 % time", "lower bound"):
        assert word in done.stdout


def test_set_overrides_any_key(move: Path) -> None:
    result = json.loads(run("solve", move, "--set", "move.end.position=0.2 m", "--json").stdout)
    assert result["problem"]["move"]["end"]["position"] == 0.2


def test_output_files_agree_and_pass_the_check(move: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert run("solve", move, "-o", folder).returncode == 0
    table = pd.read_csv(folder / "trajectory.csv", comment="#")
    result = json.loads((folder / "result.json").read_text())
    assert list(table.columns[:3]) == ["t [s]", "q [m]", "v [m/s]"]
    assert table["q [m]"].tolist() == result["trajectory"]["position"]
    assert (folder / "trajectory.png").read_bytes().startswith(b"\x89PNG")
    assert run("check", folder / "result.json").returncode == 0
    assert run("check", folder / "result.json", "--strict").returncode == 0
    assert run("check", folder / "result.json", "--problem", move).returncode == 0


def test_check_refuses_an_edited_result(move: Path, tmp_path: Path) -> None:
    assert run("solve", move, "-o", tmp_path).returncode == 0
    result = json.loads((tmp_path / "result.json").read_text())
    result["trajectory"]["velocity"][20] *= 1 + 1e-5
    (tmp_path / "result.json").write_text(json.dumps(result))
    done = run("check", tmp_path / "result.json")
    assert done.returncode == 3 and "velocity" in done.stdout


def test_check_says_when_the_result_belongs_to_another_problem(move: Path, tmp_path: Path) -> None:
    assert run("solve", move, "--set", "move.end.position=0.2 m", "-o", tmp_path).returncode == 0
    done = run("check", tmp_path / "result.json", "--problem", move)
    assert done.returncode == 3 and "problem" in done.stdout


def test_impossible_is_explained_and_exits_3(move: Path) -> None:
    done = run("solve", move, "--set", "move.time=0.5 s")
    assert done.returncode == 3 and "the least time is" in done.stdout
    result = json.loads(run("solve", move, "--set", "move.time=0.5 s", "--json").stdout)
    assert result["status"] == "IMPOSSIBLE" and result["objective"] is None and result["trajectory"] is None


def test_route_without_solving(move: Path) -> None:
    done = run("route", move, "--set", "objective.minimize=power")
    assert done.returncode == 0 and "piqp" in done.stdout and "relaxation" in done.stdout
    done = run("route", move, "--set", "objective.minimize=power", "--set", "transcription.scheme=euler")
    assert done.returncode == 0 and "ipopt" in done.stdout and "nonconvex" in done.stdout


def test_wrong_manual_choice_is_refused_with_the_reason(move: Path) -> None:
    done = run("solve", move, "--set", "objective.minimize=power", "--set", "transcription.solver=osqp", "--json")
    assert done.returncode == 2 and json.loads(done.stdout)["status"] == "BAD_INPUT"
    assert "nonconvex" in done.stderr and "Traceback" not in done.stderr


def test_problems_lists_and_solve_takes_their_names() -> None:
    listed = run("problems").stdout.splitlines()
    assert len(listed) >= 15
    name = next(line.split()[0] for line in listed if "jerk_l2" in line)
    assert run("solve", name, "--set", "transcription.intervals=20").returncode == 0


def test_bad_input_is_one_line_and_exit_2(move: Path) -> None:
    done = run("solve", move, "--set", "limits.velocity=5 kg")
    assert done.returncode == 2 and done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1 and "limits.velocity" in done.stderr


def test_unwritable_output_exits_4(move: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = run("solve", move, "-o", tmp_path / "file" / "out")
    assert done.returncode == 4 and len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize("words", [("--bogus",), ("--seconds", "inf"), ("--seconds", "nan"), ("--seconds", "0")])
def test_wrong_usage_is_one_line_and_exit_2(move: Path, words: tuple[str, ...]) -> None:
    done = run("solve", move, *words)
    assert done.returncode == 2 and len(done.stderr.strip().splitlines()) == 1


def test_checking_what_is_no_result_is_one_line_and_exit_2(tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text('{"format": "trajopt re')
    for name in ("result.json", "missing.json"):
        done = run("check", tmp_path / name)
        assert done.returncode == 2 and len(done.stderr.strip().splitlines()) == 1


LONG = ("--set", "objective.minimize=power", "--set", "transcription.intervals=50000")


@pytest.mark.parametrize("solver", ["auto", "ipopt"])
def test_time_limit_releases_no_numbers(move: Path, solver: str) -> None:
    done = run("solve", move, *LONG, "--set", f"transcription.solver={solver}", "--seconds", "3", "--json")
    result = json.loads(done.stdout)
    assert done.returncode == 3 and result["status"] == "LIMIT"
    assert result["objective"] is None and result["trajectory"] is None and result["metrics"] is None


def test_interrupt_exits_130(move: Path) -> None:
    command = [sys.executable, "-c", "from trajopt.cli import main; main()", "solve", str(move), *LONG]
    child = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a background shell hands down "ignored"
    )
    time.sleep(4)
    child.send_signal(signal.SIGINT)
    _, error = child.communicate(timeout=30)
    said = [line for line in error.splitlines() if not line.startswith("warning: ")]
    assert child.returncode == 130 and said == ["trajopt: stopped by the user"]


def test_a_waiting_child_ends_with_its_parent() -> None:
    script = "import os; from trajopt.worker import Apart; Apart(); print('waits', flush=True); os.kill(os.getpid(), 9)"
    done = subprocess.run([sys.executable, "-c", script], stdout=subprocess.PIPE, timeout=60)
    assert done.returncode == -signal.SIGKILL and done.stdout == b"waits\n"  # the end of what both might write
