"""Axes that move together: the slowest sets the time, the others relax."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import trajopt
from tests.conftest import axis, solved

LIMITS = {"velocity": 0.5, "acceleration": 4.905, "jerk": 98.1}


def test_the_slowest_sets_the_time_and_the_other_relaxes() -> None:
    far, near = (axis("jerk", "l2", distance=d, limits=LIMITS, intervals=40) for d in (0.254, 0.05))
    alone = solved(axis("time", time="free", distance=0.254, limits=LIMITS, intervals=40))
    slow, relaxed = trajopt.synchronise([far, near])
    assert slow.duration == relaxed.duration == alone.duration
    assert relaxed.metrics["peak_jerk"] < 0.5 * 98.1
    assert relaxed.at(relaxed.duration)["position"] == pytest.approx(0.05)


def test_the_common_time_is_possible_for_all() -> None:
    """The running axis can do 0.9 s to 1.28344 s, and again from 3.11709 s; the other needs 2 s at least."""
    limits = {"velocity": 1.2, "acceleration": 1.0, "jerk": 5.0}
    ends = {"start": {"velocity": 1.0}, "end": {"velocity": 1.0}}
    running = axis("jerk", "l2", distance=1.0, limits=limits, intervals=60, **ends)
    slow = axis("jerk", "l2", distance=1.0, limits={"velocity": 0.6, "acceleration": 4.0, "jerk": 60.0}, intervals=60)
    found = trajopt.synchronise([running, slow])
    assert all(solution.status.solved for solution in found)
    assert found[0].duration == found[1].duration == pytest.approx(3.117, rel=2e-3)


def test_an_impossible_axis_keeps_its_verdict() -> None:
    possible = axis("jerk", "l2", distance=0.1, limits=LIMITS, intervals=20)
    blocked = axis("jerk", "l2", distance=2.0, limits=LIMITS | {"position": (-1.0, 2.0)}, intervals=20)
    with pytest.raises(ValueError, match="at least one"):
        trajopt.synchronise([])
    assert [s.status.solved for s in trajopt.synchronise([possible, blocked])] == [True, True]
    stuck = axis("jerk", "l2", distance=-0.1, limits=LIMITS | {"velocity": (0.0, 0.5)}, intervals=20)
    found = trajopt.synchronise([possible, stuck])
    assert found[0].status.solved and not found[1].status.solved


def test_an_axis_is_overridden_by_its_name_or_number() -> None:
    problem = trajopt.load("gantry_together", ["axes.x.limits.velocity=1 m/s", "axes.1.move.end.position=0.2 m"])
    first, second, _ = problem.axes
    assert first.limits.velocity.highest == 1.0 and second.move.end.position == 0.2
    with pytest.raises(trajopt.BadInput, match="axes has no z; one of x, y, turn"):
        trajopt.load("gantry_together", ["axes.z.limits.velocity=1 m/s"])


def test_the_command_prints_one_object_and_writes_a_folder_an_axis(tmp_path: Path) -> None:
    words = ["synchronise", "clemen_rupp_jerk_l2", "fly_past_via_state", "-o", str(tmp_path), "--json"]
    command = [sys.executable, "-c", f"from trajopt.cli import main; main({words!r})"]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 2 and "via states need a fixed move.time" in ran.stderr
    words[2] = "clemen_rupp_energy"
    command[-1] = f"from trajopt.cli import main; main({words!r})"
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    data = json.loads(ran.stdout)
    assert data["status"] == "SOLVED" and [axis["duration"] for axis in data["axes"]] == [data["duration"]] * 2
    assert sorted(p.name for p in tmp_path.iterdir()) == ["axis1_clemen_rupp_jerk_l2", "axis2_clemen_rupp_energy"]
