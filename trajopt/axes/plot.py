"""Figures of a motion: stacked panels with a colour an axis, limits dashed; as Fig. 9 of Clemen & Rupp 2023."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from trajopt import units
from trajopt.plots import look
from trajopt.plots.look import COLOURS, DASHES, GREY, SMALL, STYLES, Panels, note, pretty
from trajopt.plots.trajectories import curve

if TYPE_CHECKING:
    from trajopt.axes.motion import Motion
    from trajopt.axes.solution import AxesSolution

_IN_VIEW: Final = 1.25  # times the largest value: a limit farther off is named instead of shown


def plot(solution: AxesSolution) -> Panels:
    """Stacked panels of position, its derivatives, force and power of all axes; the release marked. Raises
    NoSolution."""
    from trajopt.axes.report import objective_text

    motion = solution.moved()
    panels = profiles(motion)
    look.title(panels[0], solution.problem.title or "Motion", pad=18)
    note(panels[0], f"minimised {pretty(objective_text(solution))}", "left", SMALL)
    return panels


def profiles(motion: Motion) -> Panels:
    """The panels of a motion without a title."""
    names = _names(motion)
    panels = look.panels(len(names), 1.0 + 1.35 * len(names), share=True)
    kinds = [units.kinds(axis.rotary) for axis in motion.problem.axes]
    for axes, name in zip(panels, names, strict=True):
        for k, axis in enumerate(motion.axes):
            if name in ("force", "power") and axis.problem.load.inertia is None:
                continue
            axes.plot(*curve(axis, name), color=COLOURS[k % len(COLOURS)], linestyle=STYLES[k % len(STYLES)],
                      linewidth=1.6, label=motion.problem.axes[k].name)  # fmt: skip
        _limits(axes, motion, name)
        if motion.release is not None and motion.release < motion.duration:
            axes.axvline(motion.release, color=GREY, linewidth=0.8, linestyle=(0, (1, 2)))
        shown = dict.fromkeys(pretty(kind[name].unit) for kind in kinds)
        axes.set_ylabel(f"{kinds[0][name].name}\n[{', '.join(shown)}]", fontsize=SMALL)
    panels[-1].set_xlabel("time [s]", fontsize=SMALL)
    panels[-1].set_xlim(0.0, motion.duration)
    panels.figure.align_ylabels(panels)
    handles, labels = panels[0].get_legend_handles_labels()
    panels.figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=SMALL,
                         handlelength=3)  # fmt: skip
    return panels


def _names(motion: Motion) -> list[str]:
    names: list[str] = ["position", "velocity", "acceleration", "jerk", "snap"]
    names = names[: max(axis.order for axis in motion.axes) + 1]
    loaded = any(axis.problem.load.inertia is not None for axis in motion.axes)
    return [*names, *(("force", "power") if loaded else ())]


def _limits(axes: Any, motion: Motion, name: str) -> None:
    """Constant limits as grey dashes where they are in view, else named."""
    reach = max(float(np.max(np.abs(line.get_ydata()))) for line in axes.lines)
    found = [axis.limits.given.get(name) for axis in motion.problem.axes]
    sides = {x for limit in found if limit is not None for x in (limit.lowest, limit.highest) if np.isfinite(x)}
    far = sorted({abs(x) for x in sides if abs(x) > _IN_VIEW * reach})
    for x in sides:
        if abs(x) <= _IN_VIEW * reach:
            axes.axhline(x, color=GREY, linewidth=0.9, linestyle=DASHES, zorder=1.5)
    if far:
        note(axes, "limit off scale: ±" + ", ±".join(f"{x:.4g}" for x in far), "right", 7)
