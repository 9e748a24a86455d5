"""Why a throw is impossible, or needs a wind-up: bounds on the speed of the tip, from the limits of the joints."""

from __future__ import annotations

from functools import partial
from math import hypot, inf
from typing import Any, Final

import numpy as np

from trajopt.attempt import Clock, convex
from trajopt.axes.problem import AxesProblem
from trajopt.mesh import Floats
from trajopt.objective import Lowered
from trajopt.problem import FREE, Problem, State
from trajopt.transcribe import Setting, Transcript, without

_GRID: Final = 401  # poses a joint
_ZOOMS: Final = 6
_INTERVALS: Final = 60


def explain(problem: AxesProblem, clock: Clock) -> dict[str, Any]:
    """Of a throw for which no motion was found: ``text`` for people, whether it is shown ``impossible``, and whether in
    ``continuous`` time, and the bounds (m/s); empty for all else."""
    tip = problem.tip
    if tip is None or tip.velocity is None or not hasattr(problem.dynamics, "lengths"):
        return {}
    asked, text = hypot(*tip.velocity), []
    found: dict[str, Any] = {"continuous": False, "impossible": False}
    if (bound := limits_bound(problem, clock)) is not None:
        found |= {"tip_speed_bound": bound, "impossible": asked > bound * (1 + 1e-6)}
        if found["impossible"]:
            text.append(f"a tip speed of {asked:g} m/s is beyond reach: within the limits of the joints it stays below"
                        f" {bound:.6g} m/s")  # fmt: skip
    if (forward := forward_only_speed(problem)) is not None:
        found["forward_only_bound"] = forward
        text.append(f"without a wind-up the tip reaches at most {forward:.6g} m/s")
    return {**found, "text": text} if text else {}


def limits_bound(problem: AxesProblem, clock: Clock) -> float | None:
    """A tip speed (m/s) that no motion on a mesh of 60 intervals exceeds: every link by the largest speed of each joint
    at the release within its own limits. None where the time is free."""
    if problem.fixed_time is None or not isinstance(problem.release, float | str) or problem.release == "free":
        return None
    time = problem.fixed_time if problem.release == "end" else float(problem.release)
    speeds = [_fastest(move, time, clock) for move in problem.moves]
    return None if None in speeds else _stretched(problem, [x for x in speeds if x is not None])


def closed_bound(problem: AxesProblem) -> float:
    """A tip speed (m/s) that no motion exceeds, in closed form: v, a T and J T²/2 bound the speed of a joint from rest;
    infinite where nothing bounds it, or the tip is no sum of links."""
    if not hasattr(problem.dynamics, "lengths"):
        return inf
    return _stretched(problem, [_from_rest(move) for move in problem.moves])


def _stretched(problem: AxesProblem, speeds: list[float]) -> float:
    """The speed of the tip of the arm stretched out, all joints turning at their fastest."""
    return float(np.dot(problem.dynamics.lengths, np.cumsum(speeds)))


def _from_rest(move: Problem) -> float:
    time, start = move.move.fixed_time, move.move.start.fixed(3)
    found, limits = [inf], move.limits
    if limits.velocity is not None:
        found.append(max(abs(limits.velocity.lowest), abs(limits.velocity.highest)))
    if time is not None and start.get(1) == 0.0 and limits.acceleration is not None:
        found.append(max(abs(limits.acceleration.lowest), abs(limits.acceleration.highest)) * time)
    if time is not None and start.get(1) == start.get(2) == 0.0 and limits.jerk is not None:
        found.append(max(abs(limits.jerk.lowest), abs(limits.jerk.highest)) * time**2 / 2)
    return min(found)


def _fastest(move: Problem, time: float, clock: Clock) -> float | None:
    """The largest speed (rad/s) of one joint at a time, either way, by its kinematic limits: a linear program."""
    end = State(position=FREE, velocity=FREE, acceleration=FREE, jerk=FREE if move.order == 4 else None)
    own = move.move.model_copy(update={"time": time, "end": end, "via": ()})
    grid = move.transcription.model_copy(update={"intervals": _INTERVALS, "scheme": "exact", "solver": "auto"})
    setting = without(
        Setting.of(move.model_copy(update={"move": own, "transcription": grid})),
        [name for name in move.limits.given if name in ("force", "power", "rms_force")],
    )
    best = 0.0
    for sign in (1.0, -1.0):
        attempt = convex(setting, time, partial(_speed, sign), clock)
        if attempt.trajectory is None or not np.isfinite(attempt.bound):
            return None
        best = max(best, -attempt.bound)
    return best


def _speed(sign: float, transcript: Transcript) -> Lowered:
    size = transcript.sizes.derivative[1]
    return Lowered(transcript.chain[1][-1] * (-sign / size), size, None)


def forward_only_speed(problem: AxesProblem) -> float | None:
    """The largest tip speed (m/s), in the direction asked for, of joints that only turn forwards, over all poses: from
    rest to an angle s away a joint gains at most (4.5 J s²)^(1/3) under a jerk J, sqrt(2 a s) under an acceleration a.

    For two joints that start from rest at given angles; else None.
    """
    tip, moves = problem.tip, problem.moves
    starts = [move.move.start.fixed(3) for move in moves]
    rest = all(s.get(1) == s.get(2, 0.0) == 0.0 and 0 in s for s in starts)
    if tip is None or tip.velocity is None or len(moves) != 2 or not rest:
        return None
    ranges = [move.limits.position for move in moves]
    low = np.array([-np.pi if x is None else max(x.lowest, -2 * np.pi) for x in ranges])
    high = np.array([np.pi if x is None else min(x.highest, 2 * np.pi) for x in ranges])
    best, corner = 0.0, (low, high)
    for _ in range(_ZOOMS):
        q = list(np.meshgrid(*np.linspace(*corner, _GRID).T, indexing="ij"))
        speed = _forward(problem, q, [s[0] for s in starts])
        k = np.unravel_index(int(np.argmax(speed)), speed.shape)
        best, at, half = max(best, float(speed[k])), np.array([x[k] for x in q]), (corner[1] - corner[0]) / 12
        corner = np.maximum(at - half, low), np.minimum(at + half, high)
    return best if np.isfinite(best) and best > 0 else None


def _forward(problem: AxesProblem, q: list[Floats], starts: list[float]) -> Floats:
    """At poses, the tip speed that forward turning joints reach in the direction asked for; zero where they cannot."""
    arm, tip = problem.dynamics, problem.tip
    assert tip is not None and tip.velocity is not None
    one, none = np.ones_like(q[0]), np.zeros_like(q[0])
    (a, c), (b, d) = arm.tip_velocity(q, [one, none]), arm.tip_velocity(q, [none, one])
    x, y = np.array(tip.velocity) / hypot(*tip.velocity)
    with np.errstate(all="ignore"):
        det = a * d - b * c
        w = [(d * x - b * y) / det, (a * y - c * x) / det]
        gained = [_gained(move, np.abs(angle - s)) for move, angle, s in zip(problem.moves, q, starts, strict=True)]
        speed = np.minimum(*(top / np.abs(rate) for top, rate in zip(gained, w, strict=True)))
        forwards = np.all([rate * (angle - s) >= 0 for rate, angle, s in zip(w, q, starts, strict=True)], axis=0)
    return np.where(forwards & np.isfinite(speed), speed, 0.0)


def _gained(move: Problem, s: Floats) -> Floats:
    found, limits = np.full_like(s, np.inf), move.limits
    if limits.velocity is not None:
        found = np.minimum(found, max(abs(limits.velocity.lowest), abs(limits.velocity.highest)))
    if limits.acceleration is not None:
        most = max(abs(limits.acceleration.lowest), abs(limits.acceleration.highest))
        found = np.minimum(found, np.sqrt(2 * most * s))
    if limits.jerk is not None:
        most = max(abs(limits.jerk.lowest), abs(limits.jerk.highest))
        found = np.minimum(found, np.cbrt(4.5 * most * s**2))
    return np.asarray(found)
