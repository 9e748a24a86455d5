"""Figures of a command: input, output and switching function over time; residual vibration over frequency."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.axes import Axes

from trajopt.plant.command import Command
from trajopt.plots import look
from trajopt.plots.look import COLOURS, DASHES, GREY, SHADE, SMALL, Panels

if TYPE_CHECKING:
    from trajopt.plant.solution import PlantSolution

_AFTER: Final = 0.2  # of the duration: shown of the rest
_LABELS: Final = {"input": "input u", "output": "output y", "sigma": "switching\nfunction σ"}


def plot(solution: PlantSolution) -> Panels:
    """Stacked panels of input with its limits, output with its final value, and switching function, positive arcs of
    the input shaded. Raises NoSolution."""
    command = solution._found()
    panels = look.panels(3, 5.4, share=True)
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
            axes.axhline(limit, color=GREY, linewidth=0.9, linestyle=DASHES, zorder=1.5)
        axes.axvline(command.duration, color=GREY, linewidth=0.7)
        axes.set_ylabel(label, fontsize=SMALL)
    panels[-1].set_xlim(-0.02 * command.duration, command.duration + rest)
    panels[-1].set_xlabel("time [s]", fontsize=SMALL)
    panels.figure.align_ylabels(panels)
    look.title(panels[0], solution.problem.title or "Minimum-time command", pad=18)
    count = len(command.switches)
    look.note(panels[0], f"least time {command.duration:.9g} s, {count} switch{'es' * (count != 1)}", "left", SMALL)
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
    axes = look.panels(1, 3.4)[0]
    axes.plot(frequency, solution.residual_vibration(frequency, damping), color=COLOURS[0], linewidth=1.6)
    for p in marked:
        axes.axvline(abs(p) / (2 * pi), color=COLOURS[1], linewidth=0.9, linestyle=DASHES)
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(0.0, float(np.max(frequency)))
    axes.set_xlabel(f"undamped frequency of the mode [Hz], damping ratio {damping:.3g}", fontsize=SMALL)
    axes.set_ylabel("vibration left [%]", fontsize=SMALL)
    look.title(axes, solution.problem.title or "Residual vibration")
    return axes


def _shade(axes: Axes, command: Command) -> None:
    ends = command.impulses[0]
    for start, end, level in zip(ends, ends[1:], command.levels, strict=False):
        if level == command.umax:
            axes.axvspan(float(start), float(end), facecolor=SHADE, alpha=0.25, linewidth=0, zorder=0.5)
