"""A front to explore in a browser: a slider or a click on a point shows its move, its prices and the limits at once.

Everything is in the page (plotly's own script as well), taken from stored points: no server, no kernel, no network.
"""

from __future__ import annotations

import html
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from trajopt import units
from trajopt.errors import MissingPackage
from trajopt.files import write_atomically
from trajopt.plots.look import COLOURS, pretty
from trajopt.plots.trajectories import curve, limit_lines, signal_names
from trajopt.prices import sentence

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

    from trajopt.fronts.front import Front, Point
    from trajopt.trajectory import Trajectory

_SAMPLES: Final = 400  # of a curve
_HEIGHT: Final = 860  # pixels
_IN_VIEW: Final = 1.5  # times the largest value of any point: limits beyond are not drawn
_CURRENT: Final = 1  # trace of the marker of the point that is shown; those of the move follow
_CLICK: Final = """
const page = document.getElementById('{plot_id}');
const show = k => { const step = page.layout.sliders[0].steps[k];
  Plotly.update(page, step.args[0], {...step.args[1], 'sliders[0].active': k}, step.args[2]); };
page.on('plotly_click', event => { const point = event.points[0];
  if (point.curveNumber === 0) show(point.pointNumber); });
"""


@dataclass(frozen=True)
class Explorer:
    """A page; a notebook shows it, `save` writes it."""

    page: str

    def save(self, path: str | Path) -> Path:
        """Write the page, which needs nothing else; returns the path. Raises OSError."""
        write_atomically(Path(path), self.page.encode())
        return Path(path)

    def _repr_html_(self) -> str:
        """In a frame of its own, so that no other script of the page meddles."""
        source = html.escape(self.page, quote=True)
        return f'<iframe srcdoc="{source}" scrolling="no" style="width:100%;height:{_HEIGHT + 40}px;border:0"></iframe>'


def explore(front: Front) -> Explorer:
    """The page of a front. Raises ValueError for a front without points, MissingPackage without plotly."""
    if not front.points:
        raise ValueError("a front without points cannot be explored")
    try:
        import plotly.graph_objects  # noqa: F401
    except ModuleNotFoundError:
        raise MissingPackage("exploring a front needs plotly: pip install 'trajopt[notebooks]'") from None
    made = _figure(front)
    return Explorer(made.to_html(include_plotlyjs=True, post_script=_CLICK, default_height=f"{_HEIGHT}px"))


def _figure(front: Front) -> Figure:
    from plotly.subplots import make_subplots

    moves = [_move(point) for point in front.points]
    names = signal_names(moves[0])
    rows = len(names)
    specs: list[list[Any]] = [[{"rowspan": rows}, {}], *([[None, {}]] * (rows - 1))]
    figure = make_subplots(rows, 2, specs=specs, column_widths=[0.4, 0.6], vertical_spacing=0.025,
                           horizontal_spacing=0.1, shared_xaxes=True)  # fmt: skip
    first = front.knee or 0
    _draw_front(figure, front, first)
    kinds = units.kinds(front.problem.rotary)
    for k, name in enumerate(names):
        x, y = _sampled(moves[first], name)
        line = {"color": COLOURS[0], "width": 2}
        figure.add_scatter(x=x, y=y, mode="lines", line=line, name=kinds[name].name, row=k + 1, col=2)
        label = f"{kinds[name].name}<br>[{pretty(kinds[name].unit)}]"
        figure.update_yaxes(title={"text": label, "font": {"size": 11}}, row=k + 1, col=2)
    for k, name in enumerate(names):
        _draw_limits(figure, moves, name, k + 1)
    figure.update_xaxes(title="time [s]", row=rows, col=2)
    steps = [_step(front, k, [_sampled(moves[k], name) for name in names]) for k in range(len(moves))]
    slider = {"active": first, "steps": steps, "len": 0.38, "pad": {"t": 50}, "currentvalue": {"prefix": "point "}}
    words = {"text": _words(front, first), "xref": "paper", "yref": "paper", "x": 0.0, "y": 1.01, "xanchor": "left",
             "yanchor": "bottom", "showarrow": False, "align": "left", "font": {"size": 12}}  # fmt: skip
    figure.update_layout(
        title={"text": front.problem.title or "Pareto front", "y": 0.98}, sliders=[slider], annotations=[words],
        showlegend=False, template="simple_white", height=_HEIGHT, margin={"t": 170, "b": 90, "r": 20},
    )  # fmt: skip
    return figure


def _move(point: Point) -> Trajectory:
    assert point.solution.trajectory is not None
    return point.solution.trajectory


def _sampled(move: Trajectory, name: str) -> tuple[list[float], list[float]]:
    """A curve at all its corners where they are few, else thinned out; six digits are more than a screen shows."""
    time, values = curve(move, name)
    kept = np.unique(np.linspace(0, len(time) - 1, min(len(time), _SAMPLES)).astype(int))
    return tuple([float(f"{x:.6g}") for x in found[kept]] for found in (time, values))  # type: ignore[return-value]


def _draw_front(figure: Figure, front: Front, first: int) -> None:
    values = front.values
    labels = [f"{name} [{unit}]" for name, unit in zip(front.names, front.units, strict=True)]
    marker: dict[str, Any] = {"color": COLOURS[0], "size": 8}
    if len(front.terms) > 2:
        marker |= {"color": values[:, 2], "colorscale": "Cividis", "showscale": True,
                   "colorbar": {"title": labels[2], "orientation": "h", "len": 0.4, "x": 0.2, "y": -0.12}}  # fmt: skip
    mode = "lines+markers" if len(front.terms) == 2 else "markers"
    figure.add_scatter(x=values[:, 0], y=values[:, 1], mode=mode, marker=marker, line={"width": 1},
                       name="checked moves", row=1, col=1)  # fmt: skip
    here = {"color": "rgba(0,0,0,0)", "size": 16, "line": {"color": COLOURS[1], "width": 3}}
    figure.add_scatter(x=values[[first], 0], y=values[[first], 1], mode="markers", marker=here, hoverinfo="skip",
                       row=1, col=1)  # fmt: skip
    figure.update_xaxes(title=labels[0], row=1, col=1)
    figure.update_yaxes(title=labels[1], row=1, col=1)


def _draw_limits(figure: Figure, moves: list[Trajectory], name: str, row: int) -> None:
    """The limits of a signal, dashed, where they are in view of any of the moves."""
    reach = max(float(np.max(np.abs(curve(move, name)[1]))) for move in moves)
    dashed = {"color": "grey", "width": 1, "dash": "dash"}
    for time, values in limit_lines(moves[0], name):
        if np.max(np.abs(values)) <= _IN_VIEW * reach:
            figure.add_scatter(x=time, y=values, mode="lines", line=dashed, name="limit", row=row, col=2)


def _step(front: Front, k: int, curves: list[tuple[list[float], list[float]]]) -> dict[str, Any]:
    """What the slider changes for a point: the marker, the curves, and the words."""
    here = front.points[k].values
    x, y = [[here[0]], *(time for time, _ in curves)], [[here[1]], *(values for _, values in curves)]
    traces = list(range(_CURRENT, _CURRENT + len(x)))
    return {"method": "update", "label": str(k + 1), "args": [{"x": x, "y": y}, _words_of(front, k), traces]}


def _words_of(front: Front, k: int) -> dict[str, Any]:
    return {"annotations[0].text": _words(front, k)}


def _words(front: Front, k: int) -> str:
    """The point in words: its objectives, what trading them costs here, its verdict, and its dearest limits."""
    point, solution = front.points[k], front.points[k].solution
    lines = [
        f"<b>{name} {value:.5g} {unit}</b>"
        for name, value, unit in zip(front.names, point.values, front.units, strict=True)
    ]
    for name, unit, price in zip(front.names[1:], front.units[1:], point.prices, strict=True):
        if price is not None:
            lines.append(f"one more {front.units[0]} of {front.names[0]} saves {price:.3g} {unit} of {name}")
    gap = solution.certificate.get("gap")
    lines.append(solution.status.value + ("" if gap is None else f", at most {100 * gap:.2g} % to gain"))
    for row in [row for row in solution.prices if row["per_unit"]][:3]:
        lines.append(sentence(row, front.problem.shown(row["name"]), "of the weighted sum"))
    return "<br>".join(lines)
