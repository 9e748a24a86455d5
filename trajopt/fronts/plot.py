"""Figures of a Pareto front: its points between what is certified from outside and what is achieved from inside."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trajopt.fronts.front import outside
from trajopt.mesh import Floats
from trajopt.plots.look import COLOURS, GREY, SHADE, dress

if TYPE_CHECKING:
    from trajopt.fronts.front import Front

_SAMPLES: Final = 600
_MARGIN: Final = 0.06


def plot_front(front: Front, reference: Any = None) -> Axes:
    """Two objectives: the points, the certified band, anchors and knee, SI below and left, relative to the least above
    and right; beneath, where an error is known, how wide the band is. Three: every pair of them side by side.

    ``reference``: (n, 2) values in SI of another front, for comparison. Raises ValueError for a front without points.
    """
    if not front.points:
        raise ValueError("a front without points cannot be drawn")
    return _two(front, reference) if len(front.terms) == 2 else _three(front)


def _two(front: Front, reference: Any) -> Axes:
    known = front.error is not None
    figure = Figure(figsize=(7.0, 5.8 if known else 4.8), layout="constrained", facecolor="white")
    panels: list[Axes] = figure.subplots(
        1 + known, 1, sharex=True, squeeze=False, height_ratios=[5, 1][: 1 + known]
    )[:, 0].tolist()
    axes = panels[0]
    _pair(front, axes, 0, 1)
    _band(front, axes)
    for strip in panels[1:]:
        _strip(front, strip)
        strip.set_xlabel(axes.get_xlabel(), fontsize=9)
        axes.set_xlabel("")
    if reference is not None:
        x, y = np.asarray(reference, dtype=float).T
        axes.plot(x, y, "+", color=COLOURS[1], markersize=7, label="reference", zorder=4)
    _second_axes(front, axes)
    axes.legend(frameon=False, fontsize=8, loc="upper right")
    _title(front, axes)
    return axes


def _three(front: Front) -> Axes:
    figure = Figure(figsize=(11.0, 4.0), layout="constrained", facecolor="white")
    panels: list[Axes] = figure.subplots(1, 3).tolist()
    for axes, (i, j) in zip(panels, ((0, 1), (0, 2), (1, 2)), strict=True):
        _pair(front, axes, i, j)
    panels[0].legend(frameon=False, fontsize=8, loc="upper right")
    _title(front, panels[0])
    return panels[0]


def _title(front: Front, axes: Axes) -> None:
    name = front.problem.title or "Pareto front"
    known = "" if front.error is None else f"known within {100 * front.error:.2g} % of the ranges, certified"
    pad = 36 if len(front.terms) == 2 else 20
    axes.set_title(name, loc="left", fontsize=11, fontweight="bold", pad=pad)
    axes.annotate(known, (0.0, 1.0), (0, pad - 12), xycoords="axes fraction", textcoords="offset points",
                  fontsize=8, color=GREY)  # fmt: skip


def _pair(front: Front, axes: Axes, i: int, j: int) -> None:
    """The points in two objectives, with anchors and knee marked."""
    values = front.values
    axes.plot(values[:, i], values[:, j], "o", color=COLOURS[0], markersize=4, label="checked move", zorder=3)
    ends = values[list(front.anchors)]
    axes.plot(ends[:, i], ends[:, j], "s", color="black", markersize=7, markerfacecolor="white", label="anchor",
              zorder=3.5)  # fmt: skip
    if front.knee is not None:
        knee = values[front.knee]
        axes.plot(knee[i], knee[j], "D", color=COLOURS[1], markersize=8, markerfacecolor="none", label="knee", zorder=4)
        text = ", ".join(f"{knee[k]:.4g} {front.units[k]}" for k in (i, j))
        if len(front.terms) == 2:  # else it would lie among points
            axes.annotate(text, (knee[i], knee[j]), (9, 7), textcoords="offset points", fontsize=8, color=GREY)
    for k, label in ((i, axes.set_xlabel), (j, axes.set_ylabel)):
        unit = "" if front.units[k] == "1" else f" [{front.units[k]}]"
        label(f"{front.names[k]}{unit}", fontsize=9)
    dress(axes)


def _band(front: Front, axes: Axes) -> None:
    """What lies between the outer bounds and the achieved moves."""
    low, high = np.array(front.ideal), np.array(front.nadir)
    room = _MARGIN * np.where(high > low, high - low, np.abs(high))
    x = np.linspace(low[0], high[0], _SAMPLES)
    outer, inner = _outer(front, x), _inner(front, front.values, x)
    known = np.isfinite(outer)
    if np.any(known):
        axes.fill_between(x[known], outer[known], np.maximum(inner, outer)[known], color=SHADE, linewidth=0,
                          label="certified band", zorder=1)  # fmt: skip
        axes.plot(x[known], outer[known], color=GREY, linewidth=0.9, linestyle=(0, (6, 3)),
                  label="no move is below", zorder=1.5)  # fmt: skip
    axes.plot(x, inner, color=COLOURS[0], linewidth=1.2, zorder=2)
    axes.set_xlim(low[0] - room[0], high[0] + room[0])
    axes.set_ylim(low[1] - room[1], high[1] + room[1])


def _strip(front: Front, axes: Axes) -> None:
    """How much better than what is achieved a move could be, in every objective, per cent of the ranges."""
    beyond, points = outside(front.planes, front.corners, front.ideal, front.nadir), front.normalised
    x = np.unique(np.concatenate([points[:, 0], np.linspace(0.0, 1.0, _SAMPLES)]))
    achieved = zip(x, _inner(front, points, x), strict=True)
    depth = [100 * max(beyond.depth(np.array(place)), 0.0) for place in achieved]
    low, high = front.ideal[0], front.nadir[0]
    axes.fill_between(low + (high - low) * x, depth, color=SHADE, edgecolor=GREY, linewidth=0.7)
    axes.set_ylim(0.0, 1.25 * 100 * max(front.error or 0.0, 1e-6))
    if front.asked is not None:
        axes.axhline(100 * front.asked, color=GREY, linewidth=0.9, linestyle=(0, (6, 3)))
    axes.set_ylabel("gap at most\n[%]", fontsize=8)
    dress(axes)


def _inner(front: Front, points: Floats, x: Floats) -> Floats:
    """What is achieved at ``x``: between neighbours by mixing them or, where that means nothing, by the one before."""
    if front.convex or front.blends:
        return np.interp(x, *points.T)
    held: Floats = points[np.maximum(np.searchsorted(points[:, 0], x, side="right") - 1, 0), 1]
    return held


def _outer(front: Front, x: Floats) -> Floats:
    """The least second objective that any move can have where the first is ``x``; nan where no bound is known."""
    bound = np.full(len(x), -np.inf)
    for plane in front.planes:
        if plane.weights[1] > 0:
            bound = np.maximum(bound, (plane.value - plane.weights[0] * x) / plane.weights[1])
    for corner in front.corners:
        bound = np.where(x <= corner[0], np.maximum(bound, corner[1]), bound)
    return np.where(np.isfinite(bound), bound, np.nan)


def _second_axes(front: Front, axes: Axes) -> None:
    """Relative to the least values, above and on the right, as in Fig. 7 of Clemen & Rupp."""
    best = front.ideal
    if min(best) <= 0:
        return
    sides = (axes.secondary_xaxis("top", functions=_by(best[0])), axes.secondary_yaxis("right", functions=_by(best[1])))
    for side, name in zip(sides, front.names, strict=True):
        side.tick_params(labelsize=8, color=GREY)
        side.spines[:].set_color(GREY)
        (side.set_xlabel if side is sides[0] else side.set_ylabel)(f"{name} / least", fontsize=8, color=GREY)
    sides[0].xaxis.label.set_horizontalalignment("left")  # clear of the line under the title


def _by(size: float) -> Any:
    return (lambda value: value / size), (lambda value: value * size)
