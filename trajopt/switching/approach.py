"""Both ends of a fourth-order move between rests that holds its greatest velocity: a ramp, and then chattering."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from scipy.optimize import minimize_scalar

from trajopt.switching.chatter import Chattering, chattering
from trajopt.switching.ramps import Part, Piece, Side, backwards, greatest_jerk, motion, to_velocity
from trajopt.switching.sequences import Candidate, Parts, keeps

MOST_TOUCHES = 12
_ENOUGH = 1e-10  # relative: the loss at which the default number of touches stops


class Approach:
    """Both ramps to a velocity limit with chattering after the first touch.

    ``lowest``: the duration of a move that chatters without end, which none can beat (theorems 3 and 4 of the paper
    named in :mod:`trajopt.switching.chatter`); minus infinity if the distance, here one, is below ``least_distance``.
    """

    def __init__(self, left: Side, right: Side) -> None:
        self.sides = (left, right)
        self.laws = tuple(chattering(side.back_snap / side.snap) for side in self.sides)
        first = _best_touch(left, self.laws[0])
        self.jerks = (first, first if left == right else _best_touch(right, self.laws[1]))
        self.limit = left.velocity
        self.most = min(greatest_jerk(side, self.limit) for side in self.sides)
        costs = [_cost(side, law, c) for side, law, c in zip(self.sides, self.laws, self.jerks, strict=True)]
        times = [
            motion(to_velocity(side, self.limit, c)).time + law.limit_time * c / side.snap
            for side, law, c in zip(self.sides, self.laws, self.jerks, strict=True)
        ]
        duration = (1.0 + sum(costs)) / self.limit
        self.least_distance = self.limit * sum(times) - sum(costs)
        # only a move that reaches the limit for good has this duration; for a shorter one it says nothing
        self.lowest = duration if self.least_distance <= 1.0 else -inf

    def chattering(self, min_dwell: float, touches: int | None) -> Iterator[Candidate]:
        """Moves with so many touches at each end, ending in a plateau, from most to least."""
        counts = range(MOST_TOUCHES + 1) if touches is None else range(min(touches, 40) + 1)
        best = None
        for count in counts:
            candidate = self._cut(count)
            if candidate is None or not keeps(candidate, min_dwell):
                continue
            best = candidate
            if touches is None and candidate.duration <= self.lowest * (1 + _ENOUGH):
                break
        if best is not None:
            yield best

    def _cut(self, count: int) -> Candidate | None:
        ends = [ending(side, law, c, count) for side, law, c in zip(self.sides, self.laws, self.jerks, strict=True)]
        moved = sum(motion([p for part in end for p in part]).distance for end in ends)
        if moved > 1.0:
            return None
        plateau = [Piece(0.0, (1.0 - moved) / self.limit, "velocity.max")]
        left, right = ends
        middle = (*left[-1], *plateau, *backwards(right[-1]))
        return Candidate([*left[:-1], middle, *(backwards(part) for part in reversed(right[:-1]))], -inf)


def _cost(side: Side, law: Chattering, jerk: float) -> float:
    """∫ (V - v) dt of an approach whose first touch has -jerk."""
    ramp = motion(to_velocity(side, side.velocity, jerk))
    return side.velocity * ramp.time - ramp.distance + side.snap * law.cost * (jerk / side.snap) ** 4


def _best_touch(side: Side, law: Chattering) -> float:
    most = greatest_jerk(side, side.velocity)
    best = minimize_scalar(
        lambda c: _cost(side, law, float(c)), bounds=(0.0, most), method="bounded", options={"xatol": 1e-9 * most}
    )
    return float(best.x)


def ending(side: Side, law: Chattering, jerk: float, count: int) -> Parts:
    """The approach with ``count`` touches and then the fewest switches to the limit."""
    if count == 0:
        return [to_velocity(side, side.velocity, 0.0)]
    parts = [to_velocity(side, side.velocity, jerk)]
    scale = jerk / side.snap
    for _ in range(count - 1):
        parts.append(after_touch(side, law.arcs, scale))
        scale *= law.alpha
    return [*parts, after_touch(side, law.greedy, scale)]


def after_touch(side: Side, durations: tuple[float, ...], scale: float) -> Part:
    """What follows a touch: snap up, down, up."""
    names = ("snap.max", "snap.min", "snap.max")
    tops = (side.snap, -side.back_snap, side.snap)
    return tuple(Piece(u, d * scale, name) for u, d, name in zip(tops, durations, names, strict=False))
