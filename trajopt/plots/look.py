"""One look for every figure: colours, line styles, axes, titles and small print.

Okabe-Ito colours, which colour-blind readers tell apart and printers keep; where curves share a panel, also line
styles, for greyscale; bars of two kinds by hatching. Limits are thin grey dashes; stretches on which a limit is active
are shaded.
"""

from __future__ import annotations

import io
import textwrap
from typing import Any, Final, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")  # Okabe-Ito
STYLES: Final[tuple[Any, ...]] = (
    "solid", (0, (5, 1.5)), (0, (1.2, 1)), (0, (6, 1.2, 1.2, 1.2)), (0, (2.5, 1)), (0, (5, 1, 1, 1, 1, 1)), (0, (9, 2)),
)  # fmt: skip
SHADE: Final = "#F0E442"  # the yellow of Okabe-Ito: too light for a line
GREY: Final = "0.35"
DASHES: Final = (0, (6, 3))  # of a limit
WIDTH: Final = 7.0  # inches, of every figure
SMALL: Final = 8  # points: labels and ticks


class Panels(list[Axes]):
    """The axes, top panel first. A notebook shows their figure."""

    @property
    def figure(self) -> Figure:
        """The figure they belong to."""
        figure = self[0].figure
        assert isinstance(figure, Figure)
        return figure

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.figure.savefig(buffer, format="png", dpi=110)
        return buffer.getvalue()


def panels(count: int, height: float, *, share: bool = False) -> Panels:
    """``count`` dressed axes under each other in a new figure of a ``height`` in inches, with one time axis or not."""
    figure = Figure(figsize=(WIDTH, height), layout=ConstrainedLayoutEngine(w_pad=0.08), facecolor="white")
    made = Panels(figure.subplots(count, 1, sharex=share, squeeze=False)[:, 0])
    for axes in made:
        dress(axes)
    return made


def dress(axes: Axes) -> None:
    """Ticks, spines and grid of the house."""
    axes.tick_params(labelsize=SMALL, color=GREY)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(GREY)
    axes.grid(color="0.92", linewidth=0.7)
    axes.set_axisbelow(True)


def title(axes: Axes, text: str, pad: float = 6) -> None:
    """A bold title at the left, wrapped."""
    wrapped = "\n".join(textwrap.wrap(text, 64))
    axes.set_title(wrapped, loc="left", fontsize=11, fontweight="bold", pad=pad)


def note(axes: Axes, text: str, side: Literal["left", "right"], size: float) -> None:
    """A line of small print above a panel."""
    x = 0.0 if side == "left" else 1.0
    axes.annotate(text, (x, 1.0), (0, 3), xycoords="axes fraction", textcoords="offset points", ha=side, va="bottom",
                  fontsize=size, color=GREY)


def pretty(text: str) -> str:
    """Powers as superscripts, underscores as spaces."""
    return text.replace("^2", "²").replace("^3", "³").replace("^4", "⁴").replace("_", " ")
