"""CODESYS SoftMotion cam as IEC 61131-3 text: an array of SMC_CAMXYVA and the MC_CAM_REF that points to it.

X is the master, a virtual one that advances one unit a second; Y the slave in mm, or degrees on a rotary axis;
V = dY/dX and A = d²Y/dX². Between the points the runtime builds polynomials of fifth degree. A move without
a jerk limit has two accelerations at a node, of which the table takes one: the verification finds what that costs.

CODESYS Online Help, SM3_Basic, MC_CAM_REF (byType 3) and "Generated Code"; SMC_CAMXYVA.
"""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from trajopt.export.formats import Format, from_technical, quintic, technical
from trajopt.export.points import Header, Points

_POINT: Final = re.compile(r"dX := ([^,]+), dY := ([^,]+), dV := ([^,]+), dA := ([^)]+)\)")


def lreal(value: float) -> str:
    """A literal of IEC 61131-3, 2.2.1: with a decimal point, also before an exponent."""
    text = repr(float(value) + 0.0)
    mantissa, _, exponent = text.partition("e")
    return f"{mantissa}{'' if '.' in mantissa else '.0'}" + (f"E{int(exponent)}" if exponent else "")


def write(points: Points, header: Header) -> bytes:
    name, count = header.name, len(points.time)
    slave = [[technical(x, header.rotary) for x in values] for values in points.values[:3]]
    rows = [
        "    (" + ", ".join(f"{key} := {lreal(x)}" for key, x in zip(("dX", "dY", "dV", "dA"), row, strict=True)) + ")"
        for row in zip(points.time, *slave, strict=True)
    ]
    start, end = lreal(points.time[0]), lreal(points.time[-1])
    lines = [
        f"(* trajopt {header.hash} *)",
        "{attribute 'linkalways'}",
        "VAR_GLOBAL",
        f"{name}_A: ARRAY[0..{count - 1}] OF SMC_CAMXYVA := [",
        ",\n".join(rows) + "];",
        f"{name}: MC_CAM_REF := (nElements := {count}, byType := 3, xStart := {start}, xEnd := {end}, "
        f"nTappets := 0, strCAMName := '{name}', pce := ADR({name}_A));",
        "END_VAR",
    ]
    return ("\n".join(lines) + "\n").encode()


def read(content: bytes, header: Header) -> Points:
    cells = np.array([[float(cell) for cell in match] for match in _POINT.findall(content.decode())])
    scale = from_technical(1.0, header.rotary)
    return Points(cells[:, 0], tuple(cells[:, i] * scale for i in (1, 2, 3)))


FORMAT: Final = Format("CODESYS cam", write, read, quintic, carries=2, most=32767)
