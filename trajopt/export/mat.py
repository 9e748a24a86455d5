"""MATLAB: a structure with time for Simulink's From Workspace block, position, velocity and acceleration in SI.

``<axis>.time`` is a column of seconds, ``<axis>.signals.values`` a column a signal, ``.dimensions`` their number;
``<axis>_units`` names them. With "Interpolate data" the block draws straight lines through each signal.

MathWorks, Simulink, "Load Data Using the From Workspace Block", "Specify Structure Data for the From Workspace Block".
"""

from __future__ import annotations

import io
from typing import Final

import numpy as np

from trajopt import units
from trajopt.export.formats import Format, linear
from trajopt.export.points import Header, Points
from trajopt.problem import DERIVATIVES


def write(points: Points, header: Header) -> bytes:
    from scipy.io import savemat

    names = DERIVATIVES[: min(len(points.values), 3)]
    columns = np.stack(points.values[:3], axis=1)
    kinds = units.kinds(header.rotary)
    signals = {"values": columns, "dimensions": float(columns.shape[1]), "label": ", ".join(names)}
    variables = {
        header.name: {"time": points.time[:, None], "signals": signals},
        f"{header.name}_units": np.array([f"{name} [{kinds[name].unit}]" for name in names], dtype=object),
    }
    buffer = io.BytesIO()
    savemat(buffer, variables, oned_as="column")  # type: ignore[arg-type]  # takes files, too
    return buffer.getvalue()


def read(content: bytes, header: Header) -> Points:
    from scipy.io import loadmat

    structure = loadmat(io.BytesIO(content), simplify_cells=True)[header.name]  # type: ignore[arg-type]
    columns = np.atleast_2d(structure["signals"]["values"])
    return Points(np.asarray(structure["time"], dtype=float), tuple(np.ascontiguousarray(columns.T)))


FORMAT: Final = Format("MATLAB structure with time", write, read, linear, carries=2)
