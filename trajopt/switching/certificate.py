"""A certified lower bound on the duration of a move between rests, from any multipliers of its conditions.

For costates w_0 = 1, w_i' = -w_(i-1) + m_i, with m_i any measure, integration by parts gives for every move between
rests x_0(T) = ∫ w_(n-1) x_n dt + sum ∫ x_i dm_i. This is at most ∫ |w_(n-1)| · (limit of x_n) + sum (limit of x_i) ·
(mass of m_i), each by sign. Stretching the costates to another duration k T scales these terms by k^n and k^i. Where
the sum falls below the distance no move of that duration exists, nor a shorter one, which could have waited.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial, inf, isfinite

from scipy.optimize import brentq

from trajopt.switching.chain import NAMES, Chain
from trajopt.switching.polynomials import real_roots
from trajopt.switching.stationary import Condition

Masses = dict[tuple[int, bool], float]


def lower_bound(
    chain: Chain,
    active: Sequence[str],
    durations: Sequence[float],
    conditions: Sequence[Condition],
    prices: Sequence[float],
) -> float:
    """The largest duration shown to be too short, for a distance > 0; zero when the multipliers show nothing.

    ``active``: the limit of each arc; ``conditions`` and their ``prices`` as in the first-order conditions of those
    arcs, among them the position at the end.
    """
    price = _price(active, conditions, prices)
    if not price > 0:
        return 0.0
    masses, _, _ = _costates(chain.order, active, durations, conditions, [p / price for p in prices])
    terms = _terms(chain, masses, sum(durations))

    def excess(k: float) -> float:
        return sum(term * k**power for power, term in terms) / chain.distance - 1

    if not excess(1.0) < inf:
        return 0.0
    return (float(brentq(excess, 0.0, 1.0, xtol=1e-16)) if excess(1.0) > 0 else 1.0) * sum(durations)


def reach_beyond(
    chain: Chain,
    active: Sequence[str],
    durations: Sequence[float],
    conditions: Sequence[Condition],
    prices: Sequence[float],
) -> tuple[float, ...]:
    """How far beyond its end any move could get at most, for any ends, forwards or, where the price of the distance is
    negative, backwards: the coefficients of a polynomial of the share of the duration that it takes, for shares up to
    one; none when the multipliers show nothing.

    Where it is negative no move is possible. Zero at one proves an extremal: the duration is the border of possible
    ones.
    """
    price = _price(active, conditions, prices)
    if price < 0:
        turned = [Condition(c.arcs, c.derivative, -c.value) for c in conditions]
        swap = {"max": "min", "min": "max"}
        names = [f"{name[:-3]}{swap[name[-3:]]}" for name in active]
        return reach_beyond(chain.mirrored(), names, durations, turned, [-p for p in prices])
    if not price > 0:
        return ()
    masses, first, last = _costates(chain.order, active, durations, conditions, [p / price for p in prices])
    beyond = [-chain.distance, *(0.0 for _ in range(chain.order))]
    for i in range(1, chain.order):
        beyond[i] += first[i] * chain.start[i] - last[i] * chain.end[i]
    for power, term in _terms(chain, masses, sum(durations)):
        beyond[power] += term
    return tuple(beyond)


def impossible(beyond: Sequence[float], low: float) -> tuple[float, float]:
    """The uppermost interval of shares of the duration, from ``low`` to one, in which such a polynomial is negative;
    (low, low) where there is none."""
    if not all(map(isfinite, beyond)) or not beyond:
        return low, low
    roots = real_roots([c * factorial(k) for k, c in enumerate(beyond)])
    marks = [low, *sorted(x for x in roots if low < x < 1), 1.0]
    found: list[tuple[float, float]] = []
    for a, b in zip(marks[-2::-1], marks[:0:-1], strict=True):
        if sum(c * ((a + b) / 2) ** k for k, c in enumerate(beyond)) < 0:
            found.append((a, b))
        elif found:
            break
    return (found[-1][0], found[0][1]) if found else (low, low)


def _price(active: Sequence[str], conditions: Sequence[Condition], prices: Sequence[float]) -> float:
    """That of the distance: the position after the last arc."""
    ends = (p for c, p in zip(conditions, prices, strict=True) if c.derivative == 0 and c.arcs == len(active))
    return next(ends)


def _terms(chain: Chain, masses: Masses, duration: float) -> list[tuple[int, float]]:
    """(power of the stretch, greatest contribution) for each measure; where there is no limit, what the top derivative
    can reach from both ends."""
    n, terms = chain.order, []
    reach = max(chain.top[1], -chain.top[0])
    for (i, upper), mass in masses.items():
        limit = chain.limits[i][1] if upper else -chain.limits[i][0]
        if i < n:
            powers = [(duration / 2) ** k / factorial(k) for k in range(n - i + 1)]
            far = (sum(abs(x) * p for x, p in zip(end[i:], powers, strict=False)) for end in (chain.start, chain.end))
            limit = min(limit, max(far) + reach * powers[n - i])
        terms.append((i, mass * limit))
    return terms


def _costates(
    n: int, active: Sequence[str], durations: Sequence[float], conditions: Sequence[Condition], prices: Sequence[float]
) -> tuple[Masses, list[float], list[float]]:
    """Positive and negative mass of each measure, and of the switching function under key n; the costates at the start
    and at the end."""
    masses = {(i, upper): 0.0 for i in range(n + 1) for upper in (True, False)}

    def add(i: int, value: float) -> None:
        masses[i, value > 0] += abs(value)

    # costates at a border: as the conditions say, as held to the right of it, and at the end
    raw, later, last = [0.0] * n, [0.0] * n, [0.0] * n
    for arc in range(len(active) - 1, -1, -1):
        for c, price in zip(conditions, prices, strict=True):
            if c.arcs == arc + 1:
                raw[c.derivative] += price
        duration, kind = durations[arc], NAMES.index(active[arc].partition(".")[0])
        end = [w if i < kind else 0.0 for i, w in enumerate(raw)]
        raw = [_back(raw, i, duration) for i in range(n)]
        start = [w if i < kind else 0.0 for i, w in enumerate(raw)]
        if arc == len(active) - 1:
            last = end
        else:
            for i in range(n):
                add(i, later[i] - end[i])
        for piece in _signed(end[: kind + 1 if kind < n else n], kind - 1, duration):
            add(kind, piece)
        later = start
    return masses, later, last


def _back(costates: Sequence[float], i: int, duration: float) -> float:
    """Costate i a time before a border, with no measure between."""
    return sum(costates[i - k] * duration**k / factorial(k) for k in range(i + 1))


def _signed(costates: Sequence[float], i: int, duration: float) -> list[float]:
    """Integrals of costate i over the stretches of one sign in the time before a border."""
    rates = [costates[i - k] for k in range(i + 1)]
    marks = [0.0, *sorted(t for t in real_roots(rates) if 0 < t < duration), duration]
    whole = [sum(r * t ** (k + 1) / factorial(k + 1) for k, r in enumerate(rates)) for t in marks]
    return [b - a for a, b in zip(whole, whole[1:], strict=False)]
