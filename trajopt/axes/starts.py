"""Where coupled axes start from: poses of the release drawn at random, each with a wind-up, joined by quintics.

The initial guess decides. Random moves are feasible in a quarter to a half of the tries; a pose at the release, the
joint speeds that give the tip its velocity there, and a via point at about half time on the far side, from which there
is room to swing up to that speed, succeed nearly always.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from math import inf
from typing import Any, Final

import numpy as np
from scipy.interpolate import BPoly

from trajopt.axes.motion import Motion
from trajopt.axes.problem import AxesProblem
from trajopt.axes.transcription import THROWN, AxesSetting
from trajopt.mesh import Floats
from trajopt.problem import DERIVATIVES, FREE, Problem
from trajopt.scaling import sizes_of

_SINGULAR: Final = 0.08  # smallest over largest singular value of the Jacobian: a pose below it is drawn again
_DRAWS: Final = 2000  # of a pose for one start, before it is taken as it comes
Knots = list[tuple[float, list[float]]]  # times (s), each with the derivatives prescribed there, lowest first


@dataclass(frozen=True)
class Guess:
    """A motion to start from: an interpolant (position over time) an axis, its duration and release (s)."""

    curves: tuple[Any, ...]
    duration: float
    release: float | None

    @classmethod
    def from_motion(cls, motion: Motion) -> Guess:
        """The exact resampling of a motion found on another mesh."""
        return cls(motion.axes, motion.duration, motion.release)

    def chains(self, setting: AxesSetting) -> list[list[Floats]]:
        """The values at the nodes of a setting, the top ones at the middles of the intervals, axis by axis."""
        nodes = self.nodes(setting)
        middles = (nodes[1:] + nodes[:-1]) / 2
        found = []
        for curve, axis in zip(self.curves, setting.axes, strict=True):
            order, origin = axis.problem.order, axis.problem.move.start_position or 0.0
            chain = [_derivative(curve, i, nodes if i < order else middles) for i in range(order + 1)]
            found.append([chain[0] - origin, *chain[1:]])
        return found

    def nodes(self, setting: AxesSetting) -> Floats:
        """(N+1,) the times of the nodes, s: the release falls on its own."""
        fractions, node = setting.mesh.fractions, setting.release
        if node is None or self.release is None or node == setting.mesh.intervals:
            return fractions * np.float64(self.duration)
        share = fractions[node]
        before = fractions[: node + 1] / share * self.release
        after = self.release + (fractions[node + 1 :] - share) / (1 - share) * (self.duration - self.release)
        found: Floats = np.minimum(np.concatenate([before, after]), self.duration)
        return found


def _derivative(curve: Any, i: int, t: Floats) -> Floats:
    if isinstance(curve, BPoly):
        values: Floats = np.asarray(curve(t) if i == 0 else curve.derivative(i)(t))
        return values
    sampled: dict[str, Floats] = curve.at(np.minimum(t, curve.duration))
    return sampled[DERIVATIVES[i]]


def guesses(problem: AxesProblem) -> Iterator[Guess]:
    """As many starts as the problem asks for, drawn from its seed."""
    rng = np.random.default_rng(problem.search.seed)
    kind = _along if problem.tip is not None and problem.tip.path is not None else _throw
    return islice(iter(lambda: kind(problem, rng), None), problem.search.starts)


def _times(problem: AxesProblem, rng: np.random.Generator) -> tuple[float, float | None]:
    """A duration and a release, s."""
    duration = problem.fixed_time
    if duration is None:
        sizes = [sizes_of(move).duration for move in problem.moves]
        duration = max(sizes) if isinstance(problem.move.time, tuple) else float(max(sizes) * rng.uniform(1.0, 2.5))
    at = problem.release
    release = duration * THROWN if at == FREE else duration if at == "end" else at
    return duration, None if release is None else float(release)


def _throw(problem: AxesProblem, rng: np.random.Generator) -> Guess:
    duration, release = _times(problem, rng)
    moves = problem.moves
    swing = duration if release is None else release
    if problem.release is None:
        curves = [_wander(move, duration, rng) for move in moves]
        return Guess(tuple(curves), duration, release)
    pose, speed = _pose(problem, swing, rng)
    half = float(rng.uniform(0.35, 0.6)) * swing
    curves = []
    for move, q, w in zip(moves, pose, speed, strict=True):
        knots: Knots = [(0.0, _state(move, 0)), (half, [_far(move, q, w, rng), 0.0, 0.0]), (swing, [q, w, 0.0])]
        if swing < duration:
            knots.append((duration, _stop(move, q, w, duration - swing)))
        curves.append(_quintics(knots))
    return Guess(tuple(curves), duration, release)


def _pose(problem: AxesProblem, time: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Joint angles and speeds that give the tip its velocity: far from singular, with room to swing up to them."""
    assert problem.tip is not None and problem.tip.velocity is not None
    ranges = [_range(move) for move in problem.moves]
    best: tuple[float, Floats, Floats] | None = None
    for _ in range(_DRAWS):
        q = np.array([rng.uniform(low, high) for low, high in ranges])
        jacobian = _jacobian(problem.dynamics, q)
        w = np.linalg.lstsq(jacobian, np.array(problem.tip.velocity), rcond=None)[0]
        singular = np.linalg.svd(jacobian, compute_uv=False)
        need = max(abs(x) / swing_speed(move, at, x, time) for move, at, x in zip(problem.moves, q, w, strict=True))
        if best is None or need < best[0]:
            best = need, q, w
        if singular[-1] > _SINGULAR * singular[0] and need < 0.95:
            return q, w
    assert best is not None
    return best[1], best[2]


def swing_speed(move: Problem, q: float, w: float, time: float) -> float:
    """The speed (rad/s) of a joint at ``q``, in the direction of ``w``, from rest at the far end of its range.

    w³ = 4.5 J s² under a jerk J, w² = 2 a s under an acceleration a, and w itself at most what is allowed.
    """
    limits, (low, high) = move.limits, _range(move)
    room = max(q - low if w > 0 else high - q, 0.0)
    found = [inf]
    if limits.velocity is not None:
        found.append(limits.velocity.highest if w > 0 else -limits.velocity.lowest)
    if limits.acceleration is not None:
        most = limits.acceleration.highest if w > 0 else -limits.acceleration.lowest
        found.append(min((2 * most * room) ** 0.5, most * time))
    if limits.jerk is not None:
        most = limits.jerk.highest if w > 0 else -limits.jerk.lowest
        found.append(min((4.5 * most * room**2) ** (1 / 3), most * time**2 / 2))
    return max(min(found), 1e-12)


def _far(move: Problem, q: float, w: float, rng: np.random.Generator) -> float:
    """Where to swing from: as far off as the speed needs, and a little more, within the range."""
    jerk, acceleration = move.limits.jerk, move.limits.acceleration
    if jerk is not None:
        need = (abs(w) ** 3 / (4.5 * jerk.highest)) ** 0.5
    else:
        need = w * w / (2 * acceleration.highest) if acceleration is not None else abs(w) * 0.1
    low, high = _range(move)
    return float(np.clip(q - np.sign(w) * need * rng.uniform(1.0, 1.4), low, high))


def _stop(move: Problem, q: float, w: float, time: float) -> list[float]:
    """The end after a release: as it is prescribed, else where braking evenly comes to rest within the range."""
    end = move.move.end.fixed(3)
    low, high = _range(move)
    return [end.get(0, float(np.clip(q + w * time / 2, low, high))), end.get(1, 0.0), end.get(2, 0.0)]


def _wander(move: Problem, duration: float, rng: np.random.Generator) -> Any:
    """A quintic between the ends by way of the via states, or of a point drawn at half time."""
    low, high = _range(move)
    start, end = _state(move, 0), move.move.end.fixed(3)
    goal = [end.get(0, float(rng.uniform(low, high))), end.get(1, 0.0), end.get(2, 0.0)]
    knots: Knots = [(0.0, start)]
    fixed = [(via.time, via.fixed(3, None)) for via in move.move.via]
    knots += [(time, [state[0]]) for time, state in fixed if 0 in state]
    if not fixed and rng.uniform() < 0.7:
        middle = (start[0] + goal[0]) / 2 + rng.normal() * 0.3 * max(abs(goal[0] - start[0]), 0.3)
        knots.append((duration / 2, [float(np.clip(middle, low, high))]))
    return _quintics([*knots, (duration, goal)])


def _along(problem: AxesProblem, rng: np.random.Generator) -> Guess:
    """Along a path by the inverse kinematics: a smooth step in the path parameter, faster or slower at first."""
    duration, _ = _times(problem, rng)
    t = np.linspace(0.0, 1.0, 41)
    skewed = t ** float(rng.uniform(0.8, 1.25))
    s = skewed**3 * (10 - 15 * skewed + 6 * skewed**2)
    poses = problem.along(s)
    speeds = np.gradient(poses, t * duration, axis=0)
    speeds[[0, -1]] = 0.0
    times = t * duration
    curves = [
        BPoly.from_derivatives(times, np.stack([poses[:, k], speeds[:, k]], axis=1)) for k in range(len(problem.axes))
    ]
    return Guess(tuple(curves), duration, None)


def _state(move: Problem, node: int) -> list[float]:
    """Position, velocity and acceleration of a start, zero where free."""
    fixed = move.move.start.fixed(3)
    low, high = _range(move)
    return [fixed.get(0, float(np.clip(0.0, low, high))), fixed.get(1, 0.0), fixed.get(2, 0.0)]


def _quintics(knots: Knots) -> Any:
    return BPoly.from_derivatives([time for time, _ in knots], [values for _, values in knots])


def _range(move: Problem) -> tuple[float, float]:
    """How far a joint may turn, rad; once around where nothing is said."""
    limit = move.limits.position
    low, high = (-inf, inf) if limit is None else (limit.lowest, limit.highest)
    return (low if np.isfinite(low) else -np.pi), (high if np.isfinite(high) else np.pi)


def _jacobian(arm: Any, q: Floats) -> Floats:
    """(2, joints) the tip velocity per joint speed."""
    pose = [np.array([x]) for x in q]
    units = np.eye(len(q))
    return np.array([[x[0] for x in arm.tip_velocity(pose, [np.array([u]) for u in row])] for row in units]).T
