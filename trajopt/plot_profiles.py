"""Figures of a mechanism: its inertia and load over position, the force of profiles over time, and what each costs."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trajopt import units
from trajopt.laws import Laid
from trajopt.plot import COLOURS, GREY, curve, pretty
from trajopt.problem import Load, Problem

if TYPE_CHECKING:
    from trajopt.profiles import Profiles

_STYLES = ((0, ()), (0, (6, 2)), (0, (2, 1.5)), (0, (6, 2, 1.5, 2)), (0, (1, 1)))


def plot_load(problem: Problem, axes: Axes | None = None) -> Axes:
    """Inertia, and on a second scale the load's own force, over position; the move's range shaded."""
    axes = axes or Figure(figsize=(7.0, 3.0), layout="constrained").subplots()
    scale = draw_load(axes, problem.load, problem.rotary)
    ends = [problem.move.start_position, problem.move.end.position]
    if all(isinstance(x, float) for x in ends):
        axes.axvspan(*(float(x or 0.0) * scale for x in ends), color="0.93", zorder=0)
        axes.set_xlabel(f"{axes.get_xlabel()}; the move is shaded", fontsize=8)
    return axes


def draw_load(axes: Axes, load: Load, rotary: bool) -> float:
    """Draw the curves of a load; returns what positions are multiplied by."""
    kinds, drawn = units.kinds(rotary), list[Any]()
    scale, unit = (180 / np.pi, "deg") if rotary else (1.0, "m")
    for k, (name, along) in enumerate(load.curves.items()):
        here = axes if k == 0 else axes.twinx()
        at = np.linspace(*along.span, 600)
        label = kinds[name].name if name == "inertia" else f"load {kinds[name].name}"
        drawn += here.plot(at * scale, along.at(at), color=COLOURS[k], linestyle=_STYLES[k], linewidth=1.6, label=label)
        here.set_ylabel(f"{label} [{pretty(kinds[name].unit)}]", fontsize=8)
        quiet(here, grid=k == 0)
    axes.set_xlabel(f"position [{unit}]", fontsize=8)
    axes.legend(handles=drawn, fontsize=8, frameon=False, loc="best")
    return scale


def plot_profiles(profiles: Profiles) -> list[Axes]:
    """Three axes: the load over position where there is one, the force of each profile over time, what each costs."""
    problem = profiles.problem
    count = 3 if problem.load.curves else 2
    figure = Figure(figsize=(7.0, 3.0 * count), layout="constrained", facecolor="white")
    panels: list[Axes] = list(figure.subplots(count, 1))
    if count == 3:
        plot_load(problem, panels[0])
    _forces(panels[-2], profiles)
    _costs(panels[-1], profiles)
    title = "\n".join(textwrap.wrap(problem.title or "Profiles", 70))
    panels[0].set_title(title, loc="left", fontsize=11, fontweight="bold")
    return panels


def _forces(axes: Axes, profiles: Profiles) -> None:
    problem, kind = profiles.problem, units.kinds(profiles.problem.rotary)["force"]
    fractions = np.linspace(0.0, 1.0, 1201)
    time = fractions * (problem.move.fixed_time or 0.0) * 1e3
    for k, row in enumerate(profiles.rows):
        force = Laid(problem, row.law).signals(fractions)["force"]
        style = _STYLES[(k // len(COLOURS) + k) % len(_STYLES)]
        axes.plot(time, force, color=COLOURS[k % 6], linestyle=style, linewidth=1.3, label=row.law.name)
    if profiles.best.trajectory is not None:
        seconds, values = curve(profiles.best.trajectory, "force")
        axes.plot(seconds * 1e3, values, color=COLOURS[6], linewidth=1.8, label="best known")
    axes.set_ylabel(f"{kind.name} [{pretty(kind.unit)}]", fontsize=8)
    axes.set_xlabel("time [ms]", fontsize=8)
    quiet(axes)
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
        line: Any = axes.axhline(profiles.best.objective, color=COLOURS[1], linewidth=1.2, linestyle=(0, (6, 3)))
        line.set_label(f"best known {profiles.best.objective:.5g}")
        axes.legend(fontsize=8, frameon=False, loc="upper right")
    axes.margins(y=0.2)
    (term, *others), kinds = profiles.problem.objective.terms, units.kinds(profiles.problem.rotary)
    pure = not others and (term.norm is None or term.norm.name in ("l2", "linf"))
    unit = f" [{pretty(kinds[term.minimize].unit)}]" if pure else ""
    axes.set_ylabel(objective_label(profiles.best) + unit, fontsize=8)
    quiet(axes)


def quiet(axes: Axes, grid: bool = True) -> None:
    """The look of the house, with a grid behind the curves."""
    axes.tick_params(labelsize=8, color=GREY)
    axes.spines["top"].set_visible(False)
    if grid:
        axes.grid(color="0.92", linewidth=0.7)
    axes.set_axisbelow(True)
