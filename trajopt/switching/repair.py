"""Changes to a sketched sequence of arcs: an arc less, a broken limit held, touches added beside a plateau."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import sqrt

from trajopt.switching.chain import NAMES, Chain
from trajopt.switching.chatter import Chattering, chattering
from trajopt.switching.coarse import Sketch, Touch
from trajopt.switching.polynomials import instants, states, value
from trajopt.switching.ramps import Piece
from trajopt.switching.stationary import Condition

_TOUCH = 0.23  # share of the last arc of a ramp that the jerk of a first touch would take, measured on ramps from rest


def without_shortest(sketch: Sketch) -> Sketch | None:
    """Without its shortest arc, and the touch at its end; neighbours that become one are joined."""
    if len(sketch.pieces) <= 2:
        return None
    gone = min(range(len(sketch.pieces)), key=lambda k: sketch.pieces[k].duration)
    pieces = [p for k, p in enumerate(sketch.pieces) if k != gone]
    touches = [Touch(t.arcs - (t.arcs > gone), t.derivative, t.upper) for t in sketch.touches if t.arcs != gone + 1]
    alike = 0 < gone < len(pieces) and pieces[gone - 1].active == pieces[gone].active
    if alike and not any(t.arcs == gone for t in touches):
        joined = pieces[gone - 1]._replace(duration=pieces[gone - 1].duration + pieces[gone].duration)
        pieces[gone - 1 : gone + 1] = [joined]
        touches = [Touch(t.arcs - (t.arcs > gone), t.derivative, t.upper) for t in touches]
    return Sketch(tuple(pieces), tuple(touches))


def with_limit(chain: Chain, sketch: Sketch, limit: str) -> Sketch | None:
    """A limit that is broken is held where it is broken most, or touched if it is more than two below the top or of the
    position."""
    name, _, side = limit.partition(".")
    i = NAMES.index(name) if name in NAMES else chain.order
    if i >= chain.order:
        return None
    way = 1.0 if side == "max" else -1.0
    arc, time = max(_peaks(chain, sketch, i), key=lambda peak: way * peak[2])[:2]
    pieces, piece = list(sketch.pieces), sketch.pieces[arc]
    first, last = piece._replace(duration=time), piece._replace(duration=piece.duration - time)
    parts = [p for p in (first, last) if p.duration > 1e-9 * piece.duration]
    border = arc + (parts[0] is first)
    held = i > 0 and i >= chain.order - 2
    if held:
        short = Piece(0.0, 0.1 * min(p.duration for p in pieces), limit)
        parts.insert(border - arc, short)
    pieces[arc : arc + 1] = parts
    grown = len(pieces) - len(sketch.pieces)
    touches = [Touch(t.arcs + (grown if t.arcs > arc else 0), t.derivative, t.upper) for t in sketch.touches]
    if not held:
        touches.append(Touch(border, i, side == "max"))
    return Sketch(tuple(pieces), tuple(touches))


def _peaks(chain: Chain, sketch: Sketch, derivative: int) -> Iterator[tuple[int, float, float]]:
    """(arc, time in it, value) where a derivative may be extreme."""
    tops, durations = [p.top for p in sketch.pieces], [p.duration for p in sketch.pieces]
    borders = states((0.0, *chain.start[1:]), tops, durations)
    for k, (state, top, duration) in enumerate(zip(borders, tops, durations, strict=False)):
        for t in (*instants(state, top, duration, derivative + 1), duration):
            yield k, t, value(state, top, t, derivative)


@dataclass(frozen=True)
class Ending:
    """What takes the place of ``used`` arcs from number ``first`` on, beside a plateau of velocity: arcs before and
    after a new touch of its limit, and the jerk there."""

    first: int
    used: int
    upper: bool
    before: list[Piece]
    after: list[Piece]
    jerk: float


def with_touches(sketch: Sketch, endings: Sequence[Ending]) -> tuple[Sketch, list[Condition]]:
    """The sketch with these touches, and the jerks there."""
    pieces: list[Piece] = []
    touches: list[Touch] = []
    jerks: list[Condition] = []
    old, new = {t.arcs: t for t in sketch.touches}, {e.first: e for e in endings}
    k = 0
    while k < len(sketch.pieces):
        if (ending := new.get(k)) is None:
            pieces.append(sketch.pieces[k])
            k += 1
        else:
            pieces += ending.before
            touches.append(Touch(len(pieces), 1, ending.upper))
            jerks.append(Condition(len(pieces), 3, ending.jerk))
            pieces += ending.after
            k += ending.used
        if k in old:
            touches.append(Touch(len(pieces), old[k].derivative, old[k].upper))
    return Sketch(tuple(pieces), tuple(touches)), jerks


def endings(chain: Chain, sketch: Sketch, share: float) -> list[Ending]:
    """A touch more beside each plateau of velocity, with a share of the jerk of a self-similar approach: the smaller,
    the less the rest of the move changes."""
    found: list[Ending] = []
    for k in range(len(sketch.pieces)):
        for used in (3, 1):
            for towards in (True, False):
                free = not found or found[-1].first + found[-1].used <= k
                if free and (ending := _ending(chain, sketch, k, used, towards, share)) is not None:
                    found.append(ending)
    return found


def _ending(chain: Chain, sketch: Sketch, k: int, used: int, towards: bool, share: float) -> Ending | None:
    """For the arcs from number k on, if they end at a plateau of velocity (or begin there): one arc that no touch
    precedes (or follows), or the three after one (or before)."""
    pieces, touched = sketch.pieces, {t.arcs for t in sketch.touches if t.derivative == 1}
    last = k + used
    plateau, free = (last, k) if towards else (k - 1, last)
    if not (0 <= plateau < len(pieces) and 0 < free < len(pieces) and last <= len(pieces)):
        return None
    if not pieces[plateau].active.startswith("velocity") or (free in touched) != (used == 3):
        return None
    upper = pieces[plateau].active == "velocity.max"
    back, forth = chain.top if upper == towards else chain.top[::-1]
    if pieces[k].top != forth:
        return None
    law, old = chattering(abs(back / forth)), [p.duration for p in pieces[k:last]]
    if used == 3:
        size = sum(old) / sum(law.greedy)
        scale = law.alpha * size * share
        first = [d * size for d in law.arcs] if share == 1 else old if towards else old[::-1]
    else:
        scale = _first_touch(law, old[0], pieces[k - 1 if towards else last]) * old[0] * share
        first = old
    if used == 1 or share < 1:
        first[-1] -= scale
    before, after = (_alternate(chain, forth, back, d) for d in (first, [d * scale for d in law.greedy]))
    if not towards:
        before, after = after[::-1], before[::-1]
    return Ending(k, used, upper, before, after, (-1.0 if upper else 1.0) * abs(forth) * scale)


def _first_touch(law: Chattering, ramp: float, beside: Piece) -> float:
    """The jerk c of a first touch, as a share of that before the ramp. Beside a plateau of jerk of p ramps' length the
    velocity that it gains for the rest of the move, p/2 (1/24 - ∫ c (1 - c)² dc / 2), is weighed against the loss
    of law.cost c^4 to come."""
    if not beside.active.startswith("jerk"):
        return _TOUCH
    return max(_TOUCH, 1 / (1 + sqrt(16 * law.cost * ramp / beside.duration)))


def _alternate(chain: Chain, forth: float, back: float, durations: list[float]) -> list[Piece]:
    name = NAMES[chain.order]
    tops = [forth if i % 2 == 0 else back for i in range(len(durations))]
    return [Piece(u, d, f"{name}.{'max' if u > 0 else 'min'}") for u, d in zip(tops, durations, strict=True)]
