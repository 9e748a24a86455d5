"""What a motion is held to at its nodes and may exceed between them: torque, power, and the distance from a path."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from trajopt import transcribe
from trajopt.axes.motion import Motion, driven
from trajopt.axes.transcription import AxesSetting
from trajopt.mesh import Floats
from trajopt.problem import DERIVATIVES
from trajopt.signals import OnFloats
from trajopt.trajectory import Trajectory

_PARTS: Final = np.linspace(0.0, 1.0, 33)  # of an interval
_POINTS: Final = 8001  # of a path


def excess(motion: Motion) -> float:
    """By how much the worst of them is exceeded, relative to what is allowed; zero for the Euler scheme, which means
    its nodes alone."""
    if motion.axes[0].scheme.terms == 1:
        return 0.0
    return max([0.0, _off_path(motion), *(_of_axis(axis) for axis in motion.axes)])


def drawn_in(setting: AxesSetting, share: float) -> AxesSetting:
    """The setting with all of them drawn in by a share."""
    axes = tuple(transcribe.drawn_in(axis, share, sampled=True) for axis in setting.axes)
    tip = setting.problem.tip
    if tip is None or tip.path is None:
        return replace(setting, axes=axes)
    narrow = tip.path.model_copy(update={"width": tip.path.width * (1 - share)})
    tip = tip.model_copy(update={"line" if tip.line is not None else "curve": narrow})
    return replace(setting, axes=axes, problem=setting.problem.model_copy(update={"tip": tip}))


def restored(motion: Motion, problem: Any) -> Motion:
    """A motion found within limits that were drawn in, as one of the problem itself."""
    moves = zip(motion.axes, problem.moves, strict=True)
    return Motion(problem, driven(problem, [replace(axis, problem=move) for axis, move in moves]), motion.release)


def _of_axis(axis: Trajectory) -> float:
    limits = axis.problem.limits.given
    found = [0.0]
    for name in (name for name in limits if name not in (*DERIVATIVES, "rms_force")):
        values = np.array([axis.signal(name).within(OnFloats(), s) for s in _PARTS])
        times = axis.time[:-1] + np.outer(_PARTS, np.diff(axis.time))
        for sign, side in zip((-1.0, 1.0), limits[name].at(times), strict=True):
            if side is not None:
                found.append(float(np.max(sign * (values - side) / np.abs(side))))
    return max(found)


def _off_path(motion: Motion) -> float:
    tip = motion.problem.tip
    if tip is None or tip.path is None:
        return 0.0
    found, time = 0.0, motion.axes[0].time
    path = np.stack(np.broadcast_arrays(*tip.path.point(np.linspace(0.0, 1.0, _POINTS))))
    for part in _PARTS:
        moments = motion.tip(time[:-1] + part * np.diff(time))
        found = max(found, float(np.max(_distance(np.stack([moments["x"], moments["y"]]), path))))
    return found / (tip.path.width / 2) - 1


def _distance(points: Floats, path: Floats) -> Floats:
    """(count,) from points (2, count) to the nearest piece of a chain of straight ones (2, vertices)."""
    squares = (points[0][:, None] - path[0]) ** 2 + (points[1][:, None] - path[1]) ** 2
    nearest = np.clip(np.argmin(squares, axis=1), 1, path.shape[1] - 2)
    found = np.full(points.shape[1], np.inf)
    for k in (nearest - 1, nearest):
        start, along = path[:, k], path[:, k + 1] - path[:, k]
        share = np.clip(np.sum((points - start) * along, axis=0) / np.sum(along**2, axis=0), 0.0, 1.0)
        found = np.minimum(found, np.hypot(*(points - start - share * along)))
    return found
