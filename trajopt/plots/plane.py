"""The torque-speed plane (force-velocity on a linear axis): the move's path coloured by time, within its limits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

from trajopt import units
from trajopt.errors import BadInput, NoSolution
from trajopt.fields import Limit
from trajopt.mesh import Floats
from trajopt.plots import look
from trajopt.plots.look import COLOURS, GREY, SMALL, STYLES
from trajopt.plots.trajectories import curve
from trajopt.problem import Problem

if TYPE_CHECKING:
    from trajopt.solution import Solution

REGION: Final = COLOURS[5]
TIMES: Final = ListedColormap(colormaps["cividis"](np.linspace(0.0, 0.75, 256)))  # even, the same to all eyes
_ROOM: Final = 1.15  # of the plane beyond the path
_GRID: Final = 401  # points a side, on which the allowed region is drawn


def plot_torque_speed(solution: Solution) -> Axes:
    """Torque (N m, or force, N) over speed (rad/s or m/s): the path from start (disc) to end (square), coloured by
    time; shaded what all limits on velocity, force, power, current, voltage and the envelope allow, the largest where
    they vary in time; their borders in line styles of their own. The load's own friction lies within the torque.

    Raises NoSolution, and BadInput for a move without a load.
    """
    trajectory, problem = solution.trajectory, solution.problem
    if trajectory is None:
        raise NoSolution(f"{solution.status.value}: {solution.message or solution.status.advice}")
    if problem.load.inertia is None:
        raise BadInput("load: is missing; a torque-speed plane needs [load] with a mass or an inertia")
    time, force = curve(trajectory, "force")
    speed = np.interp(time, *curve(trajectory, "velocity"))
    axes = look.panels(1, 4.6)[0]
    points = np.stack([speed, force], axis=1)
    segments: Any = np.stack([points[:-1], points[1:]], axis=1)
    path = LineCollection(segments, cmap=TIMES, linewidth=2.4, zorder=3)
    path.set_array((time[:-1] + time[1:]) / 2)
    axes.add_collection(path)
    for k, marker, label in ((0, "o", "start"), (-1, "s", "end")):
        axes.plot(speed[k], force[k], marker, color="black", markerfacecolor="white", zorder=4, label=label)
    _region(axes, problem, speed, force)
    bar = axes.figure.colorbar(path, ax=axes, pad=0.02)
    bar.set_label("time [s]", fontsize=SMALL)
    bar.ax.tick_params(labelsize=SMALL, color=GREY)
    kinds = units.kinds(problem.rotary)
    axes.set_xlabel(f"{'speed' if problem.rotary else 'velocity'} [{kinds['velocity'].unit}]", fontsize=SMALL)
    axes.set_ylabel(f"{kinds['force'].name} [{kinds['force'].unit}]", fontsize=SMALL)
    look.title(axes, problem.title or "Torque and speed")
    handles, _ = axes.get_legend_handles_labels()
    if _limited(problem):
        handles.append(Patch(facecolor=REGION, alpha=0.15, label="within all limits"))
    axes.figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=SMALL, frameon=False)
    return axes


def _limited(problem: Problem) -> list[str]:
    """The limits that are borders in this plane."""
    names = ("velocity", "force", "power", "current", "voltage", "envelope")
    return [name for name in names if getattr(problem.limits, name) is not None]


def _region(axes: Axes, problem: Problem, speed: Floats, force: Floats) -> None:
    """The borders of all limits in view, and what lies within them shaded."""
    spans = [_span(values) for values in (speed, force)]
    axes.set_xlim(*spans[0])
    axes.set_ylim(*spans[1])
    v, f = np.meshgrid(*(np.linspace(*span, _GRID) for span in spans))
    axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=1)
    axes.axvline(0.0, color=GREY, linewidth=0.6, zorder=1)
    inside = np.full(v.shape, np.inf)
    limits = problem.limits.given
    for name, style in zip(_limited(problem), STYLES[1:], strict=False):
        room = _room(limits[name], _value(problem, name, v, f))
        axes.contour(v, f, room, levels=[0.0], colors=["black"], linestyles=[style], linewidths=1.0, zorder=2)
        axes.plot([], [], color="black", linestyle=style, linewidth=1.0, label=f"{problem.shown(name)} limit")
        inside = np.minimum(inside, room)
    if np.any(np.isfinite(inside)):
        axes.contourf(v, f, inside, levels=[0.0, np.inf], colors=[REGION], alpha=0.15, zorder=0.5)


def _span(values: Floats) -> tuple[float, float]:
    low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    room = (_ROOM - 1) * ((high - low) or 1.0)
    return low - room, high + room


def _value(problem: Problem, name: str, v: Floats, f: Floats) -> Floats:
    """What a limit bounds, over the plane."""
    constant, resistance = problem.load.motor or (1.0, 0.0)
    if name == "envelope":
        assert problem.limits.envelope is not None
        return np.asarray(np.max([a * np.abs(f) + b * np.abs(v) for a, b in problem.limits.envelope.lines], axis=0))
    return {"velocity": v, "force": f, "power": f * v, "current": f / constant}.get(
        name, resistance * f / constant + constant * v
    )


def _room(limit: Limit, value: Floats) -> Floats:
    """How far values lie within a limit, relative to its size; negative outside."""
    low, high = limit.lowest, limit.highest
    size = max(abs(x) for x in (low, high) if np.isfinite(x)) or 1.0
    return np.asarray(np.minimum(high - value, value - low) / size)
