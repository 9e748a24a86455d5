"""Structures of fourth-order moves from those of third order: every step of the jerk becomes a ramp.

A stiff snap limit changes a third-order move little, and what it changes is too short for any grid to see.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, isfinite, sqrt

from trajopt.switching.chain import Chain
from trajopt.switching.coarse import Sketch
from trajopt.switching.polynomials import audit
from trajopt.switching.ramps import Piece, merged
from trajopt.switching.third import Profile, extremals

_LEAST = 0.05  # of an arc: what two ramps leave of it at least


def sketches(chain: Chain) -> Iterator[Sketch]:
    """Sketches of a scaled fourth-order chain, those of the shortest third-order moves first: with the limits on jerk,
    and without plateaus of jerk, where the snap does not let it reach them."""
    for limit, plateaus in ((inf, True), (_within_reach(chain), False)):
        low, high = chain.limits[3]
        jerk = max(low, -limit), min(high, limit)
        if not all(map(isfinite, jerk)) or (not plateaus and jerk == (low, high)):
            continue
        third = Chain(3, ((-inf, inf), *chain.limits[1:3], jerk), chain.start[:3], chain.end[:3])
        for profile in extremals(third) if third.start != third.end else ():
            if audit(third, profile.tops, profile.durations).accepted:
                yield _with_ramps(chain, profile, plateaus)


def _within_reach(chain: Chain) -> float:
    """The jerk that a change of acceleration from limit to limit reaches, or one of two units."""
    (a0, a1), (s0, s1) = chain.limits[2], chain.top
    return sqrt(min(a1 - a0, 2.0) / (1 / s1 - 1 / s0))


def _with_ramps(chain: Chain, profile: Profile, plateaus: bool) -> Sketch:
    low, high = chain.top
    values = [chain.start[3], *profile.tops, chain.end[3]]
    steps = [b - a for a, b in zip(values, values[1:], strict=False)]
    ramps = [Piece(high if x > 0 else low, x / (high if x > 0 else low), _name(x)) for x in steps]
    pieces = [ramps[0]]
    for k, (duration, active) in enumerate(zip(profile.durations, profile.active, strict=True)):
        left = max(_LEAST * duration, duration - (ramps[k].duration + ramps[k + 1].duration) / 2)
        if plateaus or not active.startswith("jerk"):
            pieces.append(Piece(0.0, left, active))
        pieces.append(ramps[k + 1])
    return Sketch(merged(pieces), ())


def _name(step: float) -> str:
    return "snap.max" if step > 0 else "snap.min"
