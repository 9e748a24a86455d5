"""Pictures of an arm in motion: Figures 8, 9 and 10 of Clemen & Rupp 2023, and an animation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from scara.links import Links
from trajopt.axes.plot import profiles
from trajopt.errors import BadInput
from trajopt.plots import look
from trajopt.plots.look import COLOURS, GREY, SMALL, Panels, dress

if TYPE_CHECKING:
    from trajopt.axes.motion import Motion
    from trajopt.axes.solution import AxesSolution

Floats = NDArray[np.float64]
_SAMPLES: Final = 600
_DASHES: Final = (0, (4, 2))


def poses(solution: AxesSolution) -> Axes:
    """Fig. 8: the arm at the start (solid) and at the end (dashed), and at the release, with the trace of every link's
    end and the velocity of the tip. Raises NoSolution, and BadInput without an arm of links."""
    motion = solution.moved()
    figure, axes = _plane(solution)
    for k, trace in enumerate(_traces(motion, np.linspace(0.0, motion.duration, _SAMPLES))):
        axes.plot(*trace, color=COLOURS[k % len(COLOURS)], linewidth=1.0, label=f"path of link {k + 1}")
    released = motion.release is not None and motion.release < motion.duration
    _draw(axes, motion, 0.0, "solid", "start")
    if released:
        _draw(axes, motion, motion.release or 0.0, (0, (1, 1)), "release")
    _draw(axes, motion, motion.duration, _DASHES, "end")
    if motion.release is not None:
        _arrow(axes, motion, motion.release)
    figure.legend(loc="outside lower center", ncols=3, frameon=False, fontsize=SMALL, handlelength=3)
    return axes


def joints(solution: AxesSolution) -> Panels:
    """Fig. 9: angle, its derivatives, torque and power of every joint. Raises NoSolution."""
    return profiles(solution.moved())


def tips(solution: AxesSolution) -> Panels:
    """Fig. 10: x and y of the ends of all links over time, and the speed of the tip. Raises NoSolution."""
    motion, count = solution.moved(), _SAMPLES
    time = np.linspace(0.0, motion.duration, count)
    panels = look.panels(3, 5.4, share=True)
    for k, trace in enumerate(_traces(motion, time)):
        for axes, values in zip(panels, trace, strict=False):
            axes.plot(time, values, color=COLOURS[k % len(COLOURS)], linewidth=1.6,
                      linestyle="solid" if k == 0 else _DASHES, label=f"end of link {k + 1}")  # fmt: skip
    moved = motion.tip(time)
    for key, colour, style in (("vx", COLOURS[2], "solid"), ("vy", COLOURS[3], _DASHES)):
        panels[2].plot(time, moved[key], color=colour, linestyle=style, linewidth=1.6, label=f"tip, {key[1]}")
    for axes, label in zip(panels, ("x\n[m]", "y\n[m]", "tip velocity\n[m/s]"), strict=True):
        axes.set_ylabel(label, fontsize=SMALL)
        if motion.release is not None:
            axes.axvline(motion.release, color=GREY, linewidth=0.8, linestyle=(0, (1, 2)))
    for axes in (panels[0], panels[2]):
        axes.legend(fontsize=SMALL, frameon=False, loc="best", handlelength=3)
    panels[-1].set_xlabel("time [s]", fontsize=SMALL)
    panels[-1].set_xlim(0.0, motion.duration * 1.01)
    panels.figure.align_ylabels(panels)
    return panels


def animate(solution: AxesSolution, path: str | Path, frames: int = 60, slower: float = 3.0) -> Path:
    """Write the arm in motion as a GIF of so many frames, so many times ``slower`` than it is; returns the path.

    Raises NoSolution, BadInput without an arm of links, OSError.
    """
    motion = solution.moved()
    figure, axes = _plane(solution)
    time = np.linspace(0.0, motion.duration, frames)
    traces = _traces(motion, time)
    bars = np.array([[np.zeros(frames), np.zeros(frames)], *traces])
    (line,) = axes.plot([], [], "-o", color="black", linewidth=3, markersize=6, markerfacecolor="white")
    (trail,) = axes.plot([], [], color=COLOURS[1], linewidth=1.2)
    clock = axes.set_title("", loc="left", fontsize=9)

    def draw(k: int) -> tuple[Any, ...]:
        line.set_data(bars[:, 0, k], bars[:, 1, k])
        trail.set_data(traces[-1][0][: k + 1], traces[-1][1][: k + 1])
        clock.set_text(f"t = {time[k]:.3f} s")
        return line, trail, clock

    rate = max(frames / (motion.duration * slower), 1.0)
    FuncAnimation(figure, draw, frames=frames, blit=False).save(str(path), writer=PillowWriter(fps=round(rate)), dpi=80)
    return Path(path)


def _plane(solution: AxesSolution) -> tuple[Figure, Axes]:
    """Empty axes of equal scale that hold the whole motion."""
    if not isinstance(solution.problem.dynamics, Links):
        raise BadInput("arm: only an arm of links can be drawn; this problem has none")
    reach = 1.1 * solution.problem.dynamics.reach[1]
    figure = Figure(figsize=(5.4, 5.8), layout="constrained", facecolor="white")
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.set_xlabel("x [m]", fontsize=SMALL)
    axes.set_ylabel("y [m]", fontsize=SMALL)
    dress(axes)
    return figure, axes


def _traces(motion: Motion, time: Floats) -> list[tuple[Floats, Floats]]:
    found: list[tuple[Floats, Floats]] = motion.problem.dynamics.elbows(motion.joints(time)[0])
    return found


def _draw(axes: Axes, motion: Motion, time: float, style: Any, label: str) -> None:
    ends = _traces(motion, np.array([time]))
    x, y = ([0.0, *(float(end[i][0]) for end in ends)] for i in (0, 1))
    axes.plot(x, y, color="black", linestyle=style, linewidth=2.2, label=label, zorder=3)
    axes.plot(x, y, "o", color="black", markersize=6, markerfacecolor="white", zorder=4)


def _arrow(axes: Axes, motion: Motion, time: float) -> None:
    """The velocity of the tip, a third of the reach long."""
    tip = {key: float(value) for key, value in motion.tip(time).items()}
    speed = float(np.hypot(tip["vx"], tip["vy"])) or 1.0
    length = motion.problem.dynamics.reach[1] / 3 / speed
    end = (tip["x"] + length * tip["vx"], tip["y"] + length * tip["vy"])
    arrow = {"arrowstyle": "-|>", "color": COLOURS[0], "linewidth": 1.6}
    axes.annotate("", end, (tip["x"], tip["y"]), arrowprops=arrow)
    axes.annotate(f"{speed:.3g} m/s", end, (4, 4), textcoords="offset points", fontsize=SMALL, color=COLOURS[0])
