"""Newport XPS PVT trajectory: a line a segment, ``duration, displacement, velocity at its end``, no header.

Displacements are relative, the velocity of the last line is zero, and the controller joins the points by cubic
polynomials. Seconds, and the units of the stage: mm, degrees on a rotary one.

Newport, XPS Controller, Features Manual, "PVT Trajectories" (MultipleAxesPVTExecution).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from trajopt.export.formats import Format, cubic, from_technical, number, technical
from trajopt.export.points import Header, Points
from trajopt.export.zaber import from_segments


def write(points: Points, header: Header) -> bytes:
    segments = zip(np.diff(points.time), np.diff(points.position), points.values[1][1:], strict=True)
    lines = []
    for step, way, velocity in segments:
        lines.append(", ".join([number(step), *(number(technical(x, header.rotary)) for x in (way, velocity))]))
    return ("\n".join(lines) + "\n").encode()


def read(content: bytes, header: Header) -> Points:
    cells = np.array([[float(cell) for cell in line.split(",")] for line in content.decode().splitlines()])
    scale = from_technical(1.0, header.rotary)
    return from_segments(cells[:, 0], cells[:, 1] * scale, cells[:, 2] * scale, header)


FORMAT: Final = Format("Newport XPS PVT", write, read, cubic, carries=1, at_rest=True)
