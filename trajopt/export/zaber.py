"""Zaber PVT sequence as CSV: ``Time (s), axis Position (mm), axis Velocity (mm/s), Relative``.

A row is a point: the time that it takes from the one before, where it lies from there (Relative is 1), and its
velocity; the device joins them by cubic polynomials. Degrees on a rotary axis. The sequence starts where the axis
stands, at rest.

Zaber Motion Library, guides "Position Velocity Time (PVT)" and "PVT Sequence Generation", class PvtPoint ("time to take
to reach this point from the previous point"); software.zaber.com/motion-library.
"""

from __future__ import annotations

import csv
import io
from typing import Final

import numpy as np

from trajopt.export.formats import Format, cubic, from_technical, number, technical
from trajopt.export.points import Header, Points
from trajopt.mesh import Floats


def write(points: Points, header: Header) -> bytes:
    unit = "\u00b0" if header.rotary else "mm"
    rows = [["Time (s)", f"{header.name} Position ({unit})", f"{header.name} Velocity ({unit}/s)", "Relative"]]
    segments = zip(np.diff(points.time), np.diff(points.position), points.values[1][1:], strict=True)
    for step, way, velocity in segments:
        rows.append([number(step), *(number(technical(x, header.rotary)) for x in (way, velocity)), "1"])
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()


def read(content: bytes, header: Header) -> Points:
    rows = list(csv.reader(io.StringIO(content.decode())))[1:]
    cells = np.array([[float(cell) for cell in row[:3]] for row in rows]).reshape(-1, 3)
    scale = from_technical(1.0, header.rotary)
    return from_segments(cells[:, 0], cells[:, 1] * scale, cells[:, 2] * scale, header)


def from_segments(step: Floats, way: Floats, velocity: Floats, header: Header) -> Points:
    """The points of segments that start at rest at the origin: durations (s), ways and velocities at their ends."""
    position = header.origin + np.concatenate([[0.0], np.cumsum(way)])
    return Points(np.concatenate([[0.0], np.cumsum(step)]), (position, np.concatenate([[0.0], velocity])))


FORMAT: Final = Format("Zaber PVT", write, read, cubic, carries=1, rounds=True, at_rest=True)
