"""Figures of a mechanism: its inertia and load over position, the force of profiles over time, and what each costs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from trajopt import units
from trajopt.plots import look
from trajopt.plots.look import COLOURS, DASHES, SMALL, STYLES, Panels, pretty
from trajopt.plots.trajectories import curve
from trajopt.problem import Load, Problem
from trajopt.profiles.laws import Laid

if TYPE_CHECKING:
    from trajopt.profiles import Profiles


def plot_load(problem: Problem, axes: Axes | None = None) -> Axes:
    """Inertia, and on a second scale the load's own force, over position; the move's range shaded."""
    axes = axes or look.panels(1, 3.0)[0]
    scale = draw_load(axes, problem.load, problem.rotary)
    ends = [problem.move.start_position, problem.move.end.position]
    if all(isinstance(x, float) for x in ends):
        axes.axvspan(*(float(x or 0.0) * scale for x in ends), color="0.93", zorder=0)
        axes.set_xlabel(f"{axes.get_xlabel()}; the move is shaded", fontsize=SMALL)
    return axes


def draw_load(axes: Axes, load: Load, rotary: bool) -> float:
    """Draw the curves of a load; returns what positions are multiplied by."""
    kinds, drawn = units.kinds(rotary), list[Any]()
    scale, unit = (180 / np.pi, "deg") if rotary else (1.0, "m")
    for k, (name, along) in enumerate(load.curves.items()):
        here = axes if k == 0 else axes.twinx()
        at = np.linspace(*along.span, 600)
        label = kinds[name].name if name == "inertia" else f"load {kinds[name].name}"
        drawn += here.plot(at * scale, along.at(at), color=COLOURS[k], linestyle=STYLES[k], linewidth=1.6, label=label)
        here.set_ylabel(f"{label} [{pretty(kinds[name].unit)}]", fontsize=SMALL)
        here.spines["right"].set_visible(k > 0)
        here.spines["top"].set_visible(False)
        here.tick_params(labelsize=SMALL)
    axes.set_xlabel(f"position [{unit}]", fontsize=SMALL)
    axes.legend(handles=drawn, fontsize=SMALL, frameon=False, loc="best")
    return scale


def plot_profiles(profiles: Profiles) -> Panels:
    """Three axes: the load over position where there is one, the force of each profile over time, what each costs."""
    problem = profiles.problem
    count = 3 if problem.load.curves else 2
    panels = look.panels(count, 3.0 * count)
    if count == 3:
        plot_load(problem, panels[0])
    _forces(panels[-2], profiles)
    _costs(panels[-1], profiles)
    look.title(panels[0], problem.title or "Profiles")
    return panels


def _forces(axes: Axes, profiles: Profiles) -> None:
    problem, kind = profiles.problem, units.kinds(profiles.problem.rotary)["force"]
    fractions = np.linspace(0.0, 1.0, 1201)
    time = fractions * (problem.move.fixed_time or 0.0) * 1e3
    for k, row in enumerate(profiles.rows):
        force = Laid(problem, row.law).signals(fractions)["force"]
        style = STYLES[(k // len(COLOURS) + k) % len(STYLES)]
        axes.plot(time, force, color=COLOURS[k % 6], linestyle=style, linewidth=1.3, label=row.law.name)
    if profiles.best.trajectory is not None:
        seconds, values = curve(profiles.best.trajectory, "force")
        axes.plot(seconds * 1e3, values, color=COLOURS[6], linewidth=1.8, label="best known")
    axes.set_ylabel(f"{kind.name} [{pretty(kind.unit)}]", fontsize=SMALL)
    axes.set_xlabel("time [ms]", fontsize=SMALL)
    axes.legend(fontsize=7, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _costs(axes: Axes, profiles: Profiles) -> None:
    from trajopt.report import objective_label

    rows = list(profiles.rows)
    values = [row.objective for row in rows]
    bars = axes.bar([row.law.name for row in rows], values, color=COLOURS[0], width=0.6)
    above = [profiles.above(row) for row in rows]
    labels = [f"{v:.4g}" + ("" if a is None else f"\n{100 * a:+.3g} %") for v, a in zip(values, above, strict=True)]
    axes.bar_label(bars, labels=labels, padding=2, fontsize=7)
    if profiles.best.objective is not None:
        line: Any = axes.axhline(profiles.best.objective, color=COLOURS[1], linewidth=1.2, linestyle=DASHES)
        line.set_label(f"best known {profiles.best.objective:.5g}")
        axes.legend(fontsize=SMALL, frameon=False, loc="upper right")
    axes.margins(y=0.2)
    (term, *others), kinds = profiles.problem.objective.terms, units.kinds(profiles.problem.rotary)
    pure = not others and (term.norm is None or term.norm.name in ("l2", "linf"))
    unit = f" [{pretty(kinds[term.minimize].unit)}]" if pure else ""
    axes.set_ylabel(objective_label(profiles.best) + unit, fontsize=SMALL)
