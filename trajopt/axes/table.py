"""A motion as a table: a pandas frame in SI with units, one row a node."""

from __future__ import annotations

import numpy as np
import pandas as pd

from trajopt import table, units
from trajopt.axes.motion import Motion
from trajopt.mesh import Floats
from trajopt.trajectory import Trajectory

_TIP = {"x": "m", "y": "m", "vx": "m/s", "vy": "m/s"}


def frame(motion: Motion) -> pd.DataFrame:
    """One row a node of any axis; see `trajopt.axes.solution.AxesSolution.frame`."""
    time = np.unique(np.concatenate([axis.time for axis in motion.axes]))
    columns, named = {"time": time}, {"time": "s"}
    for axis, stated in zip(motion.axes, motion.problem.axes, strict=True):
        kinds = units.kinds(axis.problem.rotary)
        for key, values in _columns(axis, time).items():
            columns[f"{stated.name}.{key}"], named[f"{stated.name}.{key}"] = values, kinds[key].unit
    if motion.problem.reaches:
        columns |= {f"tip.{key}": values for key, values in motion.tip(time).items()}
        named |= {f"tip.{key}": unit for key, unit in _TIP.items()}
    found = pd.DataFrame(columns)
    found.attrs["units"] = named
    return found


def _columns(axis: Trajectory, time: Floats) -> dict[str, Floats]:
    """The columns of one axis at times (s): those of its own table where they are its nodes."""
    if len(time) == len(axis.time):
        own = table.frame(axis)
        return {str(key): own[key].to_numpy() for key in own.columns if key != "time"}
    from trajopt.plots.trajectories import curve

    within = np.minimum(time, axis.duration)
    found = axis.at(within)
    if axis.problem.load.inertia is not None:
        found |= {name: np.interp(within, *curve(axis, name)) for name in ("force", "power")}
    return found
