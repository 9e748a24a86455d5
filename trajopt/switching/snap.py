"""Fourth order between rests: the hill, the touches and the chattering approach, each exact, and the shortest of them.

A long move approaches its velocity limit twice, each time by a ramp to a first touch and from there by the self-similar
chattering, cut off after some touches by its fewest-switch ending. A short one touches the limit finitely often. Which
sequence is the shortest is not guessed: each comes with a lower bound from its multipliers, and the search ends when
they meet.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import inf, sqrt

from scipy.optimize import brentq

from trajopt.switching.approach import MOST_TOUCHES, Approach, after_touch
from trajopt.switching.chain import NAMES, Arcs, Chain, Impossible, Unresolved, back_in_time
from trajopt.switching.ramps import (
    Part,
    Piece,
    Side,
    backwards,
    greatest_jerk,
    grow,
    hill,
    merged,
    motion,
    ordinary,
    to_velocity,
)
from trajopt.switching.sequences import Candidate, Parts, accepted, certified, keeps, mirrored_arcs, plateaus
from trajopt.switching.stationary import Condition, shortest_sequence

_CLOSED = 1e-11  # relative: bracket at which the search among sequences ends
_ROUNDING = 1e-14  # of the distance
_EVEN = (1.97, 1.92, 0.05)  # from a touch to one of nearly the same jerk


def between_rests(chain: Chain, min_dwell: float, touches: int | None) -> Arcs:
    """The shortest move of a fourth-order chain between rests; the distance is not zero.

    ``min_dwell``: the least time between switches; ``touches``: at most that many at each end. Raises Unresolved where
    no sequence that keeps them could be verified, Impossible where a limit forbids to set off or to stop.
    """
    if chain.distance < 0:
        return mirrored_arcs(between_rests(chain.mirrored(), min_dwell, touches))
    for i in (1, 2, 3):
        low, high = chain.limits[i]
        if not high > 0 or (i > 1 and not low < 0):
            raise Impossible(f"no move covers {chain.distance:g} with {NAMES[i]} from {low:g} to {high:g}")
    scaled, units, time = _units(chain)
    return back_in_time(_scaled(scaled, min_dwell / time, touches), units, time)


def s_curve(chain: Chain) -> Arcs:
    """The ordinary S-curve between two rests: every ramp nested alike, at the greatest velocity where it is reached.

    Its bracket is that of the shortest move. Raises Unresolved as that does.
    """
    if chain.distance < 0:
        return mirrored_arcs(s_curve(chain.mirrored()))
    best = between_rests(chain, 0.0, None)
    scaled, units, time = _units(chain)
    arcs = accepted(scaled, Candidate([ordinary(*_sides(scaled), 1.0)]))
    if arcs is None:
        raise Unresolved("the S-curve could not be verified")
    return replace(back_in_time(arcs, units, time), lowest=best.lowest, ordinary=best.ordinary)


def _units(chain: Chain) -> tuple[Chain, tuple[float, ...], float]:
    """The chain in units of its distance and of what its snap makes of it, these units, and that of time."""
    time = (chain.distance / max(chain.top[1], -chain.top[0])) ** 0.25
    return chain.scaled(chain.distance, time), tuple(chain.distance / time**i for i in range(5)), time


def _scaled(chain: Chain, min_dwell: float, touches: int | None) -> Arcs:
    left, right = _sides(chain)
    curve = Candidate([ordinary(left, right, 1.0)])
    found: list[Candidate] = []
    lowest, chatters = -inf, False
    approach = Approach(left, right) if left.velocity < inf else None
    if approach is not None:
        lowest, chatters = approach.lowest, approach.lowest > 0
        cuts = list(approach.chattering(min_dwell, touches))
        found += cuts if chatters else [certified(chain, cut.parts) for cut in cuts]
        lowest = max([lowest, *(cut.lowest for cut in found)])

    def allowed(candidate: Candidate) -> bool:
        # a touch in the middle belongs to both ends
        few = touches is None or len(candidate.parts) <= 2 * touches + 2
        return few and keeps(candidate, min_dwell)

    if not chatters:
        for candidate in _short(chain, left, right, approach):
            found.append(candidate)
            lowest = max(lowest, candidate.lowest)
            closed = candidate.lowest >= candidate.duration * (1 - _CLOSED)
            if closed and allowed(candidate) and accepted(chain, candidate) is not None:
                break
    found.append(curve)
    for candidate in sorted(filter(allowed, found), key=lambda c: c.duration):
        if (arcs := accepted(chain, candidate)) is not None:
            bound = min(max(lowest, 0.0), arcs.duration)
            return replace(arcs, lowest=bound, ordinary=curve.duration, chatters=chatters)
    raise Unresolved("no sequence of arcs with the least spacing of switches asked for could be verified")


def _short(chain: Chain, left: Side, right: Side, approach: Approach | None) -> Iterator[Candidate]:
    """Moves that never hold the velocity: the hill, one touch, then as many as the distance suggests."""
    if (top := _hill(left, right)) is not None:
        yield certified(chain, [top])
    if approach is None or top is not None:
        return
    if (single := _single(left, right)) is not None:
        yield certified(chain, single)
        for guess in [] if left == right else _shifted(left, right, single):
            if (candidate := _polished(chain, guess, False)) is not None:
                yield candidate
    for guess in _many(approach):
        parts = [merged(part) for part in guess]
        if (candidate := _polished(chain, parts, left == right)) is not None:
            yield candidate


def _hill(left: Side, right: Side) -> Part | None:
    """The move of distance one that does not reach the velocity limit."""

    def short(size: float) -> float:
        return motion(hill(left, right, size)).distance - 1.0

    top = grow(short, 1.0, inf)
    found = hill(left, right, brentq(short, 0.0, top, xtol=1e-300, rtol=8.9e-16))
    return found if _fastest(found) <= left.velocity * (1 + 1e-13) else None


def _single(left: Side, right: Side) -> Parts | None:
    """The move of distance one with one touch, if its ramps are short enough."""
    limit = left.velocity

    def ramps(jerk: float) -> Parts:
        return [to_velocity(left, limit, jerk), backwards(to_velocity(right, limit, jerk))]

    def short(jerk: float) -> float:
        return 1.0 - sum(motion(to_velocity(side, limit, jerk)).distance for side in (left, right))

    most = min(greatest_jerk(side, limit) for side in (left, right))
    longest = short(0.0)
    if longest > _ROUNDING or short(most) < 0:
        return None
    return ramps(float(brentq(short, 0.0, most, xtol=1e-300, rtol=8.9e-16)) if longest < 0 else 0.0)


def _shifted(left: Side, right: Side, single: Parts) -> Iterator[Parts]:
    """Between unlike ends the middle switch lies beside the touch: before it or after."""
    first, second = map(merged, single)
    early = 0.2 * first[-1].duration if first[-1].top > 0 else 0.0
    if early:
        cut = first[-1]._replace(duration=4 * early)
        yield [(*first[:-1], cut, Piece(-left.back_snap, early, "snap.min")), second]
    late = 0.2 * second[0].duration if second[0].top < 0 else 0.0
    if late:
        cut = second[0]._replace(duration=4 * late)
        yield [first, (Piece(left.snap, late, "snap.max"), cut, *second[1:])]


def _many(approach: Approach) -> Iterator[Parts]:
    """Guesses with two and more touches: ideal approaches whose inner part has the length that the distance leaves."""
    scale = sum(jerk / side.snap for side, jerk in zip(approach.sides, approach.jerks, strict=True)) / 2
    law = approach.laws[0]
    gap = (approach.least_distance - 1.0) / approach.limit / scale
    level = 0
    while gap < 1.0 and level < MOST_TOUCHES:
        gap, level = gap / law.alpha, level + 1
    inner = 2 * law.limit_time - gap
    plans = sorted(
        [
            (abs(inner - 4.0), 0, _valley(4.0)),
            (_outside(inner, 4.0, 8.0), 0, _valley(inner)),
            (_outside(inner, 8.0, 8.3), 0, _EVEN),
            (_outside(inner, 8.3, 9.2), 0, law.arcs),
            (abs(inner - 9.2), 1, _valley(4.0)),
        ],
        key=lambda plan: plan[0],
    )
    for _, extra, middle in plans:
        yield _guess(approach, level + 1 + extra, middle)


def _outside(x: float, low: float, high: float) -> float:
    return max(low - x, x - high, 0.0)


def _guess(approach: Approach, count: int, middle: tuple[float, ...]) -> Parts:
    """``count`` touches from either end, then half of a middle: (up, down) of a valley, or (up, down, up) to a touch
    that both halves share. Of distance one if the first ramps can be had so."""
    shared = len(middle) == 3

    def halves(share: float) -> list[Parts]:
        out = []
        for side, law, jerk in zip(approach.sides, approach.laws, approach.jerks, strict=True):
            parts = [to_velocity(side, side.velocity, share * jerk)]
            size = share * jerk / side.snap
            for _ in range(count - 1):
                parts.append(after_touch(side, law.arcs, size))
                size *= law.alpha
            out.append([*parts, after_touch(side, middle, size)])
        return out

    def short(share: float) -> float:
        return sum(motion([p for part in half for p in part]).distance for half in halves(share)) - 1.0

    share = 1.0
    for other in (0.7, 1.3, 0.4, 1.6):
        if other * max(approach.jerks) <= approach.most and short(1.0) * short(other) < 0:
            share = float(brentq(short, 1.0, other, rtol=1e-3))
            break
    first, other_half = halves(share)
    second = [backwards(part) for part in reversed(other_half)]
    return [*first, *second] if shared else [*first[:-1], (*first[-1], *second[0]), *second[1:]]


def _valley(length: float) -> tuple[float, float]:
    """(first, second) arc from a touch (1, 0, 0) to the middle of a symmetric valley or of a hill between valleys."""
    half = min(max(length / 2, 2.0), 3.999)
    if half == 2.0:
        return 2.0, 0.0
    # from h = 2 e - 1 ± sqrt(2 e² - 4 e + 1)
    first = half - sqrt(half**2 / 2 - half)
    return (first, half - first)


def _polished(chain: Chain, guess: Parts, twins: bool) -> Candidate | None:
    """The stationary sequence near a guess; that of twin ends is found by its first half, as the other mirrors it."""
    middle = sum(len(part) for part in guess) // 2
    parts = _first_half(guess) if twins else guess
    tops = [p.top for part in parts for p in part]
    conditions = plateaus(chain, parts)
    if twins:
        shared = len(guess) % 2 == 0
        conditions += [Condition(middle, 0, 0.5), Condition(middle, 2, 0.0)]
        conditions += [Condition(middle, 1, chain.limits[1][1])] if shared else []
    else:
        conditions += [Condition(len(tops), i, x) for i, x in enumerate((1.0, 0.0, 0.0, 0.0))]
    found = shortest_sequence((0.0,) * 4, tops, conditions, [p.duration for part in parts for p in part])
    if found is None:
        return None
    left = iter(found)
    sequence: Parts = [tuple(p._replace(duration=next(left)) for p in part) for part in parts]
    if twins:
        second = [backwards(part) for part in reversed(sequence)]
        sequence = [*sequence, *second] if shared else [*sequence[:-1], (*sequence[-1], *second[0]), *second[1:]]
    return certified(chain, sequence)


def _first_half(sequence: Parts) -> Parts:
    half = sequence[: len(sequence) // 2]
    if len(sequence) % 2:
        part = sequence[len(sequence) // 2]
        half = [*half, part[: len(part) // 2]]
    return half


def _fastest(ramp: Part) -> float:
    """The velocity at the top of a hill."""
    v = a = j = best = 0.0
    for u, d, _ in ramp:
        before = a, j
        v, a, j = v + d * (a + d / 2 * (j + d / 3 * u)), a + d * (j + d / 2 * u), j + d * u
        if before[0] > 0 >= a:
            lost = brentq(lambda t, b=before, u=u: b[0] + t * (b[1] + t / 2 * u), 0.0, d, xtol=1e-300)
            t = d - lost
            best = v - t * a + t * t / 2 * (j - t / 3 * u)
    return max(best, 0.0)


def _sides(chain: Chain) -> tuple[Side, Side]:
    _, (_, v), (a0, a1), (j0, j1), (s0, s1) = chain.limits
    return Side(v, a1, j1, -j0, s1, -s0), Side(v, -a0, j1, -j0, -s0, s1)
