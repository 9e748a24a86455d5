"""Orders one to three: the shortest verified extremal, why there may be none, and the durations that are possible."""

from __future__ import annotations

from math import inf

from trajopt.switching.chain import NAMES, Arcs, Chain, Impossible, Unresolved, back_in_time
from trajopt.switching.doomed import refuse_doomed
from trajopt.switching.polynomials import audit
from trajopt.switching.third import Profile, extremals

_SAME = 1e-9  # relative: two durations are one
_EDGE = 1e-9  # relative: how much wider limits must make a move possible for it to be at the edge


class OutOfRange(Unresolved):
    """The shortest move without position limits breaks one."""


def shortest_low(chain: Chain) -> Arcs:
    """The shortest move of order one to three. Raises Impossible, Unresolved, or OutOfRange."""
    scaled, units, time = normalised(chain)
    free = _without_position(scaled)
    for profile in extremals(scaled):
        verdict = audit(free, profile.tops, profile.durations)
        if not verdict.accepted:
            continue
        verdict = audit(scaled, profile.tops, profile.durations)
        if not verdict.accepted:
            raise OutOfRange(f"the shortest move without position limits leaves {verdict.worst}")
        bound = profile.duration
        found = Arcs(profile.durations, profile.tops, profile.active, (), bound, verdict.residual, verdict.excess)
        return back_in_time(found, units, time)
    raise _nothing(chain)


def feasible_durations(chain: Chain) -> list[tuple[float, float]]:
    """Intervals (least, greatest or infinite) of the durations in which a move of order one to three is possible.

    With moving ends they need not be one: the farthest and the nearest end within a duration both grow and fall with
    it. Each is an extremal, so that the borders are the extremals that end where they should. Position limits are not
    regarded. Raises Impossible.
    """
    refuse_doomed(chain)
    scaled, _, time = normalised(chain)
    free = _without_position(scaled)
    borders: list[Profile] = []
    for profile in extremals(free):
        if audit(free, profile.tops, profile.durations).accepted and not any(_twins(profile, b) for b in borders):
            borders.append(profile)
    if not borders:
        raise _nothing(chain)
    times = [b.duration * time for b in borders]
    if len(times) % 2:
        times.append(inf)
    return list(zip(times[::2], times[1::2], strict=True))


def normalised(chain: Chain) -> tuple[Chain, tuple[float, ...], float]:
    """The chain with its top limit and the largest boundary value of order one, the units, and that of time."""
    top = max(chain.top[1], -chain.top[0])
    n = chain.order
    values = [(0, chain.distance), *((i, x) for end in (chain.start, chain.end) for i, x in enumerate(end) if i)]
    time = max(((abs(x) / top) ** (1 / (n - i)) for i, x in values), default=0.0) or 1.0
    length = top * time**n
    return chain.scaled(length, time), tuple(length / time**i for i in range(n + 1)), time


def _widened(limits: tuple[float, float]) -> tuple[float, float]:
    low, high = limits
    return low - _EDGE * abs(low), high + _EDGE * abs(high)


def _without_position(chain: Chain) -> Chain:
    return Chain(chain.order, ((-inf, inf), *chain.limits[1:]), chain.start, chain.end)


def _twins(a: Profile, b: Profile) -> bool:
    return a.upward == b.upward and abs(a.duration - b.duration) <= _SAME * b.duration


def _nothing(chain: Chain) -> Impossible | Unresolved:
    """An axis that can wait and turn about can do any move; one that cannot is bound by what keeps it from that. A move
    that would be possible within limits a little wider may be so within these: a rounding at the edge decides nothing.
    """
    wide = Chain(chain.order, tuple(map(_widened, chain.limits)), chain.start, chain.end)
    free = _without_position(normalised(wide)[0])
    if any(audit(free, profile.tops, profile.durations).accepted for profile in extremals(free)):
        return Unresolved("the move is at the edge of what is possible")
    for name, (low, high) in zip(NAMES[1:], chain.limits[1:], strict=False):
        if not low < 0 < high:
            return Impossible(f"no move covers {chain.distance:g} with {name} from {low:g} to {high:g}")
    return Unresolved("no extremal of this move could be verified")
