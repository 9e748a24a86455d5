"""Ramps of a fourth-order chain from rest towards its velocity limit, in closed form but for one bracketed root.

A ramp raises the acceleration to a peak, holds it, and lowers it to zero at a velocity, where the jerk is -``jerk``:
zero for the ordinary S-curve, less for a ramp that touches the limit or passes through the middle of a short move.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache
from math import inf, sqrt
from typing import NamedTuple

from scipy.optimize import brentq


class Piece(NamedTuple):
    top: float
    duration: float
    active: str


Part = tuple[Piece, ...]


class Motion(NamedTuple):
    """What a list of pieces does from rest."""

    time: float
    distance: float
    velocity: float


@dataclass(frozen=True)
class Side:
    """Magnitudes of the limits as one end of a move sees them, time running away from it; velocity > 0."""

    velocity: float
    acceleration: float
    jerk: float
    back_jerk: float
    snap: float
    back_snap: float


def pieces(side: Side, peak: float, hold: float, jerk: float) -> Part:
    """The ramp with a peak of acceleration, held for a time, that ends at zero acceleration with -jerk."""
    up = _jerk_peak(peak, side.jerk, side.snap, side.back_snap)
    down = sqrt(max(0.0, (peak + jerk**2 / 2 / side.snap) / (0.5 / side.snap + 0.5 / side.back_snap)))
    down = max(jerk, min(down, side.back_jerk))
    rise = up**2 / 2 * (1 / side.snap + 1 / side.back_snap)
    fall = down**2 / 2 / side.back_snap + (down**2 - jerk**2) / 2 / side.snap
    return (
        Piece(side.snap, up / side.snap, "snap.max"),
        Piece(0.0, max(0.0, peak - rise) / up if up == side.jerk else 0.0, "jerk.max"),
        Piece(-side.back_snap, up / side.back_snap, "snap.min"),
        Piece(0.0, hold, "acceleration.max"),
        Piece(-side.back_snap, down / side.back_snap, "snap.min"),
        Piece(0.0, max(0.0, peak - fall) / down if down == side.back_jerk else 0.0, "jerk.min"),
        Piece(side.snap, (down - jerk) / side.snap, "snap.max"),
    )


def motion(ramp: Iterable[Piece]) -> Motion:
    x = v = a = j = time = 0.0
    for u, d, _ in ramp:
        x += d * (v + d / 2 * (a + d / 3 * (j + d / 4 * u)))
        v += d * (a + d / 2 * (j + d / 3 * u))
        a += d * (j + d / 2 * u)
        j += d * u
        time += d
    return Motion(time, x, v)


@lru_cache(maxsize=512)
def to_velocity(side: Side, velocity: float, jerk: float) -> Part:
    """The ramp that reaches a velocity with -jerk; ``jerk`` is at most :func:`greatest_jerk`."""

    def short(peak: float) -> float:
        return motion(pieces(side, peak, 0.0, jerk)).velocity - velocity

    if side.acceleration < inf and (missing := -short(side.acceleration)) >= 0:
        return pieces(side, side.acceleration, missing / side.acceleration, jerk)
    least, likely = jerk**2 / 2 / side.back_snap, (velocity**2 * side.snap) ** (1 / 3)
    return pieces(side, _root(short, least, grow(short, max(least, likely), side.acceleration)), 0.0, jerk)


def greatest_jerk(side: Side, velocity: float) -> float:
    """The largest magnitude of jerk with which a ramp can pass a velocity at zero acceleration."""

    def short(jerk: float) -> float:
        return motion(pieces(side, jerk**2 / 2 / side.back_snap, 0.0, jerk)).velocity - velocity

    most = min(side.back_jerk, sqrt(2 * side.back_snap * side.acceleration))
    if most < inf and short(most) <= 0:
        return most
    return _root(short, 0.0, grow(short, 1.0, most))


def hill(left: Side, right: Side, size: float) -> Part:
    """The move between rests that never holds its velocity, growing with ``size``: the peak of the first acceleration,
    and past its limit the time for which it is held. Both jerks at the top of the hill are one."""
    peak, hold = min(size, left.acceleration), max(0.0, size - left.acceleration)
    rise = pieces(left, peak, hold, 0.0)[:4]

    def whole(other: float) -> Part:
        back, rest = min(other, right.acceleration), max(0.0, other - right.acceleration)
        drop = peak + back
        down = _jerk_peak(drop, left.back_jerk, left.back_snap, left.snap)
        used = down**2 / 2 * (1 / left.snap + 1 / left.back_snap)
        middle = [
            Piece(-left.back_snap, down / left.back_snap, "snap.min"),
            Piece(0.0, max(0.0, drop - used) / down if down == left.back_jerk else 0.0, "jerk.min"),
            Piece(left.snap, down / left.snap, "snap.max"),
        ]
        return (*rise, *middle, *backwards(pieces(right, back, rest, 0.0)[:4]))

    if left == right:
        return whole(size)
    top = grow(lambda x: -motion(whole(x)).velocity, size, inf)
    return whole(_root(lambda x: -motion(whole(x)).velocity, 0.0, top))


def backwards(ramp: Part) -> Part:
    """A ramp of the right side as it runs in the move's own time."""
    turn = {"snap.max": "snap.min", "snap.min": "snap.max", "acceleration.max": "acceleration.min"}
    return tuple(Piece(-u, d, turn.get(name, name)) for u, d, name in reversed(ramp))


def ordinary(left: Side, right: Side, distance: float) -> Part:
    """The S-curve: both ramps end with zero jerk at one velocity, held where it is the limit."""

    def at(velocity: float) -> Part:
        ramps = to_velocity(left, velocity, 0.0), to_velocity(right, velocity, 0.0)
        return *ramps[0], *backwards(ramps[1])

    def short(velocity: float) -> float:
        sides = (motion(to_velocity(side, velocity, 0.0)).distance for side in (left, right))
        return sum(sides) - distance

    if left.velocity < inf and (missing := -short(left.velocity)) >= 0:
        ramps = to_velocity(left, left.velocity, 0.0), to_velocity(right, left.velocity, 0.0)
        return *ramps[0], Piece(0.0, missing / left.velocity, "velocity.max"), *backwards(ramps[1])
    return at(_root(short, 0.0, grow(short, 1.0, left.velocity)))


def merged(ramp: Iterable[Piece]) -> Part:
    """Without empty pieces and borders between equal ones."""
    out: list[Piece] = []
    for p in ramp:
        if p.duration <= 0:
            continue
        if out and out[-1].active == p.active:
            out[-1] = p._replace(duration=out[-1].duration + p.duration)
        else:
            out.append(p)
    return tuple(out)


def grow(function: Callable[[float], float], start: float, most: float) -> float:
    """The first of start, 2 start, 4 start, ..., at most ``most``, where an increasing function is positive."""
    x = min(start, most)
    while x < most and function(x) < 0:
        x = min(4 * x, most)
    return x


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    if function(low) >= 0:
        return low
    if function(high) <= 0:
        return high
    return float(brentq(function, low, high, xtol=1e-300, rtol=8.9e-16))


def _jerk_peak(change: float, most: float, snap: float, back: float) -> float:
    """The jerk reached by a pulse from zero jerk to zero jerk that changes the acceleration by ``change``."""
    return min(most, sqrt(2 * change / (1 / snap + 1 / back)))
