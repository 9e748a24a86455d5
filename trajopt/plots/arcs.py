"""The arcs of a minimum-time move: when it runs on which limit, and chattering over the logarithm of time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter

from trajopt import units
from trajopt.errors import NoSolution
from trajopt.plots import look
from trajopt.plots.look import COLOURS, SMALL, Panels
from trajopt.problem import DERIVATIVES

if TYPE_CHECKING:
    from trajopt.solution import Solution

SIDES: Final = {"max": (COLOURS[0], ""), "min": (COLOURS[1], "////")}


def plot_arcs(solution: Solution) -> Panels:
    """A bar for every arc, in the row of the quantity whose limit it runs on, with touches as rings; below, where the
    move chatters into a cruise, the top derivative over the time left until the cruise, logarithmic.

    Raises NoSolution where there are no arcs of switching times.
    """
    arcs = [arc for arc in solution.structure.get("arcs", ()) if "limit" in arc]
    if not arcs:
        raise NoSolution("the solution has no arcs: it was not found by its switching times")
    chatters = bool(solution.structure.get("chatters"))
    panels = look.panels(2 if chatters else 1, 5.2 if chatters else 2.8)
    _timeline(panels[0], arcs, solution.structure.get("touches", ()))
    look.title(panels[0], solution.problem.title or "Arcs")
    if chatters:
        top = DERIVATIVES[solution.problem.order]
        unit = units.kinds(solution.problem.rotary)[top].unit
        _towards_the_cruise(panels[1], arcs, f"{top} [{look.pretty(unit)}]")
    handles = panels[0].get_legend_handles_labels()
    panels.figure.legend(*handles, loc="outside lower center", ncols=3, fontsize=SMALL, frameon=False)
    return panels


def _timeline(axes: Axes, arcs: list[dict[str, Any]], touches: Any) -> None:
    shown = [name for name in DERIVATIVES if any(arc["limit"].startswith(f"{name}.") for arc in arcs)]
    rows = {name: k for k, name in enumerate(reversed(shown))}
    for arc in arcs:
        name, _, side = arc["limit"].partition(".")
        colour, hatch = SIDES[side]
        axes.barh(rows[name], arc["to"] - arc["from"], left=arc["from"], height=0.7, color=colour, hatch=hatch,
                  edgecolor="white", linewidth=0)  # fmt: skip
    touched = [(t["time"], rows[name]) for t in touches if (name := t["limit"].partition(".")[0]) in rows]
    for side, (colour, hatch) in SIDES.items():
        axes.barh(0, 0.0, color=colour, hatch=hatch, edgecolor="white", label=f"on the {side}imum")
    if touched:
        axes.plot(*zip(*touched, strict=True), "o", color="black", markerfacecolor="white", markersize=4, label="touch")
    axes.grid(False)
    axes.set_yticks(list(rows.values()), list(rows))
    axes.set_xlabel("time [s]", fontsize=SMALL)
    axes.set_xlim(0.0, arcs[-1]["to"])


def _towards_the_cruise(axes: Axes, arcs: list[dict[str, Any]], label: str) -> None:
    """The top derivative of the arcs before the longest one, the cruise (after it, where the move begins with it): each
    touch is the last one drawn smaller."""
    cruise = max(range(len(arcs)), key=lambda k: arcs[k]["to"] - arcs[k]["from"])
    near, far, beside = ("to", "from", arcs[:cruise]) if cruise else ("from", "to", arcs[:0:-1])
    border = arcs[cruise][far] if cruise else arcs[cruise]["to"]
    away = np.abs(np.array([arc[far] for arc in beside] + [beside[-1][near]]) - border)
    away[-1] = max(away[-1], 0.3 * away[-2])
    top = np.array([arc["top"] for arc in beside])
    axes.stairs(top[::-1], away[::-1], color=COLOURS[0], linewidth=1.4, baseline=None)
    axes.set_xscale("log")
    if cruise:
        axes.invert_xaxis()
    axes.set_xlabel(f"time {'left until' if cruise else 'since'} the cruise [s], logarithmic", fontsize=SMALL)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if away[0] < 300 * away[-1] else (1.0,)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel(label, fontsize=SMALL)
