"""Figures of a solution: stacked panels of position and its derivatives, force and power, with their limits.

The look is that of `trajopt.plots.look`. Curves are the exact interpolant, not lines between samples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from math import comb
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from trajopt import motor, units
from trajopt.errors import NoSolution
from trajopt.fields import Limit
from trajopt.mesh import Floats
from trajopt.plots import look
from trajopt.plots.look import COLOURS, DASHES, GREY, SHADE, SMALL, STYLES, Panels, note, pretty
from trajopt.problem import DERIVATIVES, FREE
from trajopt.trajectory import Trajectory

if TYPE_CHECKING:
    from trajopt.solution import Solution

__all__ = ["COLOURS", "GREY", "SHADE", "Panels", "compare", "curve", "plot", "plot_prices", "plot_vibration"]

POINTS: Final = 4000  # about as many samples a curve, shared among the intervals
ACTIVE: Final = 1e-6  # of the limit: closer than this, for longer than an interval, it is active
ACTIVE_LOAD: Final = 1e-3  # the same for force and power: at a limit they sag between nodes, by the curvature of a step
_ELECTRICAL: Final = ("current", "voltage", "electrical_power")
IN_VIEW: Final = 1.6  # times the height of the curves: a limit farther off is named instead of shown


def plot(solution: Solution) -> Panels:
    """Stacked panels of one solution, limits dashed and shaded where active, the objective in the title.

    Power has a panel when there is a load, force when it is limited or minimised; current, voltage and electrical power
    have when there is a motor. Raises NoSolution.
    """
    from trajopt.report import objective_text

    trajectory = _moved(solution)
    names = signal_names(trajectory)
    panels = _panels(names, trajectory)
    for axes, name in zip(panels, names, strict=True):
        time, values = curve(trajectory, name)
        sides = _sides(trajectory, name, time)
        if sides:
            close = _close(values, sides, ACTIVE if name in DERIVATIVES else ACTIVE_LOAD)
            top = name == DERIVATIVES[trajectory.order]
            _shade(axes, time, close, shortest=(0.99 if top else 1.5) * float(np.min(np.diff(trajectory.time))))
        axes.plot(time, values, color=COLOURS[0], linewidth=1.6, label=name)
        _finish(axes, name, [trajectory])
    _mark_arcs(panels, solution.structure)
    look.title(panels[0], solution.problem.title or "Trajectory", pad=18)
    note(panels[0], f"minimised {pretty(objective_text(solution))}", "left", SMALL)
    return panels


def plot_prices(solution: Solution) -> Axes:
    """The prices of the limits and of the time as bars: what 1 % more of each does to the objective, per cent.

    Raises NoSolution.
    """
    from trajopt.report import objective_label

    _moved(solution)
    rows = [price for price in reversed(solution.prices) if price["per_percent"]]
    axes = look.panels(1, 1.2 + 0.4 * max(len(rows), 1))[0]
    axes.grid(False)
    values = [100 * row["per_percent"] for row in rows]
    names = [pretty(solution.problem.shown(row["name"])) for row in rows]
    bars = axes.barh(names, values, color=COLOURS[0], height=0.6)
    axes.bar_label(bars, labels=[f"{value:+.3g} %" for value in values], padding=4, fontsize=SMALL)
    axes.axvline(0.0, color=GREY, linewidth=0.8)
    axes.margins(x=0.2)
    axes.set_xlabel(f"change of {pretty(objective_label(solution))} [%] for 1 % more", fontsize=SMALL)
    look.title(axes, solution.problem.title or "Prices")
    axes.spines["left"].set_visible(False)
    axes.tick_params(left=False)
    return axes


def plot_vibration(solution: Solution, frequency: Any = None, damping: float | None = None) -> Axes:
    """What the move leaves in a mode, over its frequency (Hz): the amplitude after the move, relative to the stroke.

    By default around the modes of ``problem.vibration``, which are marked, with the damping of the first. Raises
    NoSolution.
    """
    from trajopt.vibration import residual

    trajectory = _moved(solution)
    asked = trajectory.problem.vibration
    bands = [m.frequency if isinstance(m.frequency, tuple) else (m.frequency, m.frequency) for m in asked]
    if frequency is None:
        top = 2 * max((band[1] for band in bands), default=4 / trajectory.duration)
        frequency = np.linspace(top / 400, top, 800)
    if damping is None:
        damping = asked[0].damping if asked else 0.0
    stroke = float(np.max(np.abs(trajectory.chain[0] - trajectory.chain[0][0]))) or 1.0
    axes = look.panels(1, 3.4)[0]
    left = np.maximum(residual(trajectory, frequency, damping) / stroke, 1e-9)
    axes.semilogy(frequency, left, color=COLOURS[0], linewidth=1.6)
    for band in bands:
        axes.axvspan(*band, color=SHADE, alpha=0.6, linewidth=0 if band[0] < band[1] else 3)
    if bands:
        note(axes, "shaded: asked to be quiet", "right", 7)
    axes.set_xlim(0.0, float(np.max(frequency)))
    axes.set_xlabel(f"natural frequency of the mode [Hz], damping ratio {damping:.3g}", fontsize=SMALL)
    axes.set_ylabel("amplitude left / stroke [1]", fontsize=SMALL)
    look.title(axes, solution.problem.title or "Residual vibration")
    return axes


def compare(
    solutions: Mapping[str, Solution] | Sequence[Solution],
    labels: Sequence[str] | None = None,
    *,
    dashed: Mapping[str, Solution] | None = None,
    title: str = "",
) -> Panels:
    """The same panels with several solutions, named in a legend by ``labels`` (by their titles where there are none);
    ``dashed`` ones take the same colours again.

    Raises NoSolution when one of them has no trajectory, ValueError when there is none at all or labels do not fit.
    """
    if not solutions:
        raise ValueError("needs at least one solution to compare")
    given = solutions if isinstance(solutions, Mapping) else _labelled(solutions, labels)
    solid = {label: _moved(solution) for label, solution in given.items()}
    second = {label: _moved(solution) for label, solution in (dashed or {}).items()}
    shown = [*solid.values(), *second.values()]
    present = {name for trajectory in shown for name in signal_names(trajectory)}
    names: list[str] = [name for name in (*DERIVATIVES, "force", "power", *_ELECTRICAL) if name in present]
    panels = _panels(names, shown[0])
    styles = ["solid"] if second else STYLES
    for axes, name in zip(panels, names, strict=True):
        for group, drawn in ((solid, styles), (second, [(0, (3, 1.2))])):
            looks = zip(cycle(COLOURS), cycle(drawn), _widths(len(group)), group.items(), strict=False)
            for colour, style, width, (label, trajectory) in looks:
                if name in signal_names(trajectory):
                    axes.plot(*curve(trajectory, name), color=colour, linestyle=style, linewidth=width, label=label)
        _finish(axes, name, shown)
    _legend(panels, len(solid), len(second))
    if title:
        look.title(panels[0], title, pad=SMALL)
    return panels


def _labelled(solutions: Sequence[Solution], labels: Sequence[str] | None) -> dict[str, Solution]:
    """Solutions by label; equal titles get numbers."""
    if labels is None:
        titles = [solution.problem.title or "trajectory" for solution in solutions]
        labels = [f"{k}: {t}" if titles.count(t) > 1 else t for k, t in enumerate(titles, start=1)]
    if len(labels) != len(solutions) or len(set(labels)) != len(labels):
        raise ValueError(f"needs as many different labels as solutions, got {len(labels)} for {len(solutions)}")
    return dict(zip(labels, solutions, strict=True))


def _widths(count: int) -> list[float]:
    """Line widths that fall, so that a curve shows behind another that coincides with it."""
    return [float(width) for width in np.linspace(1.4 + 0.4 * min(count - 1, 3), 1.4, count)]


def _legend(panels: Panels, solid: int, second: int) -> None:
    """The names below the panels; dashed ones, when there are as many, each under the solid one of its colour."""
    handles, labels = panels[0].get_legend_handles_labels()
    order = list(range(solid + second))
    if solid == second:
        order = [i + group * solid for i in range(solid) for group in (0, 1)]  # a legend fills its columns first
    panels.figure.legend([handles[i] for i in order], [labels[i] for i in order], loc="outside lower center",
                         ncols=min(solid, 4), frameon=False, fontsize=8)


def curve(trajectory: Trajectory, name: str) -> tuple[Floats, Floats]:
    """Times (s) and values (SI) of a signal, by the exact interpolant: jumps of the top derivative stay vertical.

    Where only the nodes mean something (Euler, friction that changes sign) those.
    """
    if name == "electrical_power":  # of all signals the only one that is no polynomial
        time, force = curve(trajectory, "force")
        return time, motor.power(trajectory.problem.load, force, np.interp(time, *curve(trajectory, "velocity")))
    signal = trajectory.signal(name)
    origin = trajectory.origin if name == "position" else 0.0
    if signal.points:
        trajectory = trajectory.cut(np.empty(0))
        signal = trajectory.signal(name)
    if not signal.pieces:
        return trajectory.time, signal.nodes + origin
    pieces = signal.rows
    count = 2 if signal.degree == 0 else int(np.clip(POINTS // trajectory.mesh.intervals, 2, 200))
    fractions = np.linspace(0.0, 1.0, count)
    n = signal.degree
    basis = np.array([comb(n, i) * fractions**i * (1 - fractions) ** (n - i) for i in range(n + 1)])
    time = trajectory.time[:-1, None] + np.diff(trajectory.time)[:, None] * fractions
    return time.ravel(), np.asarray((pieces.T @ basis).ravel() + origin)


def _moved(solution: Solution) -> Trajectory:
    if solution.trajectory is None:
        raise NoSolution(f"{solution.status.value}: {solution.message or solution.status.advice}")
    return solution.trajectory


def signal_names(trajectory: Trajectory) -> list[str]:
    """The panels that a trajectory fills, top first."""
    problem = trajectory.problem
    names: list[str] = [*DERIVATIVES[: trajectory.order + 1]]
    if problem.load.inertia is not None:
        limited = any(getattr(problem.limits, name) is not None for name in ("force", "envelope", "rms_force"))
        wanted = limited or any(term.minimize == "force" for term in problem.objective.terms)
        names += ["force", "power"] if wanted else ["power"]
        names += _ELECTRICAL if problem.load.motor else ()
    return names


def _panels(names: list[str], trajectory: Trajectory) -> Panels:
    """Empty stacked axes that share the time axis, with units in their labels."""
    kinds = units.kinds(trajectory.problem.rotary)
    panels = look.panels(len(names), 1.0 + 1.35 * len(names), share=True)
    for axes, name in zip(panels, names, strict=True):
        axes.set_ylabel(f"{kinds[name].name}\n[{pretty(kinds[name].unit)}]", fontsize=SMALL)
    panels[-1].set_xlabel("time [s]", fontsize=SMALL)
    panels.figure.align_ylabels(panels)
    return panels


def _sides(trajectory: Trajectory, name: str, time: Floats) -> list[Floats]:
    """The limits of a signal at times (s): of a force also what the torque-speed envelope leaves at that speed."""
    limit: Limit | None = trajectory.problem.limits.given.get(name)
    sides = [] if limit is None else [side for side in limit.at(time) if side is not None]
    envelope = trajectory.problem.limits.envelope
    if name == "force" and envelope is not None:
        speed = np.abs(np.interp(time, *curve(trajectory, "velocity")))
        left = np.interp(speed, envelope.speed, envelope.force)
        sides += [-left, left]
    return sides


def _finish(axes: Axes, name: str, trajectories: list[Trajectory]) -> None:
    """Limits, via states and axis ranges, once the curves are there."""
    lowest, highest = low, high = _reach(axes)
    room = (IN_VIEW - 1) * (high - low)
    drawn: dict[bytes, None] = {}
    far: list[float] = []
    for trajectory in trajectories:
        _mark_via(axes, name, trajectory)
        for time, values in limit_lines(trajectory, name):
            if (key := time.tobytes() + values.tobytes()) in drawn:
                continue
            drawn[key] = None
            axes.plot(time, values, color=GREY, linewidth=0.9, linestyle=DASHES, label="_limit", zorder=1.5)
            within = values[(values >= lowest - room) & (values <= highest + room)]
            low, high = min([low, *within]), max([high, *within])
            if not len(within):
                far.append(float(values[np.argmin(np.abs(values))]))
    margin = 0.06 * (high - low) or 0.06 * max(abs(high), 1.0)
    axes.set_ylim(low - margin, high + margin)
    axes.set_xlim(0.0, max(trajectory.duration for trajectory in trajectories))
    if far:
        unit = pretty(units.kinds(trajectories[0].problem.rotary)[name].unit)
        note(axes, f"limit off scale: {_numbers(far)} {unit}", "right", 7)


def _numbers(values: list[float]) -> str:
    """``±100`` or ``0.5, 5``."""
    if len(values) == 2 and values[0] == -values[1]:
        return f"±{abs(values[0]):.4g}"
    return ", ".join(f"{x:.4g}" for x in values)


def _reach(axes: Axes) -> tuple[float, float]:
    """The smallest and largest value of the curves."""
    values = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.lines])
    return float(values.min()), float(values.max())


def limit_lines(trajectory: Trajectory, name: str) -> list[tuple[Floats, Floats]]:
    """(time, value) of the lower and the upper limit, with every corner."""
    limit: Limit | None = trajectory.problem.limits.given.get(name)
    corners = () if limit is None else limit.breakpoints
    time = np.unique([0.0, *(t for t in corners if 0 < t < trajectory.duration), trajectory.duration])
    if name == "force" and trajectory.problem.limits.envelope is not None:
        time = np.unique([*time, *curve(trajectory, "velocity")[0]])
    return [(time, side) for side in _sides(trajectory, name, time)]


def _close(values: Floats, sides: list[Floats], relative: float) -> NDArray[np.bool_]:
    """Which samples lie at a limit, within a fraction of its size."""
    size = max(float(np.max(np.abs(side))) for side in sides) or 1.0
    return np.asarray(np.any([np.abs(values - side) <= relative * size for side in sides], axis=0))


def _shade(axes: Axes, time: Floats, marked: NDArray[np.bool_], shortest: float) -> None:
    """Mark stretches of ``shortest`` s or longer, over the height of the panel."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(int)))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        if time[end - 1] - time[first] >= shortest:
            axes.axvspan(time[first], time[end - 1], facecolor=SHADE, alpha=0.35, linewidth=0, zorder=0.5)


def _mark_arcs(panels: Panels, structure: Mapping[str, Any]) -> None:
    """Thin lines at the switch times of a motor's arcs, with their names in the panel of the current."""
    arcs = [arc for arc in structure.get("arcs", ()) if "name" in arc]
    if not arcs:
        return
    total = arcs[-1]["to"]
    named = next((axes for axes in panels if axes.get_ylabel().startswith("current")), panels[-1])
    for axes in panels:
        for arc in arcs[:-1]:
            axes.axvline(arc["to"], color=GREY, linewidth=0.6, linestyle=(0, (1, 2)), zorder=1.2)
    for arc in arcs:
        if arc["to"] - arc["from"] > 0.02 * total:
            middle = (arc["from"] + arc["to"]) / 2
            named.annotate(arc["name"], (middle, 1.0), (0, 2), xycoords=("data", "axes fraction"),
                           textcoords="offset points", ha="center", va="bottom", fontsize=7, color=GREY)  # fmt: skip


def _mark_via(axes: Axes, name: str, trajectory: Trajectory) -> None:
    """A ring at every value that a via state prescribes."""
    if name not in DERIVATIVES[:4]:
        return
    given: list[tuple[float, Any]] = [(via.time, getattr(via, name)) for via in trajectory.problem.move.via]
    points = [(time, value) for time, value in given if value is not None and value != FREE]
    if points:
        axes.plot(*zip(*points, strict=True), "o", color="black", markerfacecolor="white", markersize=5, label="_via")
