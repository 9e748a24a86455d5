"""Any chain: structure from the third order or a coarse linear program, switching times by Newton, verdict, repair."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite

from trajopt.switching.chain import Arcs, Chain, Unresolved, back_in_time
from trajopt.switching.coarse import Grid
from trajopt.switching.cover import ruled_out
from trajopt.switching.from_third import sketches
from trajopt.switching.low import normalised, shortest_low
from trajopt.switching.refine import EXTREMAL, Verified, as_arcs, refined, with_more_touches

_GRIDS = (60, 90, 120, 170)  # intervals, the first of them to find the duration
_SHORTEST, _LONGEST, _GROWTH = 0.2, 200.0, 1.1  # of the normalised time: where the first possible duration is sought
_CLOSE = 1e-3  # relative: width of the bracket from which the structure is read
_ROUNDS = 3  # touches added at each end of a plateau of velocity
OPEN, CUT_OFF = 1e-9, 1e-7  # relative: a loss that only a wrong structure leaves, and where chattering is cut off
_SAME = 1e-11  # relative: durations that rounding tells apart
_NEAR = 0.02  # relative: a structure this much longer than the coarse move is not that of the coarse move


def shortest_general(chain: Chain, min_dwell: float, touches: int | None) -> Arcs:
    """A verified move whose structure a third-order move or a coarse program shows.

    It is preferred to be an extremal, shown by its multipliers: then no move of the same duration reaches farther, and
    they bound the least duration too. Raises Impossible, or Unresolved if no move can be verified.
    """
    scaled, units, time = normalised(chain)
    floor = _lower_orders(scaled)

    def allowed(one: Verified) -> bool:
        return one.dwell * time >= min_dwell and (touches is None or one.touches <= 2 * touches)

    rounds = _ROUNDS if touches is None else touches
    found = list(filter(allowed, _from_third_order(scaled, rounds)))
    best, lowest = _judged(scaled, floor, found)
    cut = touches is not None or min_dwell > 0
    if best is None or (not cut and lowest < best.duration * (1 - (CUT_OFF if best.chatters else OPEN))):
        found += filter(allowed, _from_grids(scaled, floor, rounds, allowed))
        best, lowest = _judged(scaled, floor, found)
    if best is None:
        raise Unresolved("no structure that a third-order move or a coarse program shows could be verified")
    return back_in_time(as_arcs(best, lowest), units, time)


def _judged(chain: Chain, floor: float, found: list[Verified]) -> tuple[Verified | None, float]:
    """The shortest sequence, and a lower bound on the least duration: ``floor``, or where the multipliers of one rule
    out those between."""
    if not found:
        return None, floor
    least = min(one.duration for one in found) * (1 + _SAME)
    best = max((one for one in found if one.duration <= least), key=lambda one: one.dwell)
    spans = [one.impossible(floor) for one in found]
    low, high = max((span for span in spans if span[1] <= least), key=lambda span: span[1], default=(floor, floor))
    if low > floor and (reached := ruled_out(chain, floor, low)) < low:
        high = reached
    return best, min(high, best.duration)


def _from_third_order(chain: Chain, rounds: int) -> list[Verified]:
    found: list[Verified] = []
    for sketch in sketches(chain) if chain.order == 4 else ():
        for local in (True, False):
            if (one := refined(chain, sketch, local)) is not None:
                found += with_more_touches(chain, one, rounds)
                if found[-1].is_extremal:
                    return found
    return found


def _from_grids(chain: Chain, floor: float, rounds: int, allowed: Callable[[Verified], bool]) -> list[Verified]:
    duration = _first_possible(chain, floor)
    found: list[Verified] = []
    for intervals in _GRIDS:
        grid = Grid(chain, duration, intervals)
        for way in (1.0, -1.0):
            if (tops := grid.farthest(way)) is None:
                continue
            for local in (True, False):
                if (one := refined(chain, grid.sketch(tops), local)) is not None:
                    found += with_more_touches(chain, one, rounds)
                    if one.gap <= EXTREMAL * one.duration:
                        break
        found = [one for one in found if one.duration <= duration * (1 + _NEAR) and allowed(one)]
        if any(one.is_extremal for one in found):
            break
    return found


def _lower_orders(chain: Chain) -> float:
    """The longest of the least durations without the limits on snap, jerk, ...: none can be beaten. Raises Impossible
    if one of them has no move."""
    found = [0.0]
    for order in range(1, chain.order + (chain.order < 4)):
        limits = chain.limits[: order + 1]
        if all(map(isfinite, limits[-1])) and limits[-1][0] < 0 < limits[-1][1]:
            part = Chain(order, ((-inf, inf), *limits[1:]), chain.start[:order], chain.end[:order])
            try:
                found.append(shortest_low(part).duration if part.start != part.end else 0.0)
            except Unresolved:
                continue
    return max(found)


def _first_possible(chain: Chain, lowest: float) -> float:
    """A duration in which a coarse move is possible, close above one in which none is."""
    low, high = 0.0, max(_SHORTEST, 0.98 * lowest)
    while not Grid(chain, high, _GRIDS[0]).reaches():
        low, high = high, high * _GROWTH
        if high > _LONGEST + 10 * lowest:
            raise Unresolved("no duration was found in which a coarse move is possible")
    while low and high / low > 1 + _CLOSE:
        middle = (low + high) / 2
        low, high = (low, middle) if Grid(chain, middle, _GRIDS[0]).reaches() else (middle, high)
    return high


