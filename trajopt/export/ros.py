"""ROS 2 trajectory_msgs/JointTrajectory as YAML, for ``ros2 topic pub`` or an action goal.

Positions, velocities and accelerations of one joint in rad or m, and the time from the start in whole seconds and
nanoseconds. joint_trajectory_controller joins points with positions and velocities by cubics, those with
accelerations, too, by quintics; accelerations are left out where they jump at the nodes (moves without a jerk limit).
There is no place for jerk.

ROS 2 common_interfaces, trajectory_msgs/msg/JointTrajectory and JointTrajectoryPoint; ros2_controllers,
joint_trajectory_controller, "Trajectory Representation".
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import yaml

from trajopt.export.formats import Format, smooth
from trajopt.export.points import Header, Points

NANOSECOND: Final = 1e-9
_FIELDS: Final = ("positions", "velocities", "accelerations")


def write(points: Points, header: Header) -> bytes:
    used = 3 if smooth(header.order) == "quintic" else 2
    message = {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": [header.name],
        "points": [_point(t, values[:used]) for t, *values in zip(points.time, *points.values, strict=True)],
    }
    text = yaml.dump(message, Dumper=getattr(yaml, "CSafeDumper", yaml.SafeDumper), sort_keys=False,
                     default_flow_style=None)  # fmt: skip
    return f"# trajopt {header.hash}\n{text}".encode()


def _point(time: float, values: list[float]) -> dict[str, Any]:
    seconds, nanoseconds = divmod(round(time / NANOSECOND), 10**9)
    lists = [[float(x) + 0.0] for x in values] + [[]] * (3 - len(values)) + [[]]
    return dict(zip((*_FIELDS, "effort"), lists, strict=True)) | {
        "time_from_start": {"sec": seconds, "nanosec": nanoseconds}
    }


def read(content: bytes, header: Header) -> Points:
    message = yaml.load(content, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    rows = message["points"]
    since = [row["time_from_start"] for row in rows]
    time = np.array([float(t["sec"]) + t["nanosec"] * NANOSECOND for t in since])
    present = [name for name in _FIELDS if rows[0][name]]
    return Points(time, tuple(np.array([float(row[name][0]) for row in rows]) for name in present))


FORMAT: Final = Format("ROS 2 JointTrajectory", write, read, smooth, carries=2, tick=NANOSECOND)
