"""Cyclic set-points of a CiA 402 drive in cyclic synchronous position mode: whole counts, one line a bus cycle.

``cycle, 0x607A target position [counts], 0x60B1 velocity offset [counts/s]``: INTEGER32 both, the second for a drive
that takes a feed-forward. Between set-points the drive draws straight lines (0x60C0 = 0), some draw cubics (-2): then
--interpolation spline. What it sees of velocity, acceleration and jerk are differences of counts.

CiA 402-2 / IEC 61800-7-201, objects 0x607A, 0x60B1, 0x60C0, 0x60C2.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from trajopt.export.formats import Format, linear
from trajopt.export.points import Header, Points


def write(points: Points, header: Header) -> bytes:
    assert header.count is not None
    position, velocity = (np.round(values / header.count) for values in points.values[:2])
    lines = ["cycle,0x607A target position [counts],0x60B1 velocity offset [counts/s]"]
    lines += [f"{k},{int(q)},{int(v)}" for k, (q, v) in enumerate(zip(position, velocity, strict=True))]
    return ("\n".join(lines) + "\n").encode()


def read(content: bytes, header: Header) -> Points:
    assert header.count is not None and header.cycle is not None
    cells = np.array([[int(cell) for cell in line.split(",")] for line in content.decode().splitlines()[1:]])
    return Points(cells[:, 0] * header.cycle, (cells[:, 1] * header.count, cells[:, 2] * header.count))


FORMAT: Final = Format("CiA 402 set-points", write, read, linear, carries=1, equidistant=True, rounds=True, counts=True)
