"""The trajectory as a table: a pandas frame in SI with units, and the CSV of it with 17 digits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from trajopt import units
from trajopt.problem import DERIVATIVES
from trajopt.trajectory import Trajectory

if TYPE_CHECKING:
    from trajopt.solution import Solution

SYMBOLS = {
    "time": "t",
    "position": "q",
    "velocity": "v",
    "acceleration": "a",
    "jerk": "j",
    "snap": "s",
    "force": "F",
    "power": "P",
    "current": "i",
    "voltage": "U",
    "electrical_power": "Pe",
}


def frame(trajectory: Trajectory) -> pd.DataFrame:
    """One row a node; see `trajopt.Solution.frame`."""
    columns = {"time": trajectory.time}
    for i, name in enumerate(DERIVATIVES[: trajectory.order + 1]):
        values = trajectory.chain[i]
        if i == trajectory.order:
            values = np.append(values, 0.0 if trajectory.scheme.terms == 1 else values[-1])
        columns[name] = values + trajectory.origin if i == 0 else values
    load = trajectory.problem.load
    if load.inertia is not None:
        for name in ("force", "power", *(("current", "voltage", "electrical_power") if load.motor else ())):
            signal = trajectory.signal(name)
            columns[name] = (
                signal.nodes if signal.nodes is not None else np.append(signal.pieces[0], signal.pieces[-1][-1])
            )
    table = pd.DataFrame(columns)
    kinds = units.kinds(trajectory.problem.rotary)
    table.attrs["units"] = {name: kinds[name].unit for name in columns}
    return table


def csv(solution: Solution) -> str:
    """The frame as CSV: units in the header, 17 digits, the problem's hash in a leading comment. Raises NoSolution."""
    table = solution.frame
    header = ",".join(f"{SYMBOLS[name]} [{unit}]" for name, unit in table.attrs["units"].items())
    lines = [f"# trajopt {solution.problem.hash}", header]
    lines += [",".join(f"{x:.17g}" for x in row) for row in table.to_numpy()]
    return "\n".join(lines) + "\n"
