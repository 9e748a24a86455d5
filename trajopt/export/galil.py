"""Galil PVT commands: ``PVA=counts,counts/s,samples`` a segment, ended by ``PVA=0,0,0``, started by ``BTA``.

Positions are relative, in whole encoder counts; velocities at the ends of the segments in whole counts a second; times
in samples, of which 1024 make a second at the default TM 1000. The controller joins the points by cubic polynomials. A
segment of time is never zero, so that none but the last line reads as the end.

Galil, DMC-40x0 User Manual, chapter 6, "PVT Mode".
"""

from __future__ import annotations

from typing import Final

import numpy as np

from trajopt.export.formats import Format, cubic
from trajopt.export.points import Header, Points
from trajopt.export.zaber import from_segments

SAMPLE: Final = 1 / 1024  # s
_END: Final = "PVA=0,0,0"


def write(points: Points, header: Header) -> bytes:
    assert header.count is not None
    counts = np.round((points.position - header.origin) / header.count)
    velocity = np.round(points.values[1] / header.count)
    samples = np.round(points.time / SAMPLE)
    segments = zip(np.diff(counts), velocity[1:], np.diff(samples), strict=True)
    lines = [f"PVA={int(way)},{int(end)},{int(step)}" for way, end, step in segments]
    return ("\n".join([*lines, _END, "BTA"]) + "\n").encode()


def read(content: bytes, header: Header) -> Points:
    assert header.count is not None
    lines = content.decode().splitlines()
    commands = lines[: lines.index(_END)]
    cells = np.array([[int(cell) for cell in line.removeprefix("PVA=").split(",")] for line in commands], dtype=float)
    return from_segments(cells[:, 2] * SAMPLE, cells[:, 0] * header.count, cells[:, 1] * header.count, header)


FORMAT: Final = Format("Galil PVT", write, read, cubic, carries=1, tick=SAMPLE, rounds=True, counts=True, at_rest=True)
