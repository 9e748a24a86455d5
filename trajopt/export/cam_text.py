"""Cam tables as text, a line a point, master and slave: the dialects of CODESYS, SEW, Lenze and Technosoft.

The master is the time: a virtual master that advances one unit a second (Technosoft: one unit a cycle). The slave is in
mm, or degrees on a rotary axis (Technosoft: whole counts).

codesys     ``master TAB slave`` (CODESYS SoftMotion, cam editor, "Read Cam Data from ASCII Table").
sew         the number of points, then ``master TAB slave``; at most 16383 points; linear, cubic or spline, as
            configured (SEW-Eurodrive, MOVIRUN open, "Curve point tables").
lenze       ``x y // comment``, x ascending (Lenze, Global Drive Cam Loader, 4.2.1).
technosoft  ``x TAB y``, 32-bit integers, x equidistant by a power of two, at most 8192 points (Technosoft, EasyMotion
            Studio, "CAM Tables Edit").

Where the interpolation is a setting or is not published, straight lines are assumed; --interpolation says otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from trajopt.export.formats import Format, from_technical, linear, number, technical
from trajopt.export.points import Header, Points


def _rows(points: Points, header: Header) -> list[tuple[str, str]]:
    pairs = zip(points.time, points.position, strict=True)
    return [(number(t), number(technical(q, header.rotary))) for t, q in pairs]


def _lines(lines: Sequence[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode()


def codesys(points: Points, header: Header) -> bytes:
    return _lines(["\t".join(row) for row in _rows(points, header)])


def sew(points: Points, header: Header) -> bytes:
    return _lines([str(len(points.time)), *("\t".join(row) for row in _rows(points, header))])


def lenze(points: Points, header: Header) -> bytes:
    rows = enumerate(_rows(points, header), start=1)
    return _lines([f"{x} {y} // point {k}" for k, (x, y) in rows])


def technosoft(points: Points, header: Header) -> bytes:
    assert header.count is not None
    counts = np.round(points.position / header.count)
    return _lines([f"{k}\t{int(y)}" for k, y in enumerate(counts)])


def _read(lines: Sequence[str], master: float, slave: float) -> Points:
    cells = np.array([[float(cell) for cell in line.split("//")[0].split()] for line in lines])
    return Points(cells[:, 0] * master, (cells[:, 1] * slave,))


def read(content: bytes, header: Header) -> Points:
    return _read(content.decode().splitlines(), 1.0, from_technical(1.0, header.rotary))


def read_sew(content: bytes, header: Header) -> Points:
    count, *lines = content.decode().splitlines()
    if int(count) != len(lines):
        raise ValueError(f"{count} points announced, {len(lines)} there")
    return _read(lines, 1.0, from_technical(1.0, header.rotary))


def read_technosoft(content: bytes, header: Header) -> Points:
    assert header.cycle is not None and header.count is not None
    return _read(content.decode().splitlines(), header.cycle, header.count)


FORMATS: Final = {
    "codesys": Format("CODESYS cam text", codesys, read, linear, carries=0),
    "sew": Format("SEW curve points", sew, read_sew, linear, carries=0, most=16383),
    "lenze": Format("Lenze cam text", lenze, read, linear, carries=0),
    "technosoft": Format(
        "Technosoft cam text", technosoft, read_technosoft, linear, carries=0, equidistant=True, rounds=True,
        counts=True, most=8192,
    ),  # fmt: skip
}
