"""A motion as a table: a pandas frame in SI with units, one row a node."""

from __future__ import annotations

import numpy as np
import pandas as pd

from trajopt import units
from trajopt.axes.motion import Motion
from trajopt.mesh import Floats
from trajopt.trajectory import Trajectory

_TIP = {"x": "m", "y": "m", "vx": "m/s", "vy": "m/s"}


def frame(motion: Motion) -> pd.DataFrame:
    """One row a node of any axis; see `trajopt.axes.solution.AxesSolution.frame`."""
    time = np.unique(np.concatenate([axis.time for axis in motion.axes]))
    columns, named = {"time": time}, {"time": "s"}
    for axis, (name, values) in zip(motion.axes, motion.at(time).items(), strict=True):
        kinds = units.kinds(axis.problem.rotary)
        found = dict(values)
        if axis.problem.load.inertia is not None:
            found |= {key: sampled(axis, key, time) for key in ("force", "power")}
        columns |= {f"{name}.{key}": x for key, x in found.items()}
        named |= {f"{name}.{key}": kinds[key].unit for key in found}
    if motion.problem.reaches:
        columns |= {f"tip.{key}": x for key, x in motion.tip(time).items()}
        named |= {f"tip.{key}": unit for key, unit in _TIP.items()}
    table = pd.DataFrame(columns)
    table.attrs["units"] = named
    return table


def sampled(axis: Trajectory, name: str, time: Floats) -> Floats:
    """A quantity of an axis at times (s): at nodes as it is there, between them on its polynomial (Euler: a line)."""
    from trajopt.plot import curve

    signal = axis.signal(name)
    if signal.nodes is not None and len(time) == len(axis.time) and np.all(time == axis.time):
        return np.asarray(signal.nodes)
    return np.interp(time, *curve(axis, name))
