"""Beckhoff TwinCAT motion function as IEC 61131-3 text: an array of MC_MotionFunctionPoint.

The master is a virtual one that advances one unit a second; the slave is in mm, or degrees on a rotary axis; velocity,
acceleration and jerk are derivatives with respect to the master. Each point names the law up to the next one:
POLYNOM5_MM, the quintic from motion to motion, or POLYNOM3_VV, the cubic from velocity to velocity, where the
acceleration jumps at the nodes (moves without a jerk limit). Point indices count from 1 without gaps.

Beckhoff Infosys, TF5050 TwinCAT 3 NC Camming, MC_MotionFunctionPoint, MC_MotionFunctionType, MC_MotionPointType.
"""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from trajopt.export.cam_codesys import lreal
from trajopt.export.formats import Format, from_technical, smooth, technical
from trajopt.export.points import Header, Points

_KEYS: Final = ("MasterPos", "SlavePos", "SlaveVelo", "SlaveAcc", "SlaveJerk")
_LAWS: Final = {  # function and point type
    "cubic": ("MOTIONFUNCTYPE_POLYNOM3_VV", "MOTIONPOINTTYPE_VELOCITY"),
    "quintic": ("MOTIONFUNCTYPE_POLYNOM5_MM", "MOTIONPOINTTYPE_MOTION"),
}
_POINT: Final = re.compile(", ".join(rf"{key} := ([^,)]+)" for key in _KEYS))


def write(points: Points, header: Header) -> bytes:
    name, count = header.name, len(points.time)
    values = [*points.values[:4], np.zeros(count)][:4]
    slave = [[technical(x, header.rotary) for x in column] for column in values]
    function, kind = _LAWS[smooth(header.order)]
    rows = []
    for k, row in enumerate(zip(points.time, *slave, strict=True), start=1):
        numbers = ", ".join(f"{key} := {lreal(x)}" for key, x in zip(_KEYS, row, strict=True))
        rows.append(f"    (PointIndex := {k}, FunctionType := {function}, "
                    f"PointType := {kind}, RelIndexNextPoint := 1, {numbers})")  # fmt: skip
    lines = [
        f"(* trajopt {header.hash} *)",
        "VAR_GLOBAL",
        f"{name}: ARRAY[1..{count}] OF MC_MotionFunctionPoint := [",
        ",\n".join(rows) + "];",
        "END_VAR",
    ]
    return ("\n".join(lines) + "\n").encode()


def read(content: bytes, header: Header) -> Points:
    cells = np.array([[float(cell) for cell in match] for match in _POINT.findall(content.decode())])
    scale = from_technical(1.0, header.rotary)
    return Points(cells[:, 0], tuple(cells[:, i] * scale for i in (1, 2, 3)))


FORMAT: Final = Format("TwinCAT motion function", write, read, smooth, carries=2)
