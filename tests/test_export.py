"""Exports: every format read back by an independent reader, and what the target's interpolation makes of the points."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rosbags.typesys import Stores, get_typestore
from scipy.io import loadmat

import trajopt
from tests.conftest import axis, solved, table_i
from trajopt.cli import main
from trajopt.export import Refused
from trajopt.export.formats import names
from trajopt.export.points import Points
from trajopt.export.reconstruct import NEEDS, reconstruct
from trajopt.export.verify import Report

COUNT = "0.1 um"
S_CURVE = {"velocity": 0.5, "acceleration": 4.905, "jerk": 98.1}


@pytest.fixture(scope="module")
def strained() -> trajopt.Solution:
    """Table I, least velocity: acceleration and jerk run along their limits, on a mesh."""
    return solved(table_i("velocity", "l2", intervals=100))


@pytest.fixture(scope="module")
def fastest() -> trajopt.Solution:
    """The least time of a jerk-limited move: seven arcs."""
    return solved(axis("time", time="free", distance=0.254, limits=S_CURVE))


@pytest.fixture(scope="module")
def snappy() -> trajopt.Solution:
    """The least time of a snap-limited move, fourth order; the short arcs of its chattering left out."""
    limits = {"velocity": 1.0, "acceleration": 20.0, "jerk": 1000.0, "snap": 1e5}
    problem = axis("time", time="free", distance=0.3, limits=limits)
    return solved(problem.replace(transcription=problem.transcription.model_copy(update={"touches": 0})))


@pytest.fixture(scope="module")
def plain() -> trajopt.Solution:
    """Second order: the acceleration jumps at the nodes."""
    return solved(axis("acceleration", "l2", distance=0.254, limits={"velocity": 0.5}, intervals=20))


@pytest.fixture(scope="module")
def turning() -> trajopt.Solution:
    """A rotary axis."""
    return solved(axis("jerk", "l2", distance=np.pi / 2, intervals=20).replace(rotary=True))


def row(report: Report, name: str) -> Any:
    return next(row for row in report.rows if row.name == name)


def test_csv_has_units_hash_and_every_derivative(strained: trajopt.Solution, tmp_path: Path) -> None:
    report = strained.export(tmp_path / "move.csv", "csv", cycle="2 ms")
    first, header, *rows = (tmp_path / "move.csv").read_text().splitlines()
    assert first == f"# trajopt {strained.problem.hash}"
    assert header == "t [s],q [m],v [m/s],a [m/s^2],j [m/s^3]"
    table = np.array([[float(cell) for cell in line.split(",")] for line in rows])
    assert report.points == len(table) == 501 and report.verdict == "passed"
    expected = strained.at(table[:, 0])
    for k, name in enumerate(("position", "velocity", "acceleration", "jerk"), start=1):
        np.testing.assert_array_equal(table[:, k], expected[name])


def test_pvt_at_the_nodes_is_the_exact_scheme_to_rounding(
    strained: trajopt.Solution, fastest: trajopt.Solution, tmp_path: Path
) -> None:
    for solution, points in ((strained, None), (fastest, 8)):
        for to in ("zaber", "xps"):
            report = solution.export(tmp_path / "pvt.txt", to)
            assert report.verdict == "passed" and report.interpolation == "cubic"
            assert report.points == (points or report.points)
            assert report.tracking_error < 1e-12 and report.end_error < 1e-12
            assert all(r.excess < 1e-10 for r in report.rows if r.excess is not None)
            assert row(report, "jerk").peak == pytest.approx(np.copysign(98.1, row(report, "jerk").peak), rel=1e-9)


def test_zaber_rows_are_relative_in_millimetres(fastest: trajopt.Solution, tmp_path: Path) -> None:
    fastest.export(tmp_path / "z.csv", "pvt", name="X")
    with (tmp_path / "z.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["Time (s)", "X Position (mm)", "X Velocity (mm/s)", "Relative"]
    assert {r["Relative"] for r in rows} == {"1"} and float(rows[-1]["X Velocity (mm/s)"]) == 0.0
    assert sum(float(r["Time (s)"]) for r in rows) == pytest.approx(fastest.duration, abs=1e-15)
    assert sum(float(r["X Position (mm)"]) for r in rows) == pytest.approx(254.0, abs=1e-10)


def test_xps_lines_end_at_rest_in_degrees_on_a_rotary_axis(turning: trajopt.Solution, tmp_path: Path) -> None:
    turning.export(tmp_path / "t.trj", "xps")
    lines = [[float(cell) for cell in line.split(",")] for line in (tmp_path / "t.trj").read_text().splitlines()]
    assert all(len(line) == 3 for line in lines) and lines[-1][2] == 0.0
    assert sum(line[1] for line in lines) == pytest.approx(90.0, abs=1e-10)
    turning.export(tmp_path / "t.csv", "zaber")
    assert "Position (\u00b0)" in (tmp_path / "t.csv").read_text(encoding="utf-8")


def test_galil_counts_add_up_and_its_clock_is_found_too_coarse(fastest: trajopt.Solution, tmp_path: Path) -> None:
    path = tmp_path / "move.dmc"
    with pytest.raises(Refused, match="acceleration 4.9.* exceeds 4.905") as refused:
        fastest.export(path, "galil", resolution=COUNT)  # switching times lie between samples of 1/1024 s
    assert not path.exists() and not list(tmp_path.iterdir()) and not refused.value.report.written
    assert row(refused.value.report, "acceleration").unrounded > 1e-3
    report = fastest.export(path, "galil", resolution=COUNT, allow=True)
    lines = path.read_text().splitlines()
    assert lines[-2:] == ["PVA=0,0,0", "BTA"] and report.verdict == "refused"
    segments = np.array([[int(x) for x in line[4:].split(",")] for line in lines[:-2]])
    assert segments[:, 0].sum() == 2_540_000 and segments[-1, 1] == 0
    assert segments[:, 2].sum() == np.ceil(fastest.duration * 1024)


def test_cam_texts_of_four_dialects(strained: trajopt.Solution, tmp_path: Path) -> None:
    path = tmp_path / "cam.txt"
    for dialect, split in (("codesys", "\t"), ("sew", "\t"), ("lenze", " ")):
        assert strained.export(path, "cam", dialect=dialect, cycle=0.01).verdict == "passed"
        lines = path.read_text().splitlines()
        if dialect == "sew":
            assert lines.pop(0) == "101"
        cells = np.array([[float(x) for x in line.partition(" //")[0].split(split)] for line in lines])
        np.testing.assert_allclose(cells[:, 1], 1e3 * strained.at(cells[:, 0])["position"], rtol=1e-15)
    report = strained.export(path, "cam", dialect="technosoft", cycle="10 ms", resolution=COUNT)
    integers = np.array([[int(x) for x in line.split("\t")] for line in path.read_text().splitlines()])
    assert integers[:, 0].tolist() == list(range(101)) and integers[-1, 1] == 2_540_000
    assert report.verdict == "warned" and "rounding to counts" in report.messages[0]


def test_codesys_declares_as_many_points_as_it_lists(fastest: trajopt.Solution, tmp_path: Path) -> None:
    report = fastest.export(tmp_path / "cam.st", "cam-codesys", name="feeder")
    text = (tmp_path / "cam.st").read_text()
    assert report.verdict == "passed" and report.interpolation == "quintic"
    assert "feeder_A: ARRAY[0..7] OF SMC_CAMXYVA := [" in text and text.count("(dX := ") == 8
    assert "feeder: MC_CAM_REF := (nElements := 8, byType := 3, xStart := 0.0, xEnd := 0.65" in text
    for literal in re.findall(r"d[XYVA] := ([^,)]+)", text):  # IEC 61131-3: a digit on both sides of the point
        assert re.fullmatch(r"-?\d+\.\d+(E-?\d+)?", literal), literal


def test_twincat_counts_points_from_one_and_names_the_law(
    fastest: trajopt.Solution, plain: trajopt.Solution, tmp_path: Path
) -> None:
    for solution, law, kind in ((fastest, "POLYNOM5_MM", "quintic"), (plain, "POLYNOM3_VV", "cubic")):
        report = solution.export(tmp_path / "cam.st", "plcopen")
        text = (tmp_path / "cam.st").read_text()
        assert report.interpolation == kind and report.tracking_error < 1e-12
        indices = [int(x) for x in re.findall(r"PointIndex := (\d+)", text)]
        assert indices == list(range(1, report.points + 1)) and text.count(f"MOTIONFUNCTYPE_{law}") == report.points
        assert f"ARRAY[1..{report.points}] OF MC_MotionFunctionPoint" in text


def test_ros_message_survives_the_wire(fastest: trajopt.Solution, tmp_path: Path) -> None:
    report = fastest.export(tmp_path / "move.yaml", "ros", name="shoulder")
    data = yaml.safe_load((tmp_path / "move.yaml").read_text())
    types = get_typestore(Stores.ROS2_HUMBLE)
    kind = types.types
    message = kind["trajectory_msgs/msg/JointTrajectory"](
        kind["std_msgs/msg/Header"](kind["builtin_interfaces/msg/Time"](**data["header"]["stamp"]), ""),
        data["joint_names"],
        [
            kind["trajectory_msgs/msg/JointTrajectoryPoint"](
                **{field: np.array(point[field], dtype=float)
                   for field in ("positions", "velocities", "accelerations", "effort")},
                time_from_start=kind["builtin_interfaces/msg/Duration"](**point["time_from_start"]),
            )
            for point in data["points"]
        ],
    )  # fmt: skip
    name = "trajectory_msgs/msg/JointTrajectory"
    back: Any = types.deserialize_cdr(types.serialize_cdr(message, name), name)
    assert back.joint_names == ["shoulder"] and len(back.points) == report.points == 8
    since = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in back.points]
    assert since == sorted(since) and 0 <= since[-1] - fastest.duration <= 1e-9
    for t, point in zip(since[:-1], back.points, strict=False):
        expected = fastest.at(t)
        assert [x[0] for x in (point.positions, point.velocities)] == pytest.approx(
            [expected["position"], expected["velocity"]], abs=1e-12
        )
    assert report.verdict == "passed" and report.interpolation == "quintic"


def test_ros_leaves_out_accelerations_that_jump(plain: trajopt.Solution, tmp_path: Path) -> None:
    report = plain.export(tmp_path / "move.yaml", "ros")
    points = yaml.safe_load((tmp_path / "move.yaml").read_text())["points"]
    assert all(point["accelerations"] == [] for point in points) and report.interpolation == "cubic"
    assert report.tracking_error < 1e-9


def test_matlab_structure_with_time(strained: trajopt.Solution, tmp_path: Path) -> None:
    strained.export(tmp_path / "move.mat", "mat", cycle="1 ms", name="gantry")
    loaded = loadmat(tmp_path / "move.mat", simplify_cells=True)
    structure = loaded["gantry"]
    assert set(structure) == {"time", "signals"} and structure["signals"]["dimensions"] == 3
    assert structure["signals"]["values"].shape == (1001, 3) and structure["time"].shape == (1001,)
    np.testing.assert_array_equal(structure["signals"]["values"][:, 1], strained.at(structure["time"])["velocity"])
    assert list(loaded["gantry_units"]) == ["position [m]", "velocity [m/s]", "acceleration [m/s^2]"]
    assert loadmat(tmp_path / "move.mat")["gantry"]["time"][0, 0].shape == (1001, 1)  # a column, as Simulink wants


def test_setpoints_are_integers_up_to_the_cycle_after_the_end(fastest: trajopt.Solution, tmp_path: Path) -> None:
    report = fastest.export(tmp_path / "set.csv", "setpoints", cycle="1 ms", resolution="10000 counts/mm")
    header, *lines = (tmp_path / "set.csv").read_text().splitlines()
    assert header.startswith("cycle,0x607A target position [counts]")
    cells = np.array([[int(x) for x in line.split(",")] for line in lines])
    assert len(cells) == 661 and cells[-1].tolist() == [660, 2_540_000, 0]
    exact = fastest.at(np.minimum(cells[:, 0] * 1e-3, fastest.duration or 0.0))["position"]
    assert np.max(np.abs(cells[:, 1] * 1e-7 - exact)) <= 0.5e-7 * (1 + 1e-9)
    assert report.end_error < 1e-15


def test_differences_of_exact_setpoints_keep_every_limit(fastest: trajopt.Solution, tmp_path: Path) -> None:
    """Each is a mean of the derivative over its points; rounding breaks limits, by at most 2^(i-1) count/cycle^i."""
    report = fastest.export(tmp_path / "set.csv", "setpoints", cycle="1 ms", resolution=COUNT)
    assert report.verdict == "warned"
    for i, name in enumerate(("velocity", "acceleration", "jerk"), start=1):
        found, limit = row(report, name), S_CURVE[name]
        assert found.unrounded < 1e-7
        assert abs(found.peak) <= limit + 2 ** (i - 1) * 1e-7 / 1e-3**i * (1 + 1e-9)
    assert row(report, "jerk").excess > 2
    assert "all of it from rounding" in report.messages[-1]


def test_straight_lines_seen_at_the_drives_own_cycle_multiply_the_acceleration(
    fastest: trajopt.Solution, tmp_path: Path
) -> None:
    """A drive of 0.25 ms that draws lines through points of 2 ms has an eighth of the time for a change of speed."""
    options: dict[str, Any] = {"cycle": "2 ms", "resolution": "1 nm"}
    with pytest.raises(Refused) as refused:
        fastest.export(tmp_path / "set.csv", "setpoints", drive_cycle="0.25 ms", **options)
    assert row(refused.value.report, "acceleration").unrounded == pytest.approx(7.0, rel=1e-6)
    spline = fastest.export(tmp_path / "set.csv", "setpoints", interpolation="spline", allow=True, **options)
    assert row(spline, "acceleration").excess < 0.05


def test_nodes_are_too_far_apart_for_straight_lines(strained: trajopt.Solution, tmp_path: Path) -> None:
    for to in ("mat", "cam-text"):
        with pytest.raises(Refused, match="points at the drive's own cycle"):
            strained.export(tmp_path / "file", to)
        assert strained.export(tmp_path / "file", to, cycle="1 ms").verdict == "passed"


def test_rounding_to_counts_breaks_the_jerk_of_short_cubics(strained: trajopt.Solution, tmp_path: Path) -> None:
    """12 count/step³ at worst: 1 ms is too short, far apart it is nothing, and so it is with a finer encoder."""
    with pytest.raises(Refused, match="rounding to counts") as refused:
        strained.export(tmp_path / "z.csv", "zaber", cycle="1 ms", resolution=COUNT)
    assert 98.1 < abs(row(refused.value.report, "jerk").peak) <= 98.1 + 12e-7 / 1e-9
    finer = strained.export(tmp_path / "z.csv", "zaber", cycle="10 ms", resolution="1 nm")
    assert finer.verdict == "warned" and row(finer, "jerk").excess < 1e-3


def test_fourth_order_goes_through_quintics_but_not_through_cubics(snappy: trajopt.Solution, tmp_path: Path) -> None:
    for to in ("ros", "cam-codesys", "cam-twincat"):
        report = snappy.export(tmp_path / "file", to)
        assert report.interpolation == "quintic" and report.tracking_error < 1e-9
        assert row(report, "snap").excess < 1e-4 and report.points == len(snappy.structure["arcs"]) + 1
    with pytest.raises(Refused, match="acceleration"):
        snappy.export(tmp_path / "file", "xps")
    assert row(snappy.export(tmp_path / "file", "xps", cycle="1 ms", allow=True), "acceleration").excess < 0.002


def test_an_acceleration_of_two_values_is_found_in_an_xyva_table(plain: trajopt.Solution, tmp_path: Path) -> None:
    report = plain.export(tmp_path / "cam.st", "cam-codesys")  # no limit on acceleration here, nothing breaks
    assert report.tracking_error > 1e-7
    assert plain.export(tmp_path / "cam.st", "cam-twincat").tracking_error < 1e-14


def test_a_force_limit_is_judged_too(tmp_path: Path) -> None:
    load = {"inertia": 2.0, "coulomb": 1.0}
    limits = {"velocity": (0.0, 0.5), "force": 6.0}
    solution = solved(axis("velocity", "l2", distance=0.25, limits=limits, load=load, intervals=40))
    report = solution.export(tmp_path / "z.csv", "zaber")
    assert row(report, "force").excess < 1e-9 and abs(row(report, "force").peak) == pytest.approx(6.0)
    with pytest.raises(Refused, match="force"):
        solution.export(tmp_path / "z.mat", "mat")


def test_interpolations_on_a_cubic() -> None:
    time = np.array([0.0, 0.5, 2.0, 3.0])
    cubic = np.polynomial.Polynomial([0.0, 1.0, -2.0, 0.5])
    values = tuple(cubic.deriv(i)(time) if i else cubic(time) for i in range(3))
    points = Points(time, values)
    where = np.linspace(0, 3, 100)
    ends = (float(values[1][0]), float(values[1][-1]))
    for kind in ("cubic", "quintic", "spline"):
        made = reconstruct(points, kind, None, ends)
        np.testing.assert_allclose(made.position(where), cubic(where), atol=1e-12)
        assert np.max(made.derivatives[1].value) == pytest.approx(2.5, rel=1e-12)  # at the right end
        assert np.min(made.derivatives[1].value) == pytest.approx(1 - 8 / 3, rel=1e-12)  # inside, where a = 0
        assert np.max(made.derivatives[3].value) == pytest.approx(3.0, rel=1e-9)
    assert reconstruct(points, "linear", None, ends).position(np.array([1.25]))[0] == pytest.approx(
        (cubic(0.5) + cubic(2.0)) / 2
    )
    assert reconstruct(points, "hold", None, ends).position(np.array([1.99]))[0] == cubic(0.5)
    np.testing.assert_allclose(reconstruct(points, "linear", None, ends).derivatives[3].value, 3.0)


def test_resolution_by_counts_or_size(strained: trajopt.Solution, tmp_path: Path) -> None:
    for text, size in (("10000 counts/mm", 1e-7), ("0.1 um", 1e-7), ("1e6/m", 1e-6), ("500 counts per mm", 2e-6)):
        report = strained.export(tmp_path / "f", "csv", cycle=0.01, resolution=text)
        assert report.resolution == pytest.approx(size, rel=1e-12)


BAD: list[tuple[dict[str, Any], tuple[str, ...]]] = [
    ({"to": "zabber"}, ("to", "unknown format 'zabber'", "did you mean 'zaber'?")),
    ({"to": "pvt", "dialect": "newport"}, ("dialect", "newport", "zaber, xps, galil")),
    ({"to": "pvt", "dialect": "galill"}, ("did you mean 'galil'?",)),
    ({"to": "csv", "dialect": "zaber"}, ("dialect", "of csv")),
    ({"to": "zaber", "dialect": "xps"}, ("leave --dialect out",)),
    ({"to": "csv", "cycle": "0 ms"}, ("cycle", "> 0")),
    ({"to": "csv", "cycle": -1e-3}, ("cycle", "> 0", "1 ms")),
    ({"to": "csv", "cycle": float("nan")}, ("cycle", "> 0")),
    ({"to": "csv", "cycle": "1 mm"}, ("cycle", "time is needed")),
    ({"to": "csv", "cycle": "1"}, ("cycle", "no unit")),
    ({"to": "csv", "cycle": "1 ns"}, ("cycle", "more than 1000000 points")),
    ({"to": "csv", "cycle": "60 ms"}, ("cycle", "shortest arc, 0.05", "leave it out")),
    ({"to": "setpoints", "cycle": "60 ms", "resolution": COUNT}, ("shortest arc, 0.05",)),
    ({"to": "setpoints", "resolution": COUNT}, ("cycle", "missing", "1 ms")),
    ({"to": "setpoints", "cycle": "1 ms"}, ("resolution", "missing", "counts/mm")),
    ({"to": "galil"}, ("resolution", "missing")),
    ({"to": "csv", "resolution": "0 um"}, ("resolution", "> 0")),
    ({"to": "csv", "resolution": "0 counts/mm"}, ("resolution", "> 0")),
    ({"to": "csv", "resolution": "1 deg"}, ("resolution", "deg", "counts per unit")),
    ({"to": "csv", "resolution": "10 counts/deg"}, ("resolution", "deg")),
    ({"to": "csv", "resolution": "1 mm"}, ("resolution", "thousandth of the stroke", "0.000254")),
    ({"to": "setpoints", "cycle": "1 ms", "resolution": "1e-3 nm"}, ("resolution", "32 bits")),
    ({"to": "csv", "interpolation": "cubik"}, ("interpolation", "did you mean 'cubic'?")),
    ({"to": "cam", "interpolation": "cubic"}, ("interpolation", "velocities", "hold, linear, spline")),
    ({"to": "csv", "cycle": "1 ms", "drive_cycle": "2 ms"}, ("drive_cycle", "at most")),
    ({"to": "ros", "name": "=HYPERLINK(1)"}, ("name", "letters")),
    ({"to": "cam", "dialect": "technosoft", "cycle": "0.01 ms", "resolution": COUNT}, ("8192 points at most",)),
]


@pytest.mark.parametrize(("options", "words"), BAD, ids=[str(i) for i in range(len(BAD))])
def test_bad_input_is_one_line_with_the_remedy(
    fastest: trajopt.Solution, tmp_path: Path, options: dict[str, Any], words: tuple[str, ...]
) -> None:
    with pytest.raises(trajopt.BadInput) as refused:
        fastest.export(tmp_path / "file", **options)
    assert "\n" not in str(refused.value) and all(word in str(refused.value) for word in words), str(refused.value)
    assert not list(tmp_path.iterdir())


def test_the_last_cycle_is_never_a_sliver(fastest: trajopt.Solution, tmp_path: Path) -> None:
    assert fastest.duration is not None
    report = fastest.export(tmp_path / "z.csv", "xps", cycle=fastest.duration / (20 + 1e-5), allow=True)
    assert report.points == 21 and abs(row(report, "jerk").peak) < 98.1 * (1 + 1e-6)


def test_a_cycle_longer_than_the_move_and_a_folder_are_refused(strained: trajopt.Solution, tmp_path: Path) -> None:
    with pytest.raises(trajopt.BadInput, match="longer than the move, 1 s"):
        strained.export(tmp_path / "f", "csv", cycle="2 s")
    with pytest.raises(trajopt.BadInput, match="is a folder; name a file"):
        strained.export(tmp_path, "csv")


def test_a_move_that_ends_in_motion_needs_a_format_that_can(tmp_path: Path) -> None:
    problem = axis("jerk", "l2", distance=0.25, end={"velocity": 0.2}, time=0.9995, intervals=20)
    solution = solved(problem)
    for to in ("zaber", "xps"):
        with pytest.raises(trajopt.BadInput, match="starts and stops at rest, the move ends at 0.2"):
            solution.export(tmp_path / "f", to)
    with pytest.raises(trajopt.BadInput, match="ends in motion"):
        solution.export(tmp_path / "f", "setpoints", cycle="1 ms", resolution=COUNT)
    assert solution.export(tmp_path / "f", "setpoints", cycle="0.5 ms", resolution=COUNT).end_error <= 0.5e-7
    assert solution.export(tmp_path / "f", "ros").tracking_error < 1e-9


def test_euler_unsolved_and_altered_solutions_are_never_exported(strained: trajopt.Solution, tmp_path: Path) -> None:
    euler = solved(table_i("jerk", "l2", scheme="euler", intervals=20))
    with pytest.raises(trajopt.BadInput, match='scheme = "exact"'):
        euler.export(tmp_path / "f", "csv")
    impossible = trajopt.solve(axis("jerk", "l2", limits={"velocity": 0.5}, intervals=20))
    with pytest.raises(trajopt.NoSolution, match="IMPOSSIBLE"):
        impossible.export(tmp_path / "f", "csv")
    assert strained.trajectory is not None
    chain = tuple(x * (1 + 1e-4) for x in strained.trajectory.chain)
    altered = replace(strained, trajectory=replace(strained.trajectory, chain=chain))
    with pytest.raises(trajopt.TrajoptError, match="the checker rejects"):
        altered.export(tmp_path / "f", "csv")
    assert not list(tmp_path.iterdir())
    impossible.save(tmp_path)
    with pytest.raises(trajopt.NoSolution, match="IMPOSSIBLE carries no trajectory"):
        trajopt.read_result(tmp_path)


def test_what_is_no_result_of_a_move_is_refused(tmp_path: Path) -> None:
    trajopt.solve(trajopt.load("two_masses_and_a_spring")).save(tmp_path)
    with pytest.raises(trajopt.BadInput, match="only the result of a move of one axis"):
        trajopt.read_result(tmp_path)
    (tmp_path / "result.json").write_text('{"format": ')
    for path in (tmp_path / "result.json", tmp_path / "missing.json"):
        with pytest.raises(trajopt.BadInput, match="give the result.json of a solve"):
            trajopt.read_result(path)


def test_results_read_back_are_the_same(
    strained: trajopt.Solution, snappy: trajopt.Solution, turning: trajopt.Solution, tmp_path: Path
) -> None:
    for solution in (strained, snappy, turning):
        solution.save(tmp_path)
        back = trajopt.read_result(tmp_path)
        assert back.problem == solution.problem and back.status is solution.status
        assert back.structure == solution.structure and back.metrics == solution.metrics
        assert back.prices == solution.prices and back.route == solution.route
        t = np.linspace(0, solution.duration or 0.0, 333)
        for name, values in solution.at(t).items():
            scale = np.max(np.abs(values))
            np.testing.assert_allclose(back.at(t)[name], values, atol=1e-9 * scale)


def test_command_line(fastest: trajopt.Solution, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def run(*words: str | Path) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in words])
        printed = capsys.readouterr()
        assert "Traceback" not in printed.err
        return int(str(ended.value.code)), printed.out, printed.err

    fastest.save(tmp_path / "out")
    result, file = tmp_path / "out" / "result.json", tmp_path / "move.csv"
    code, out, _ = run("export", result, "--to", "pvt", "--dialect", "zaber", "-o", file)
    assert code == 0 and file.exists() and "PASSED" in out and "jerk" in out
    file.unlink()
    code, out, error = run("export", result, "--to", "galil", "--resolution", COUNT, "-o", file, "--json")
    report = json.loads(out)
    assert code == 3 and not file.exists() and report["verdict"] == "refused" and not report["written"]
    assert {r["name"] for r in report["rows"]} == {"velocity", "acceleration", "jerk"} and "refused:" in error
    code, _, error = run("export", result, "--to", "zaberr", "-o", file)
    assert code == 2 and "did you mean 'zaber'?" in error and len(error.splitlines()) == 1
    code, _, error = run("export", result, "--to", "csv", "-o", tmp_path / "none" / "f")
    assert code == 4 and error == f"trajopt: {tmp_path / 'none'}: no such folder; make it first\n"
    code, _, _ = run("plot", result, tmp_path / "out", "-o", tmp_path / "two.png", "--label", "a", "--label", "b")
    assert code == 0 and (tmp_path / "two.png").read_bytes().startswith(b"\x89PNG")
    edited = json.loads(result.read_text())
    edited["duration"] *= 1 + 1e-12
    result.write_text(json.dumps(edited))
    code, _, error = run("export", result, "--to", "csv", "-o", file)
    assert code == 3 and "seal: broken" in error and not file.exists()


def test_the_documentation_names_every_format_and_its_interpolation() -> None:
    text = (Path(__file__).parents[1] / "docs" / "exports.md").read_text(encoding="utf-8")
    assert [name for name in names() if f"`{name}`" not in text] == []
    assert all(kind in text for kind in NEEDS)
