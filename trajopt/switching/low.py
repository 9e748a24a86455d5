"""Orders one to three: the shortest verified extremal, why there may be none, and the durations that are possible."""

from __future__ import annotations

from math import inf

from trajopt.switching.chain import NAMES, Arcs, Chain, Impossible, Unresolved, back_in_time
from trajopt.switching.polynomials import audit
from trajopt.switching.third import Profile, extremals

_SAME = 1e-9  # relative: two durations are one


class OutOfRange(Unresolved):
    """The shortest move without position limits breaks one."""


def shortest_low(chain: Chain) -> Arcs:
    """The shortest move of order one to three. Raises Impossible, Unresolved, or OutOfRange."""
    refuse_doomed(chain)
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


def refuse_doomed(chain: Chain) -> None:
    """Raise Impossible if a boundary state breaks a limit, or must before or after."""
    for name, end, sense in (("start", chain.start, 1.0), ("end", chain.end, -1.0)):
        for i, (x, (low, high)) in enumerate(zip(end, chain.limits, strict=False)):
            if not low - _slack(low, x) <= x <= high + _slack(high, x):
                raise Impossible(f"the {NAMES[i]} at the {name} is {x:g}, outside its limits {low:g} to {high:g}")
        if chain.order >= 2:
            i = chain.order - 2
            x, rate = end[i], sense * end[i + 1]
            way = 1 if rate > 0 else -1
            stop = chain.limits[i][rate > 0]
            reached = x + way * rate**2 / 2 / (-chain.top[0] if rate > 0 else chain.top[1])
            if (reached - stop) * way > _slack(stop, x):
                when = "after" if sense > 0 else "before"
                raise Impossible(f"{when} the {name} the {NAMES[i]} must reach {reached:g}, beyond its limit {stop:g}")


def normalised(chain: Chain) -> tuple[Chain, tuple[float, ...], float]:
    """The chain with its top limit and the largest boundary value of order one, the units, and that of time."""
    top = max(chain.top[1], -chain.top[0])
    n = chain.order
    values = [(0, chain.distance), *((i, x) for end in (chain.start, chain.end) for i, x in enumerate(end) if i)]
    time = max(((abs(x) / top) ** (1 / (n - i)) for i, x in values), default=0.0) or 1.0
    length = top * time**n
    return chain.scaled(length, time), tuple(length / time**i for i in range(n + 1)), time


def _slack(limit: float, value: float) -> float:
    return 1e-12 * max(abs(limit), abs(value)) if abs(limit) < inf else 0.0


def _without_position(chain: Chain) -> Chain:
    return Chain(chain.order, ((-inf, inf), *chain.limits[1:]), chain.start, chain.end)


def _twins(a: Profile, b: Profile) -> bool:
    return a.upward == b.upward and abs(a.duration - b.duration) <= _SAME * b.duration


def _nothing(chain: Chain) -> Impossible | Unresolved:
    low, high = chain.limits[1]
    if chain.order > 1 and low < 0 < high:
        return Unresolved("no extremal of this move could be verified")
    return Impossible(f"no move covers {chain.distance:g} with a velocity from {low:g} to {high:g}")
