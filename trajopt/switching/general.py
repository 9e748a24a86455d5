"""Any chain: structure from a coarse linear program, switching times by Newton, verdict, repair."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate
from math import fsum, inf, isfinite

from trajopt.switching.certificate import shortfall
from trajopt.switching.chain import NAMES, Arcs, Chain, Unresolved, back_in_time
from trajopt.switching.coarse import Grid, Sketch
from trajopt.switching.low import normalised, shortest_low
from trajopt.switching.polynomials import Audit, audit
from trajopt.switching.repair import with_limit, with_touches, without_shortest
from trajopt.switching.stationary import Condition, prices_of, shortest_sequence

_GRIDS = (60, 90, 120, 170)  # intervals, the first of them to find the duration
_SHORTEST, _LONGEST, _GROWTH = 0.2, 200.0, 1.1  # of the normalised time: where the first possible duration is sought
_CLOSE = 1e-3  # relative: width of the bracket from which the structure is read
_REPAIRS = 8
_ROUNDS = 3  # touches added at each end of a plateau of velocity
_SHARES = (1.0, 0.7, 0.4, 0.2)  # of the jerk of a self-similar touch, where a new one is begun
_NEAR = 0.02  # relative: a structure this much longer than the coarse move is not that of the coarse move
_EXTREMAL = 1e-10  # relative gap
_CUT_OFF = 1e-5  # the same where chattering was cut off, which leaves a gap far above the loss of duration


@dataclass(frozen=True)
class _Found:
    """A verified sequence; ``gap``: the duration by which its multipliers leave it short of an extremal."""

    sketch: Sketch
    audit: Audit
    gap: float

    @property
    def duration(self) -> float:
        return fsum(p.duration for p in self.sketch.pieces)

    @property
    def dwell(self) -> float:
        return min(p.duration for p in self.sketch.pieces)

    @property
    def touches(self) -> int:
        """Of a limit of velocity."""
        return sum(t.derivative == 1 for t in self.sketch.touches)


def shortest_general(chain: Chain, min_dwell: float, touches: int | None) -> Arcs:
    """A verified move whose structure a coarse program shows.

    It is preferred to be an extremal, shown by its multipliers: then no move of the same duration reaches farther. Its
    lower bound is that of lower orders. Raises Impossible, or Unresolved if no move can be verified.
    """
    scaled, units, time = normalised(chain)
    lowest = _lower_orders(scaled)
    duration = _first_possible(scaled, lowest)
    found: list[_Found] = []
    for intervals in _GRIDS:
        grid = Grid(scaled, duration, intervals)
        for way in (1.0, -1.0):
            if (tops := grid.farthest(way)) is None:
                continue
            for local in (True, False):
                if (one := _refined(scaled, grid.sketch(tops), local)) is not None:
                    found += _chattering(scaled, one, _ROUNDS if touches is None else touches)
                    if one.gap <= _EXTREMAL * one.duration:
                        break
        found = [f for f in found if f.duration <= duration * (1 + _NEAR) and f.dwell * time >= min_dwell]
        found = [f for f in found if touches is None or f.touches <= 2 * touches]
        if any(f.gap <= (_CUT_OFF if _chatters(f) else _EXTREMAL) * f.duration for f in found):
            break
    if not found:
        raise Unresolved("no structure that a coarse program shows could be verified")
    best = min(found, key=lambda f: f.duration)
    return back_in_time(_arcs(best, min(lowest, best.duration)), units, time)


def _chatters(found: _Found) -> bool:
    return {"snap", "velocity"} <= {p.active.partition(".")[0] for p in found.sketch.pieces}


def _chattering(chain: Chain, found: _Found, rounds: int) -> list[_Found]:
    """The sequence, and with more and more touches before and after each plateau of velocity."""
    out = [found]
    for _ in range(rounds):
        if chain.order < 4 or out[-1].gap <= _EXTREMAL * out[-1].duration:
            break
        again = _more_touches(chain, out[-1].sketch)
        if again is None or again.duration >= out[-1].duration:
            break
        out.append(again)
    return out


def _more_touches(chain: Chain, sketch: Sketch) -> _Found | None:
    """With a touch more beside each plateau of velocity: first with its jerk prescribed, then freed."""
    for share in _SHARES:
        if (more := with_touches(chain, sketch, share)) is None:
            return None
        conditions = [*_conditions(chain, more[0]), *more[1]]
        if (pinned := _solved(chain, more[0], conditions, True)) and (found := _refined(chain, pinned, True)):
            return found
    return None


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


def _refined(chain: Chain, sketch: Sketch, local: bool) -> _Found | None:
    """The stationary sequence of a sketch, repaired until it is verified: arcs that vanish go, limits that are broken
    are held or touched."""
    for _ in range(_REPAIRS):
        conditions = _conditions(chain, sketch)
        if (solved := _solved(chain, sketch, conditions, local)) is None:
            if (smaller := without_shortest(sketch)) is None:
                return None
            sketch = smaller
            continue
        sketch = solved
        tops, durations, active = zip(*((p.top, p.duration, p.active) for p in sketch.pieces), strict=True)
        verdict = audit(chain, tops, durations)
        if verdict.accepted:
            prices = prices_of((0.0, *chain.start[1:]), tops, conditions, durations)
            return _Found(sketch, verdict, shortfall(chain, active, durations, conditions, prices))
        if (held := with_limit(chain, sketch, verdict.worst)) is None:
            return None
        sketch = held
    return None


def _solved(chain: Chain, sketch: Sketch, conditions: list[Condition], local: bool) -> Sketch | None:
    """The sketch with stationary durations."""
    tops, durations, _ = zip(*sketch.pieces, strict=True)
    if len(conditions) > len(tops):
        return None
    found = shortest_sequence((0.0, *chain.start[1:]), tops, conditions, durations, local)
    if found is None:
        return None
    return Sketch(tuple(p._replace(duration=d) for p, d in zip(sketch.pieces, found, strict=True)), sketch.touches)


def _conditions(chain: Chain, sketch: Sketch) -> list[Condition]:
    out = []
    for number, piece in enumerate(sketch.pieces):
        name, _, side = piece.active.partition(".")
        i = NAMES.index(name)
        if i < chain.order and number:
            out.append(Condition(number, i, chain.limits[i][side == "max"]))
            out += [Condition(number, k, 0.0) for k in range(i + 1, chain.order)]
    for touch in sketch.touches:
        out.append(Condition(touch.arcs, touch.derivative, chain.limits[touch.derivative][touch.upper]))
        out.append(Condition(touch.arcs, touch.derivative + 1, 0.0))
    goal = (chain.distance, *chain.end[1:])
    return out + [Condition(len(sketch.pieces), i, x) for i, x in enumerate(goal)]


def _arcs(found: _Found, lowest: float) -> Arcs:
    pieces, verdict = found.sketch.pieces, found.audit
    ends = list(accumulate(p.duration for p in pieces))
    touches = tuple(
        (ends[t.arcs - 1], f"{NAMES[t.derivative]}.{'max' if t.upper else 'min'}") for t in found.sketch.touches
    )
    durations, tops, active = zip(*((p.duration, p.top, p.active) for p in pieces), strict=True)
    return Arcs(
        durations,
        tops,
        active,
        touches,
        lowest,
        verdict.residual,
        verdict.excess,
        chatters=_chatters(found),
        gap=found.gap,
    )
