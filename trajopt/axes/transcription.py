"""Several axes on one model: each laid by the one builder, then what couples them, then the limits of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import numpy as np

from trajopt.axes.motion import loads
from trajopt.axes.problem import AxesProblem
from trajopt.mesh import Floats, Mesh, mesh_for
from trajopt.problem import FREE
from trajopt.quantities import Driven, Quantities
from trajopt.signals import Signal
from trajopt.transcribe import Setting, Transcript, hold, lay

THROWN: Final = 0.7  # of the intervals: before a release at a free time


@dataclass(frozen=True)
class AxesSetting:
    """The settings of all axes, on one mesh, and the node of the release (None where there is none)."""

    problem: AxesProblem
    axes: tuple[Setting, ...]
    release: int | None

    @classmethod
    def of(cls, problem: AxesProblem) -> AxesSetting:
        """The setting of a problem, from its transcription section."""
        at, moves, duration = problem.release, problem.moves, problem.fixed_time
        mesh = mesh_for(*moves, also=(at,) if isinstance(at, float) else ())
        release = None if at is None else mesh.intervals
        if isinstance(at, float) and duration is not None:
            release = mesh.node_at(at / duration)
        elif at == FREE:
            release = mesh.node_at(THROWN)
        return cls(problem, tuple(replace(Setting.of(move), mesh=mesh) for move in moves), release)

    @property
    def mesh(self) -> Mesh:
        """The mesh of all axes."""
        return self.axes[0].mesh


@dataclass(frozen=True)
class AxesTranscript:
    """Transcribed axes on one model, and the torque variables an axis, which want a start, too."""

    axes: tuple[Transcript, ...]
    torques: tuple[tuple[Any, ...], ...]
    parts: tuple[Any, ...]  # s: durations before and after a free release
    parameters: Any = None  # (N-1,) of a curve at the inner nodes


def transcribe(setting: AxesSetting, model: Any, duration: Any) -> AxesTranscript:
    """All axes on ``model``; ``duration`` (s) is a float or an expression. The objective comes separately."""
    steps, parts = _steps(setting, model, duration)
    laid = tuple(lay(axis, model, duration, steps) for axis in setting.axes)
    arm = setting.problem.dynamics
    torques: tuple[tuple[Any, ...], ...] = ()
    parameters = None
    if arm is not None:
        torques = _torques(arm, model, laid)
        laid = tuple(_loaded(axis, ends) for axis, ends in zip(laid, torques, strict=True))
        parameters = _reach(setting, model, laid)
    for axis in laid:
        hold(axis)
    return AxesTranscript(laid, torques, parts, parameters)


def _steps(setting: AxesSetting, model: Any, duration: Any) -> tuple[Any, tuple[Any, ...]]:
    """The steps where a part of the duration is free by itself: each phase has its own, of its own length."""
    if setting.problem.release != FREE:
        return None, ()
    assert setting.release is not None
    size, ends = setting.axes[0].sizes.duration, (0.02, np.inf)
    throw, stop = (model.vector(1, size, np.array([ends[0] * size]), np.array([ends[1]])) for _ in range(2))
    model.zero(throw[0] + stop[0] - duration, size)
    fractions, node = setting.mesh.steps, setting.release
    share = setting.mesh.fractions[node]
    phases = [
        model.times(fractions[:node] / share, throw[0]),
        model.times(fractions[node:] / (1 - share), stop[0]),
    ]
    return np.concatenate(phases), (throw, stop)


def _torques(arm: Any, model: Any, axes: Sequence[Transcript]) -> tuple[tuple[Any, ...], ...]:
    """Variables for the torques of all joints, which are those of the dynamics."""
    found = []
    for axis, ends in zip(axes, loads(arm, axes), strict=True):
        size = axis.sizes.force
        free = np.full(len(ends[0]), np.inf)
        variables = tuple(model.vector(len(values), size, -free, free, "torque") for values in ends)
        for variable, values in zip(variables, ends, strict=True):
            model.zero(variable - values, size)
        found.append(variables)
    return tuple(found)


def _loaded(axis: Transcript, ends: tuple[Any, ...]) -> Transcript:
    torque = Signal(ends[0], ()) if len(ends) == 1 else Signal(None, ends)
    known = {field.name: getattr(axis.quantities, field.name) for field in fields(Quantities)}
    return replace(axis, quantities=Driven(**known, torque=torque))


def _reach(setting: AxesSetting, model: Any, axes: Sequence[Transcript]) -> Any:
    """Rows for what is asked of the tip; the path parameters of a curve, which want a start, or None."""
    tip, arm = setting.problem.tip, setting.problem.dynamics
    if tip is None:
        return None
    origins = [axis.problem.move.start_position or 0.0 for axis in axes]
    q = [axis.chain[0] + origin for axis, origin in zip(axes, origins, strict=True)]
    if tip.velocity is not None:
        assert setting.release is not None
        at = slice(setting.release, setting.release + 1)
        found = arm.tip_velocity([x[at] for x in q], [axis.chain[1][at] for axis in axes])
        size = max(1e-3, *(abs(x) for x in tip.velocity))
        for value, wanted in zip(found, tip.velocity, strict=True):
            model.zero(value - wanted, size)
    if tip.line is not None:
        _tube(tip.line, model, arm.tip([x[1:-1] for x in q]))
    return None if tip.curve is None else _along(tip.curve, model, arm.tip([x[1:-1] for x in q]))


def _along(curve: Any, model: Any, tip: tuple[Any, Any]) -> Any:
    """Path parameters that grow from node to node; the tip in a square about the point of the curve that each stands
    for, which lies within the width."""
    count, most = len(tip[0]), curve.width / 8**0.5
    s = model.vector(count, 1.0, np.zeros(count), np.ones(count), "path")
    model.nonpositive(s[:-1] - s[1:])
    for value, wanted in zip(tip, curve.point(s), strict=True):
        off = value - wanted
        model.nonpositive(off - most, curve.width)
        model.nonpositive(-off - most, curve.width)
    return s


def _tube(line: Any, model: Any, tip: tuple[Any, Any]) -> None:
    """The tip within the width of a line, between its ends, at the inner nodes; the ends meet it by themselves."""
    along, across = _off(line, tip)
    length = float(np.hypot(line.end[0] - line.start[0], line.end[1] - line.start[1]))
    for residual in (across - line.width / 2, -across - line.width / 2):
        model.nonpositive(residual, line.width)
    for residual in (-along - line.width / 2, along - length - line.width / 2):
        model.nonpositive(residual, length)


def _off(line: Any, tip: tuple[Any, Any]) -> tuple[Any, Any]:
    """How far along a line and how far to its left points are, m."""
    (x0, y0), (x1, y1) = line.start, line.end
    length = float(np.hypot(x1 - x0, y1 - y0))
    cx, cy = (x1 - x0) / length, (y1 - y0) / length
    dx, dy = tip[0] - x0, tip[1] - y0
    return cx * dx + cy * dy, cx * dy - cy * dx


def fractions_of(parts: Sequence[float], setting: AxesSetting) -> Floats:
    """(N+1,) the nodes as fractions of the duration, from the durations of the phases."""
    node = setting.release
    assert node is not None
    before, share = setting.mesh.fractions, setting.mesh.fractions[node]
    split = parts[0] / sum(parts)
    first = before[: node + 1] / share * split
    second = split + (before[node:] - share) / (1 - share) * (1 - split)
    return np.concatenate([first, second[1:]])
