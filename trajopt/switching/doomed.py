"""Boundary states from which, or to which, no move keeps the limits."""

from __future__ import annotations

from math import inf, isfinite

from trajopt.switching.chain import NAMES, Chain, Impossible
from trajopt.switching.polynomials import advance, extremes

_ROUNDING = 1e-12


def refuse_doomed(chain: Chain) -> None:
    """Raise Impossible if a boundary state breaks a limit, or must after the start or before the end."""
    for name, end in (("start", chain.start), ("end", chain.end)):
        for i, (x, (low, high)) in enumerate(zip(end, chain.limits, strict=False)):
            if not low - _slack(low, x) <= x <= high + _slack(high, x):
                raise Impossible(f"the {NAMES[i]} at the {name} is {x:g}, outside its limits {low:g} to {high:g}")
    for when, ahead, turned in (("after the start", chain, 1.0), ("before the end", chain.reversed(), -1.0)):
        if not any(ahead.start[1:]):  # at rest nothing has to change
            continue
        for side, way in ((ahead, 1.0), (ahead.mirrored(), -1.0)):
            for i in range(chain.order - 1):
                limit, reached = side.limits[i][1], _unavoidable(side, i)
                if reached > limit + _slack(limit, side.start[i]):
                    sign = way * (turned if i % 2 else 1.0)
                    raise Impossible(
                        f"{when} the {NAMES[i]} must reach {sign * reached:g}, beyond its limit {sign * limit:g}"
                    )


def _unavoidable(chain: Chain, derivative: int) -> float:
    """The greatest value of a derivative when the top one brakes as hard as it can, and then the one below the top as
    long as it takes: no move stays lower, at any time. Minus infinity where there is no limit to compare with."""
    limit, n = chain.limits[derivative][1], chain.order
    if limit == inf:
        return -inf
    low, floor = chain.top[0], chain.limits[n - 1][0]
    brake = (chain.start[n - 1] - floor) / -low if derivative < n - 1 and isfinite(floor) else inf
    if brake <= 0:
        state, greatest = chain.start, chain.start[derivative]
    else:
        span = min(brake, _span(chain.start, low, derivative))
        state, greatest = advance(chain.start, low, span), extremes(chain.start, low, span, derivative)[1]
    if floor < 0 and brake < inf:
        greatest = max(greatest, extremes(state, 0.0, _span(state, 0.0, derivative), derivative)[1])
    return greatest


def _span(state: tuple[float, ...], top: float, derivative: int) -> float:
    """A time after which a derivative falls for good, all those between it and the top being negative."""
    span = 1.0
    while any(x > 0 for x in advance(state, top, span)[derivative + 1 :]):
        span *= 2
    return span


def _slack(limit: float, value: float) -> float:
    return _ROUNDING * max(abs(limit), abs(value)) if isfinite(limit) else 0.0
