"""CSV in SI units: ``t [s], q [m], v [m/s], a [m/s^2], …`` with the problem's hash in a comment above.

The layout of trajectory.csv (RFC 4180 with a leading comment), a point every cycle or node; decimal points always. Only
numbers stand in it, so that no spreadsheet takes a cell for a formula. What reads it is not known: at a cycle, straight
lines between the points are assumed, at the nodes the polynomials that the derivatives beside them determine.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from trajopt import units
from trajopt.export.formats import Format, number, smooth
from trajopt.export.points import Header, Points
from trajopt.problem import DERIVATIVES
from trajopt.table import SYMBOLS


def write(points: Points, header: Header) -> bytes:
    kinds = units.kinds(header.rotary)
    names = ("time", *DERIVATIVES[: len(points.values)])
    lines = [f"# trajopt {header.hash}", ",".join(f"{SYMBOLS[name]} [{kinds[name].unit}]" for name in names)]
    lines += [",".join(map(number, row)) for row in zip(points.time, *points.values, strict=True)]
    return ("\n".join(lines) + "\n").encode()


def read(content: bytes, header: Header) -> Points:
    lines = [line for line in content.decode().splitlines() if not line.startswith("#")]
    columns = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]]).T
    return Points(columns[0], tuple(columns[1:]))


def assumed(order: int, cyclic: bool) -> str:
    """The interpolation of a reader of set-points, or of one that knows the derivatives."""
    return "linear" if cyclic else smooth(order)


FORMAT: Final = Format("CSV", write, read, assumed, carries=4, rounds=True)
