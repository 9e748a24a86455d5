"""Figures of a command: input, output and switching function over time; residual vibration over frequency."""

from __future__ import annotations

import textwrap
from math import pi
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trajopt.plant.command import Command
from trajopt.plot import COLOURS, GREY, SHADE, Panels, dress

if TYPE_CHECKING:
    from trajopt.plant.solution import PlantSolution

_AFTER: Final = 0.2  # of the duration: shown of the rest
_DASHES: Final = (0, (6, 3))
_LABELS: Final = {"input": "input u", "output": "output y", "sigma": "switching\nfunction σ"}


def plot(solution: PlantSolution) -> Panels:
    """Stacked panels of input with its limits, output with its final value, and switching function, positive arcs of
    the input shaded. Raises NoSolution."""
    command = solution._found()
    figure = Figure(figsize=(7.0, 5.4), layout="constrained", facecolor="white")
    panels = Panels(figure.subplots(3, 1, sharex=True))
    rest = command.duration * _AFTER
    time = np.sort([*np.linspace(0.0, command.duration + rest, 1200), *command.switches, command.duration])
    values = solution.at(time)
    for axes, (name, label) in zip(panels, _LABELS.items(), strict=True):
        _shade(axes, command)
        if name == "input":
            starts = [0.0, 0.0, *command.switches, command.duration, command.duration + rest]
            axes.step(starts, [0.0, *command.levels, command.u_ss, command.u_ss], where="post", color=COLOURS[0])
        else:
            axes.plot(time, values[name], color=COLOURS[0], linewidth=1.6)
        for limit in {"input": (command.umin, command.umax), "output": (command.y_f,), "sigma": (0.0,)}[name]:
            axes.axhline(limit, color=GREY, linewidth=0.9, linestyle=_DASHES, zorder=1.5)
        axes.axvline(command.duration, color=GREY, linewidth=0.7)
        axes.set_ylabel(label, fontsize=8)
        dress(axes)
    panels[-1].set_xlim(-0.02 * command.duration, command.duration + rest)
    panels[-1].set_xlabel("time [s]", fontsize=8)
    figure.align_ylabels(panels)
    title = solution.problem.title or "Minimum-time command"
    panels[0].set_title("\n".join(textwrap.wrap(title, 70)), loc="left", fontsize=11, fontweight="bold", pad=18)
    count = len(command.switches)
    note = f"least time {command.duration:.9g} s, {count} switch{'es' * (count != 1)}"
    panels[0].annotate(note, (0.0, 1.0), (0, 3), xycoords="axes fraction", textcoords="offset points", va="bottom",
                       fontsize=8, color=GREY)
    return panels


def plot_vibration(solution: PlantSolution, frequency: Any = None, damping: float | None = None) -> Axes:
    """What the command leaves in a mode, in per cent of all its jumps in step, over the mode's frequency (Hz).

    By default about the plant's oscillatory modes and those added for robustness, which are marked, with the damping of
    the first. Raises NoSolution.
    """
    command = solution._found()
    marked = sorted({p for p in command.poles if p.imag > 0}, key=abs)
    if frequency is None:
        top = 2 * max([abs(p) / (2 * pi) for p in marked], default=4 / command.duration)
        frequency = np.linspace(top / 1000, top, 1000)
    if damping is None:
        damping = abs(marked[0].real) / abs(marked[0]) if marked else 0.0
    figure = Figure(figsize=(7.0, 3.4), layout="constrained", facecolor="white")
    axes = figure.subplots()
    axes.plot(frequency, solution.residual_vibration(frequency, damping), color=COLOURS[0], linewidth=1.6)
    for p in marked:
        axes.axvline(abs(p) / (2 * pi), color=COLOURS[1], linewidth=0.9, linestyle=_DASHES)
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(0.0, float(np.max(frequency)))
    axes.set_xlabel(f"undamped frequency of the mode [Hz], damping ratio {damping:.3g}", fontsize=8)
    axes.set_ylabel("vibration left [%]", fontsize=8)
    dress(axes)
    title = solution.problem.title or "Residual vibration"
    axes.set_title("\n".join(textwrap.wrap(title, 70)), loc="left", fontsize=11, fontweight="bold")
    return axes


def _shade(axes: Axes, command: Command) -> None:
    ends = command.impulses[0]
    for start, end, level in zip(ends, ends[1:], command.levels, strict=False):
        if level == command.umax:
            axes.axvspan(float(start), float(end), facecolor=SHADE, alpha=0.25, linewidth=0, zorder=0.5)
