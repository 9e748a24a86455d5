"""A sketched sequence of arcs made exact: switching times by Newton, verdict, repair, touches beside a plateau."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from math import fsum, inf

from trajopt.switching.certificate import impossible, reach_beyond
from trajopt.switching.chain import NAMES, Arcs, Chain
from trajopt.switching.coarse import Sketch
from trajopt.switching.multipliers import multipliers
from trajopt.switching.polynomials import Audit, audit
from trajopt.switching.repair import endings, with_limit, with_touches, without_shortest
from trajopt.switching.stationary import Condition, shortest_sequence

EXTREMAL = 1e-10  # relative gap
_CUT_OFF = 1e-8  # the same where chattering was cut off
_REPAIRS = 8
_SHARES = (1.0, 0.7, 0.4, 0.2)  # of the jerk of a self-similar touch, where a new one is begun


@dataclass(frozen=True)
class Verified:
    """A verified sequence; ``beyond``: what its multipliers leave possible in a share of its duration."""

    sketch: Sketch
    audit: Audit
    beyond: tuple[float, ...]

    @cached_property
    def gap(self) -> float:
        """The duration by which it may be short of an extremal; infinite when the multipliers show nothing."""
        rate = sum(k * c for k, c in enumerate(self.beyond)) / self.duration
        return max(0.0, fsum(self.beyond)) / rate if rate > 0 else inf

    @property
    def is_extremal(self) -> bool:
        """But for chattering that was cut off."""
        return self.gap <= (_CUT_OFF if self.chatters else EXTREMAL) * self.duration

    def impossible(self, floor: float) -> tuple[float, float]:
        """Durations between which no move is possible, nor below ``floor``."""
        if floor >= self.duration:
            return floor, floor
        low, high = impossible(self.beyond, floor / self.duration)
        return max(low * self.duration, floor), high * self.duration

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

    @property
    def chatters(self) -> bool:
        return {"snap", "velocity"} <= {p.active.partition(".")[0] for p in self.sketch.pieces}


def with_more_touches(chain: Chain, found: Verified, rounds: int) -> list[Verified]:
    """The sequence, and with more and more touches before and after each plateau of velocity."""
    out = [found]
    for _ in range(rounds):
        if chain.order < 4 or out[-1].gap <= EXTREMAL * out[-1].duration:
            break
        again = _more_touches(chain, out[-1].sketch)
        if again is None or (again.duration >= out[-1].duration and again.gap >= out[-1].gap):
            break
        out.append(again)
    return out


def _more_touches(chain: Chain, sketch: Sketch) -> Verified | None:
    """With a touch more beside each plateau of velocity, or at one end of one: first with its jerk prescribed, then
    freed."""
    for share in _SHARES:
        every = endings(chain, sketch, share)
        for some in [every, *([e] for e in every if len(every) > 1)]:
            more, jerks = with_touches(sketch, some)
            pinned = _solved(chain, more, [*_conditions(chain, more), *jerks], True) if some else None
            if pinned and (found := refined(chain, pinned, True)):
                return found
    return None


def refined(chain: Chain, sketch: Sketch, local: bool) -> Verified | None:
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
        verdict = audit(chain, [p.top for p in sketch.pieces], [p.duration for p in sketch.pieces])
        if verdict.accepted:
            return Verified(sketch, verdict, _beyond(chain, sketch))
        if (held := with_limit(chain, sketch, verdict.worst)) is None:
            return None
        sketch = held
    return None


def _beyond(chain: Chain, sketch: Sketch) -> tuple[float, ...]:
    active, durations = [p.active for p in sketch.pieces], [p.duration for p in sketch.pieces]
    touched = {(t.arcs, t.derivative + 1) for t in sketch.touches}
    conditions = [c for c in _conditions(chain, sketch) if (c.arcs, c.derivative) not in touched]
    prices = multipliers(chain.order, active, durations, conditions)
    ways = (reach_beyond(chain, active, durations, conditions, [way * p for p in prices]) for way in (1.0, -1.0))
    return min(ways, key=fsum)


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


def as_arcs(found: Verified, lowest: float) -> Arcs:
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
        chatters=found.chatters,
        gap=found.gap,
    )
