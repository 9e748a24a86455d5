"""What a target makes of its points: hold, straight lines, cubic or quintic polynomials between them, a C2 spline."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.interpolate import BPoly, CubicHermiteSpline, CubicSpline, PPoly

from trajopt.export.points import Points
from trajopt.mesh import Floats

NEEDS: Final = {"hold": 0, "linear": 0, "spline": 0, "cubic": 1, "quintic": 2}  # the highest derivative used
SMOOTH: Final = ("cubic", "quintic", "spline")


@dataclass(frozen=True)
class Seen:
    """One derivative as the drive sees it: (m,) times (s) and (m,) values (SI), every extreme among them."""

    time: Floats
    value: Floats


@dataclass(frozen=True)
class Reconstruction:
    """``position`` (s -> m or rad), and the derivatives 1 to 4 by number as they are seen."""

    position: Callable[[Floats], Floats]
    derivatives: dict[int, Seen]


def reconstruct(points: Points, kind: str, drive: float | None, end_velocities: tuple[float, float]) -> Reconstruction:
    """The motion that follows from points by an interpolation of `NEEDS`.

    Polynomials are differentiated; where a derivative jumps between two of them, the next one is seen as the jump over
    the ``drive`` cycle (s), or over half of both segments where that is not known. Straight lines and held values have
    no derivatives but differences: between the points, or at the drive cycle. A spline is clamped to the
    ``end_velocities``.
    """
    if kind in ("hold", "linear"):
        position = _held(points) if kind == "hold" else _lines(points)
        if drive is not None:
            end = points.time[-1]
            time = np.append(np.arange(0.0, end * (1 - 1e-9), drive), end)
            points = Points(time, (position(time),))
        return Reconstruction(position, differences(points))
    piecewise = _polynomials(points, kind, end_velocities)
    return Reconstruction(lambda t: np.asarray(piecewise(t)), _derivatives(piecewise, drive))


def differences(points: Points) -> dict[int, Seen]:
    """Divided differences: each is a mean of the derivative over the points that it takes."""
    found = {}
    time, value = points.time, points.position
    for i in (1, 2, 3, 4):
        if len(value) < 2:
            break
        value = i * np.diff(value) / (points.time[i:] - points.time[:-i])
        time = (time[:-1] + time[1:]) / 2
        found[i] = Seen(time, value)
    return found


def _held(points: Points) -> Callable[[Floats], Floats]:
    def position(t: Floats) -> Floats:
        k = np.clip(np.searchsorted(points.time, t, side="right") - 1, 0, len(points.time) - 1)
        return points.position[k]

    return position


def _lines(points: Points) -> Callable[[Floats], Floats]:
    return lambda t: np.interp(t, points.time, points.position)


def _polynomials(points: Points, kind: str, end_velocities: tuple[float, float]) -> PPoly:
    if kind == "cubic":
        return CubicHermiteSpline(points.time, points.position, points.values[1])
    if kind == "quintic":
        return PPoly.from_bernstein_basis(BPoly.from_derivatives(points.time, np.stack(points.values[:3], axis=1)))
    start, end = end_velocities
    clamped: Any = ((1, start), (1, end))
    return CubicSpline(points.time, points.position, bc_type=clamped)


def _derivatives(piecewise: PPoly, drive: float | None) -> dict[int, Seen]:
    steps = np.diff(piecewise.x)
    spread = np.full(len(steps) - 1, drive) if drive is not None else (steps[:-1] + steps[1:]) / 2
    found, lower = {}, piecewise
    for i in (1, 2, 3, 4):
        signal = lower.derivative()
        time, value = extremes(signal)
        if i > 1 and len(steps) > 1:
            jump = (lower.c[-1, 1:] - _right_ends(lower)[:-1]) / spread
            time, value = np.append(time, piecewise.x[1:-1]), np.append(value, jump)
        found[i] = Seen(time, value)
        lower = signal
    return found


def _right_ends(piecewise: PPoly) -> Floats:
    """(k,) the values at the right ends of the pieces."""
    steps, value = np.diff(piecewise.x), np.zeros(len(piecewise.x) - 1)
    for coefficient in piecewise.c:
        value = value * steps + coefficient
    return value


def extremes(signal: PPoly, inner: int = 4) -> tuple[Floats, Floats]:
    """Times and values of a piecewise polynomial at both ends of its pieces, wherever its slope is zero, and at
    ``inner`` places of every piece."""
    x, steps = signal.x, np.diff(signal.x)
    inside = (x[:-1, None] + steps[:, None] * (np.arange(1, inner + 1) / (inner + 1))).ravel()
    roots = np.empty(0)
    if signal.c.shape[0] > 2:
        found = signal.derivative().roots(discontinuity=False, extrapolate=False)
        roots = found[np.isfinite(found)]
    time = np.concatenate([x[:-1], x[1:], inside, roots])
    value = np.concatenate([signal.c[-1], _right_ends(signal), signal(inside), signal(roots)])
    return time, value
