"""Any chain: structure from a coarse linear program, switching times by Newton, verdict, repair."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate
from math import fsum, inf, isfinite

from trajopt.switching.certificate import shortfall
from trajopt.switching.chain import NAMES, Arcs, Chain, Unresolved, back_in_time
from trajopt.switching.coarse import Grid, Sketch
from trajopt.switching.low import normalised, shortest_low
from trajopt.switching.polynomials import Audit, audit
from trajopt.switching.repair import GROWTH, with_limit, with_touches, without_shortest
from trajopt.switching.stationary import Condition, shortest_sequence

_COARSE, _FINE = 60, 120
_SHORTEST, _LONGEST, _GROWTH = 0.2, 200.0, 1.1  # of the normalised time: where the first possible duration is sought
_CLOSE = 1e-3  # relative: width of the bracket from which the structure is read
_REPAIRS = 8
_ROUNDS = 3  # touches added at each end of a plateau of velocity
_NEAR = 0.02  # relative: a structure this much longer than the coarse move is not that of the coarse move
_EXTREMAL = 1e-10  # relative gap


@dataclass(frozen=True)
class _Found:
    """A verified sequence; ``gap``: the duration by which its multipliers leave it short of an extremal."""

    sketch: Sketch
    audit: Audit
    gap: float

    @property
    def duration(self) -> float:
        return fsum(p.duration for p in self.sketch.pieces)


def shortest_general(chain: Chain, min_dwell: float, touches: int | None) -> Arcs:
    """A verified move whose structure a coarse program shows.

    It is preferred to be an extremal, shown by its multipliers: then no move of the same duration reaches farther. Its
    lower bound is that of lower orders. Raises Impossible, or Unresolved if no move can be verified.
    """
    scaled, units, time = normalised(chain)
    lowest = _lower_orders(scaled)
    duration = _first_possible(scaled, lowest)
    found: list[_Found] = []
    for intervals in (_COARSE, _FINE):
        grid = Grid(scaled, duration, intervals)
        for way in (1.0, -1.0):
            tops = grid.farthest(way)
            if tops is not None and (one := _refined(scaled, grid.sketch(tops))) is not None:
                found += _chattering(scaled, one, _ROUNDS if touches is None else touches)
        found = [f for f in found if f.duration <= duration * (1 + _NEAR) and _dwell(f) * time >= min_dwell]
        if any(f.gap <= _EXTREMAL * f.duration for f in found):
            break
    if not found:
        raise Unresolved("no structure that a coarse program shows could be verified")
    best = min(found, key=lambda f: f.duration)
    return back_in_time(_arcs(best, min(lowest, best.duration)), units, time)


def _dwell(found: _Found) -> float:
    return min(p.duration for p in found.sketch.pieces)


def _chattering(chain: Chain, found: _Found, rounds: int) -> list[_Found]:
    """The sequence, and with more and more touches before and after each plateau of velocity."""
    out = [found]
    for _ in range(rounds):
        if chain.order < 4 or out[-1].gap <= _EXTREMAL * out[-1].duration:
            break
        if (more := with_touches(chain, out[-1].sketch)) is None:
            break
        again = _refined(chain, _grown(chain, *more))
        if again is None or again.duration >= out[-1].duration:
            break
        out.append(again)
    return out


def _grown(chain: Chain, sketch: Sketch, jerks: list[Condition]) -> Sketch:
    """A sketch with new touches whose jerks grow to those of a self-similar approach, as far as they will."""
    for step in (1, 2, 3, 4, 5, 6):
        pins = [replace(c, value=c.value * GROWTH ** ((step - 1) / 5)) for c in jerks]
        if (solved := _solved(chain, sketch, [*_conditions(chain, sketch), *pins])) is None:
            break
        sketch = solved[0]
    return sketch


def _lower_orders(chain: Chain) -> float:
    """The longest of the least durations without the limits on snap, jerk, ...: none can be beaten. Raises Impossible
    if one of them has no move."""
    found = [0.0]
    for order in range(1, chain.order + (chain.order < 4)):
        limits = chain.limits[: order + 1]
        if all(map(isfinite, limits[-1])) and (order == 1 or limits[-1][0] < 0 < limits[-1][1]):
            part = Chain(order, ((-inf, inf), *limits[1:]), chain.start[:order], chain.end[:order])
            try:
                found.append(shortest_low(part).duration if part.start != part.end else 0.0)
            except Unresolved:
                continue
    return max(found)


def _first_possible(chain: Chain, lowest: float) -> float:
    """A duration in which a coarse move is possible, close above one in which none is."""
    low, high = 0.0, max(_SHORTEST, 0.98 * lowest)
    while not Grid(chain, high, _COARSE).reaches():
        low, high = high, high * _GROWTH
        if high > _LONGEST + 10 * lowest:
            raise Unresolved("no duration was found in which a coarse move is possible")
    while low and high / low > 1 + _CLOSE:
        middle = (low + high) / 2
        low, high = (low, middle) if Grid(chain, middle, _COARSE).reaches() else (middle, high)
    return high


def _refined(chain: Chain, sketch: Sketch) -> _Found | None:
    """The stationary sequence of a sketch, repaired until it is verified: arcs that vanish go, limits that are broken
    are held or touched."""
    for _ in range(_REPAIRS):
        conditions = _conditions(chain, sketch)
        if (solved := _solved(chain, sketch, conditions)) is None:
            if (smaller := without_shortest(sketch)) is None:
                return None
            sketch = smaller
            continue
        sketch, prices = solved
        tops, durations, active = zip(*((p.top, p.duration, p.active) for p in sketch.pieces), strict=True)
        verdict = audit(chain, tops, durations)
        if verdict.accepted:
            return _Found(sketch, verdict, shortfall(chain, active, durations, conditions, prices))
        if (held := with_limit(chain, sketch, verdict.worst)) is None:
            return None
        sketch = held
    return None


def _solved(chain: Chain, sketch: Sketch, conditions: list[Condition]) -> tuple[Sketch, tuple[float, ...]] | None:
    """The sketch with stationary durations, and the prices of its conditions."""
    tops, durations, _ = zip(*sketch.pieces, strict=True)
    if len(conditions) > len(tops):
        return None
    found = shortest_sequence((0.0, *chain.start[1:]), tops, conditions, durations)
    if found is None:
        return None
    pieces = tuple(p._replace(duration=d) for p, d in zip(sketch.pieces, found.durations, strict=True))
    return Sketch(pieces, sketch.touches), found.prices


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
    limits = {name.partition(".")[0] for name in active}
    return Arcs(
        durations,
        tops,
        active,
        touches,
        lowest,
        verdict.residual,
        verdict.excess,
        chatters={"snap", "velocity"} <= limits,
    )
