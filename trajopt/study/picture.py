"""The picture of a study: what came of the cases over what was varied, one curve a series, one panel a quantity and
group; crosses where there is no move."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from trajopt.plots.look import COLOURS, GREY, SMALL, STYLES, dress, pretty
from trajopt.study.plan import Plan, Plot

_MARKERS: Final = "os^Dv<>"
_DECADE: Final = 30.0  # a range wider than this is shown on a logarithmic scale
_NONE: Final = "no move"


def picture(plan: Plan, table: pd.DataFrame) -> bytes:
    """The PNG of the plot that the plan asks for."""
    assert plan.plot is not None
    buffer = io.BytesIO()
    figure(plan.plot, table, plan.title).savefig(buffer, format="png", dpi=150)
    return buffer.getvalue()


def figure(plot: Plot, table: pd.DataFrame, title: str) -> Figure:
    """Rows of panels by ``plot.y``, columns by the values of ``plot.panels``."""
    groups = list(_groups(table, plot.panels))
    size = (1.2 + 2.9 * len(groups), 1.3 + 2.2 * len(plot.y))
    drawn = Figure(figsize=(max(size[0], 5.0), size[1]), layout="constrained", facecolor="white")
    grid = drawn.subplots(len(plot.y), len(groups), sharex=True, sharey="row", squeeze=False)
    for axes_row, y in zip(grid, plot.y, strict=True):
        for axes, (_, rows) in zip(axes_row, groups, strict=True):
            _draw(axes, plot, rows, y, table)
        _scale(axes_row[0], table, y)
        axes_row[0].set_ylabel(_words(_heading(table, y)), fontsize=SMALL)
    for top, bottom, (label, _) in zip(grid[0], grid[-1], groups, strict=True):
        top.set_title(label, fontsize=9, loc="left")
        bottom.set_xlabel(_words(_heading(table, plot.x)), fontsize=SMALL)
    _legend(drawn, grid[0][0])
    drawn.suptitle(title or "Study", x=0.01, ha="left", fontsize=11, fontweight="bold")
    return drawn


def _draw(axes: Axes, plot: Plot, rows: pd.DataFrame, y: str, table: pd.DataFrame) -> None:
    """The curves of one panel."""
    abscissa = _heading(table, plot.x)
    for i, (label, curve) in enumerate(_groups(table, plot.series)):
        here = curve.loc[curve.index.intersection(rows.index)].sort_values(abscissa)
        style: dict[str, Any] = {"color": COLOURS[i % len(COLOURS)], "marker": _MARKERS[i % len(_MARKERS)]}
        values = _values(here, y)
        axes.plot(here[abscissa], values, markersize=4, linewidth=1.4, linestyle=STYLES[i % len(STYLES)],
                  label=label or None, **style)  # fmt: skip
    missing = rows.loc[~np.isfinite(_values(rows, y)), abscissa].drop_duplicates()
    axes.plot(missing, np.full(len(missing), 0.03), "x", color=GREY, markersize=5, transform=axes.get_xaxis_transform(),
              label=_NONE)  # fmt: skip
    dress(axes)


def _values(rows: pd.DataFrame, y: str) -> Any:
    heading = _heading(rows, y)
    return rows[heading].to_numpy(float) if heading in rows else np.full(len(rows), np.nan)


def _scale(axes: Axes, table: pd.DataFrame, y: str) -> None:
    """From zero, or logarithmic where small and large would not show together."""
    values = _values(table, y)
    values = values[np.isfinite(values)]
    if not len(values):
        axes.text(0.5, 0.5, f"no case has {y}", ha="center", transform=axes.transAxes, fontsize=SMALL)
    elif values.min() > 0 and values.max() > _DECADE * values.min():
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
    elif values.min() >= 0:
        axes.set_ylim(bottom=0.0)


def _groups(table: pd.DataFrame, name: str | None) -> Iterator[tuple[str, pd.DataFrame]]:
    """The rows by the values of a column, in the order of the table, with what to call them."""
    if name is None:
        yield "", table
        return
    heading = _heading(table, name)
    for value, rows in table.groupby(heading, sort=False, dropna=False):
        yield _value(heading, value), rows


def _value(heading: str, value: Any) -> str:
    """``norm linf``, ``position 0.25 m``: the last part of the key, and the value with its unit."""
    name, _, unit = _words(heading).partition(" [")
    last = name.rpartition(".")[2]
    shown = f"{value:g}" if isinstance(value, int | float | np.number) else str(value)
    return " ".join(f"{last} {shown} {unit.removesuffix(']')}".split())


def _heading(table: pd.DataFrame, name: str) -> str:
    """The heading of a column that is named without its unit."""
    return next((h for h in map(str, table.columns) if h == name or h.startswith(f"{name} [")), name)


def _words(heading: str) -> str:
    """A heading for people: ``RMS force [N]``, ``peak torque [N m]``."""
    words = pretty(heading).replace("rms ", "RMS ")
    return words.replace("force", "torque") if "[N m]" in heading else words


def _legend(drawn: Figure, axes: Axes) -> None:
    handles = {label: handle for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    for other in drawn.axes:
        if any(line.get_label() == _NONE and len(np.atleast_1d(line.get_xdata())) for line in other.lines):
            break
    else:
        handles.pop(_NONE, None)
    if handles:
        drawn.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=min(len(handles), 5),
                     frameon=False, fontsize=SMALL)  # fmt: skip
