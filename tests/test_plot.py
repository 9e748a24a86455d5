"""Figures: what the panels show, read back from the artists and from the pixels."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D

import trajopt
from tests.conftest import axis, solved, table_i
from trajopt.plots.redraw import redraw
from trajopt.plots.trajectories import COLOURS, SHADE, Panels, compare, curve, plot

QUICK: dict[str, Any] = {"intervals": 40}


@pytest.fixture(scope="module")
def smooth() -> trajopt.Solution:
    """Table I, least jerk: no limit is active."""
    return solved(table_i("jerk", "l2", **QUICK))


@pytest.fixture(scope="module")
def strained() -> trajopt.Solution:
    """Table I, least velocity: acceleration and jerk run along their limits."""
    return solved(table_i("velocity", "l2", **QUICK))


def labels(panels: list[Axes]) -> list[str]:
    return [axes.get_ylabel().replace("\n", " ") for axes in panels]


def limits(axes: Axes) -> list[Line2D]:
    return [line for line in axes.lines if line.get_label() == "_limit"]


def curves(axes: Axes) -> list[Line2D]:
    return [line for line in axes.lines if not str(line.get_label()).startswith("_")]


def points(line: Line2D) -> tuple[list[float], list[float]]:
    return np.asarray(line.get_xdata()).tolist(), np.asarray(line.get_ydata()).tolist()


def pixels(panels: Panels) -> tuple[FigureCanvasAgg, np.ndarray[Any, Any]]:
    canvas = FigureCanvasAgg(panels.figure)
    canvas.draw()
    return canvas, np.asarray(canvas.buffer_rgba())[..., :3].astype(int)


def inside(axes: Axes, image: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    box = axes.get_window_extent()
    return image[image.shape[0] - int(box.y1) : image.shape[0] - int(box.y0), int(box.x0) : int(box.x1)]


def coloured(image: np.ndarray[Any, Any], colour: str) -> int:
    return int(np.sum(np.abs(image - np.array(to_rgb(colour)) * 255).max(axis=-1) < 30))


def test_panels_of_a_linear_axis_with_a_load(smooth: trajopt.Solution) -> None:
    panels = plot(smooth)
    assert labels(panels) == ["position [m]", "velocity [m/s]", "acceleration [m/s²]", "jerk [m/s³]", "power [W]"]
    assert panels[-1].get_xlabel() == "time [s]"
    assert {axes.get_xlim() for axes in panels} == {(0.0, 1.0)}


def test_panels_of_a_rotary_axis_with_a_torque_limit() -> None:
    problem = axis("acceleration", "l2", limits={"force": 9.0}, load={"inertia": 1.0}, **QUICK).replace(rotary=True)
    assert labels(plot(solved(problem))) == [
        "position [rad]",
        "velocity [rad/s]",
        "acceleration [rad/s²]",
        "torque [N m]",
        "power [W]",
    ]


def test_snap_has_a_panel_and_power_has_none_without_a_load() -> None:
    assert labels(plot(solved(axis("snap", "l2", **QUICK))))[-2:] == ["jerk [m/s³]", "snap [m/s⁴]"]


def test_title_names_the_problem_and_the_objective(smooth: trajopt.Solution) -> None:
    titled = solved(smooth.problem.replace(title="A move"))
    top = plot(titled)[0]
    assert top.get_title(loc="left") == "A move"
    assert f"minimised jerk l2 = {titled.objective:.9g} m/s³" in [text.get_text() for text in top.texts]


def test_curves_are_the_interpolant(strained: trajopt.Solution) -> None:
    panels = plot(strained)
    for axes, name in zip(panels, ("position", "velocity", "acceleration"), strict=False):
        time, values = points(curves(axes)[0])
        assert len(time) > 10 * 40
        np.testing.assert_allclose(values, strained.at(time)[name], atol=1e-12)


def test_power_is_force_times_velocity_between_the_nodes(strained: trajopt.Solution) -> None:
    time, power = points(curves(plot(strained)[-1])[0])
    at = strained.at(time)
    np.testing.assert_allclose(power, 10.0 * at["acceleration"] * at["velocity"], atol=1e-10)


def test_position_counts_from_the_start_position() -> None:
    solution = solved(axis("jerk", "l2", start={"position": 2.0}, distance=3.0, **QUICK))
    _, values = points(curves(plot(solution)[0])[0])
    assert values[0] == pytest.approx(2.0) and values[-1] == pytest.approx(3.0)


def test_the_top_derivative_is_drawn_as_steps(strained: trajopt.Solution) -> None:
    assert strained.trajectory is not None
    time, values = curve(strained.trajectory, "jerk")
    nodes = strained.trajectory.time
    np.testing.assert_array_equal(time, np.stack([nodes[:-1], nodes[1:]], axis=1).ravel())
    np.testing.assert_array_equal(values, np.repeat(strained.trajectory.chain[3], 2))


def test_euler_shows_its_nodes() -> None:
    solution = solved(table_i("jerk", "l2", scheme="euler", **QUICK))
    panels = plot(solution)
    for axes, name in ((panels[1], "velocity"), (panels[-1], "power")):
        time, values = points(curves(axes)[0])
        assert time == solution.frame["time"].tolist()
        assert values == solution.frame[name].tolist()


def test_limits_are_dashed_lines_at_their_values(smooth: trajopt.Solution) -> None:
    panels = plot(smooth)
    shown = [sorted(points(line)[1][0] for line in limits(axes)) for axes in panels]
    assert shown == [[], [0.0, 0.5], [-4.905, 4.905], [-98.1, 98.1], [-100.0, 100.0]]
    assert all(line.is_dashed() for axes in panels for line in limits(axes))


def test_a_limit_off_scale_is_named_instead(smooth: trajopt.Solution) -> None:
    power, velocity = plot(smooth)[-1], plot(smooth)[1]
    assert "limit off scale: ±100 W" in [text.get_text() for text in power.texts]
    assert power.get_ylim()[1] < 50
    assert velocity.get_ylim()[1] > 0.5 and not velocity.texts


def test_a_limit_by_time_is_drawn_with_its_corners() -> None:
    varying = {"min": 0.0, "max": {"time": [0.3, 0.5, 0.7], "value": [2.0, 1.2, 2.0]}}
    solution = solved(axis("jerk", "l2", limits={"velocity": varying}, **QUICK))
    upper = limits(plot(solution)[1])[1]
    assert points(upper) == ([0.0, 0.3, 0.5, 0.7, 1.0], [2.0, 2.0, 1.2, 2.0, 2.0])


def test_shading_marks_active_limits_and_nothing_else(smooth: trajopt.Solution, strained: trajopt.Solution) -> None:
    assert [len(axes.patches) for axes in plot(smooth)] == [0, 0, 0, 0, 0]
    jerk = plot(strained)[3]
    spans = [patch.get_extents().transformed(jerk.transData.inverted()) for patch in jerk.patches]
    assert strained.trajectory is not None
    chain, time = strained.trajectory.chain[3], strained.trajectory.time
    for k, middle in enumerate((time[:-1] + time[1:]) / 2):
        assert any(box.x0 < middle < box.x1 for box in spans) == (abs(abs(chain[k]) - 98.1) < 1e-4), middle


def test_via_states_are_marked() -> None:
    via = (trajopt.Via(time=0.5, position=0.3, velocity=1.0),)
    panels = plot(solved(axis("jerk", "l2", via=via, **QUICK)))
    marks = [[points(line) for line in axes.lines if line.get_label() == "_via"] for axes in panels]
    assert marks == [[([0.5], [0.3])], [([0.5], [1.0])], [], []]


def test_rendering_shows_curve_and_shade_in_every_panel(strained: trajopt.Solution) -> None:
    panels = plot(strained)
    assert isinstance(panels, Panels)
    _, image = pixels(panels)
    for axes in panels:
        assert coloured(inside(axes, image), COLOURS[0]) > 300
    tint = "#{:02x}{:02x}{:02x}".format(*(int(255 * (0.35 * x + 0.65)) for x in to_rgb(SHADE)))
    assert coloured(inside(panels[3], image), tint) > 1000


def test_labels_lie_within_the_figure(strained: trajopt.Solution) -> None:
    panels = plot(strained)
    assert isinstance(panels, Panels)
    canvas, image = pixels(panels)
    for axes in panels:
        box = axes.get_tightbbox(canvas.get_renderer())
        assert box is not None
        assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= image.shape[1] + 1 and box.y1 <= image.shape[0] + 1


def test_a_notebook_shows_a_picture(smooth: trajopt.Solution) -> None:
    panels = smooth.plot()
    assert isinstance(panels, Panels)
    png = panels._repr_png_()
    assert png.startswith(b"\x89PNG") and len(png) > 10_000


def test_compare_overlays_with_a_legend(smooth: trajopt.Solution, strained: trajopt.Solution) -> None:
    panels = compare({"smooth": smooth, "strained": strained}, title="Two moves")
    assert [[line.get_label() for line in curves(axes)] for axes in panels] == [["smooth", "strained"]] * 5
    assert [line.get_color() for line in curves(panels[0])] == list(COLOURS[:2])
    assert [len(limits(axes)) for axes in panels] == [0, 2, 2, 2, 2]  # the same limits are drawn once
    assert [text.get_text() for text in panels.figure.legends[0].get_texts()] == ["smooth", "strained"]
    assert panels[0].get_title(loc="left") == "Two moves"


def test_compare_repeats_the_colours_for_dashed_ones(smooth: trajopt.Solution, strained: trajopt.Solution) -> None:
    first, second = curves(compare({"a": smooth}, dashed={"b": strained})[1])
    assert (first.get_color(), first.is_dashed()) == (COLOURS[0], False)
    assert (second.get_color(), second.is_dashed()) == (COLOURS[0], True)


def test_compare_takes_moves_of_different_order_and_duration(smooth: trajopt.Solution) -> None:
    short = solved(axis("acceleration", "l2", time=0.5, **QUICK))
    panels = compare({"smooth": smooth, "short": short})
    assert [len(curves(axes)) for axes in panels] == [2, 2, 2, 1, 1]
    assert panels[0].get_xlim() == (0.0, 1.0)
    assert [text.get_text() for text in panels.figure.legends[0].get_texts()] == ["smooth", "short"]


def test_without_a_solution_there_is_no_figure(smooth: trajopt.Solution) -> None:
    impossible = trajopt.solve(axis("jerk", "l2", limits={"velocity": 0.5}, **QUICK))
    assert not impossible.status.solved
    with pytest.raises(trajopt.NoSolution):
        plot(impossible)
    with pytest.raises(trajopt.NoSolution):
        compare({"smooth": smooth, "impossible": impossible})
    with pytest.raises(ValueError, match="at least one"):
        compare({})


def test_pyplot_and_its_global_figures_stay_out() -> None:
    code = (
        "import sys, trajopt.plots.trajectories;"
        " print('matplotlib.figure' in sys.modules, 'matplotlib.pyplot' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["True", "False"]


def within(figure: Any) -> None:
    """Every text of a figure lies within it, and every scale says its unit; a plant's signals have none."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    width, height = canvas.get_width_height()
    for axes in figure.axes:
        box = axes.get_tightbbox(canvas.get_renderer())
        assert box.x0 >= -1 and box.y0 >= -1 and box.x1 <= width + 1 and box.y1 <= height + 1, axes
        for scale in (axes.xaxis, axes.yaxis):
            ticks = [label.get_text() for label in scale.get_ticklabels() if label.get_visible()]
            named = any(re.match("[a-z]", text) for text in ticks)
            plain = re.match("input|output|switching", scale.get_label_text())
            assert "[" in scale.get_label_text() or not ticks or named or plain, (axes, ticks)
    for legend in figure.legends:
        box = legend.get_window_extent(canvas.get_renderer())
        assert box.x0 >= -1 and box.y0 >= -1 and box.x1 <= width + 1, legend


@pytest.fixture(scope="module")
def motor() -> trajopt.Solution:
    """A rotary axis with envelope, power limit and a mode to be kept quiet."""
    return solved(
        trajopt.from_dict(
            {
                "title": "A table that is asked for more than a title of one line can say in a figure of this width",
                "move": {"time": "0.3 s", "end": {"position": "5 rad"}},
                "limits": {
                    "velocity": "300 rpm",
                    "envelope": {
                        "speed": ["0 rad/s", "15 rad/s", "40 rad/s"],
                        "torque": ["2.6 N m", "2.6 N m", "1 N m"],
                    },
                    "power": "45 W",
                },
                "load": {"inertia": "0.01 kg m^2", "viscous": "1e-3 N m s/rad"},
                "vibration": [{"frequency": "30 Hz", "damping": 0.02}],
                "objective": {"minimize": "force", "norm": "l2"},
                "transcription": {"intervals": 60},
            }
        )
    )


@pytest.fixture(scope="module")
def arcs() -> trajopt.Solution:
    """A snap-limited least time, which chatters."""
    limits = {"velocity": 1.0, "acceleration": 20.0, "jerk": 1000.0, "snap": 1e5}
    return solved(axis("time", time="free", distance=0.3, limits=limits))


def test_every_figure_keeps_its_texts_within_and_names_its_units(
    motor: trajopt.Solution, arcs: trajopt.Solution, smooth: trajopt.Solution, strained: trajopt.Solution
) -> None:
    for solution in (motor, arcs, strained):
        within(plot(solution).figure)
        within(solution.plot_prices().figure)
        within(solution.plot_vibration().figure)
    within(arcs.plot_arcs()[0].figure)
    for solution in (motor, smooth):
        within(solution.plot_torque_speed().figure)
    within(trajopt.compare([smooth, strained], ["smooth", "strained"]).figure)
    command = trajopt.solve(trajopt.load("two_masses_and_a_spring"))
    within(command.plot()[0].figure)
    within(command.plot_vibration().figure)


def test_compare_takes_a_list_with_labels_and_styles_that_differ_in_print(
    smooth: trajopt.Solution, strained: trajopt.Solution
) -> None:
    panels = trajopt.compare([smooth, strained], ["a", "b"])
    first, second = curves(panels[1])
    assert [first.get_label(), second.get_label()] == ["a", "b"]
    assert first.get_linestyle() != second.get_linestyle() and first.get_color() != second.get_color()
    assert [line.get_label() for line in curves(trajopt.compare([smooth, smooth])[0])] == [
        "1: trajectory", "2: trajectory",
    ]  # fmt: skip
    for wrong in (["a"], ["a", "a"]):
        with pytest.raises(ValueError, match="as many different labels"):
            trajopt.compare([smooth, strained], wrong)


def test_an_envelope_is_the_limit_of_torque_at_each_speed(motor: trajopt.Solution) -> None:
    panels = plot(motor)
    torque = panels[3]
    assert torque.get_ylabel().startswith("torque")
    low, high = limits(torque)
    time, values = points(high)
    speed = np.abs(motor.at(time)["velocity"])
    np.testing.assert_allclose(values, np.interp(speed, [0, 15, 40], [2.6, 2.6, 1.0]), atol=1e-3)
    np.testing.assert_allclose(points(low)[1], -np.array(values))
    assert len(torque.patches) >= 1  # shaded where it is active


def test_the_plane_shows_the_path_and_shades_what_is_allowed(motor: trajopt.Solution, smooth: trajopt.Solution) -> None:
    axes = motor.plot_torque_speed()
    path = next(c for c in axes.collections if isinstance(c, LineCollection) and c.get_array() is not None)
    segments = np.array(path.get_segments())
    speed, torque = segments[:, 0, 0], segments[:, 0, 1]
    expected = motor.at(np.minimum(path.get_array(), 0.3))
    np.testing.assert_allclose(speed, expected["velocity"], atol=0.3)
    assert np.max(np.abs(torque)) <= 2.6 * (1 + 1e-6)
    labelled = {text.get_text() for text in axes.figure.legends[0].get_texts()}
    assert labelled == {"start", "end", "velocity limit", "power limit", "envelope limit", "within all limits"}
    assert axes.get_xlabel() == "speed [rad/s]" and axes.get_ylabel() == "torque [N m]"
    assert smooth.plot_torque_speed().get_ylabel() == "force [N]"
    bare = solved(axis("jerk", "l2", **QUICK))
    with pytest.raises(trajopt.BadInput, match=r"load: is missing"):
        bare.plot_torque_speed()


def test_redrawing_written_results(
    motor: trajopt.Solution,
    arcs: trajopt.Solution,
    smooth: trajopt.Solution,
    strained: trajopt.Solution,
    tmp_path: Path,
) -> None:
    for name, solution in {"motor": motor, "arcs": arcs, "smooth": smooth, "strained": strained}.items():
        solution.save(tmp_path / name)
    out = tmp_path / "picture.png"
    for kind, name in (
        ("trajectory", "smooth"), ("prices", "strained"), ("arcs", "arcs"), ("vibration", "motor"),
        ("torque-speed", "motor"), (None, "motor"),
    ):  # fmt: skip
        redraw([tmp_path / name], out, kind)
        assert out.read_bytes().startswith(b"\x89PNG") and len(out.read_bytes()) > 10_000
        out.unlink()
    redraw([tmp_path / "smooth", tmp_path / "strained" / "result.json"], tmp_path / "two.svg", labels=["s", "t"])
    assert b"<svg" in (tmp_path / "two.svg").read_bytes()
    for arguments, words in (
        (([tmp_path / "motor"], out, "prizes"), "did you mean 'prices'?"),
        (([tmp_path / "motor", tmp_path / "arcs"], out, "prices"), "draws one result, got 2"),
        (([tmp_path / "motor"], tmp_path / "p.gif"), "ends in one of"),
        (([tmp_path / "motor"], out, None, ["a"]), "leave --label out"),
        (([tmp_path / "motor", tmp_path / "arcs"], out), "no unit in common"),
        (([tmp_path / "smooth", tmp_path / "strained"], out, None, ["a"]), "as many different labels"),
        (([tmp_path / "arcs"], out, "torque-speed"), "load: is missing"),
        (([tmp_path / "none"], out), "cannot be read"),
    ):
        with pytest.raises(trajopt.BadInput, match=re.escape(words)):
            redraw(*arguments)
    with pytest.raises(trajopt.NoSolution, match="no arcs"):
        redraw([tmp_path / "smooth"], out, "arcs")
    assert not out.exists()
