"""Orders one to three with any ends: every extremal profile from the roots of a polynomial.

Without position limits the switching function of a third-order chain is convex between the plateaus of acceleration
and velocity (or concave: the mirrored case), so that the jerk is up, down, up with plateaus between: at the greatest
and the least acceleration, and at the greatest velocity. Each choice of plateaus leaves one unknown, in which the
distance is a polynomial of degree six or less; its roots, up and mirrored, are all the durations where the move becomes
possible or impossible (compare Berscheid and Kröger, "Jerk-limited Real-time Trajectory Generation with Arbitrary
Target States").
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import fsum, inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from trajopt.switching.chain import Chain

Vector = npt.NDArray[np.float64]
_SLACK = 1e-8  # of the duration: an arc shorter than minus this is not there
_ROUGH = 1e-3  # the same before the root is refined

_NAMES_3 = ("jerk.max", "acceleration.max", "jerk.min", "velocity.max", "jerk.min", "acceleration.min", "jerk.max")
_NAMES_2 = ("acceleration.max", "velocity.max", "acceleration.min")


class Profile(NamedTuple):
    """Arcs of one extremal; ``upward``: it reaches farther than any other move of its duration."""

    durations: tuple[float, ...]
    tops: tuple[float, ...]
    active: tuple[str, ...]
    upward: bool

    @property
    def duration(self) -> float:
        return fsum(self.durations)


def extremals(chain: Chain) -> list[Profile]:
    """All extremal profiles of a scaled chain of order one to three, shortest first, before any check of limits."""
    kinds = {1: _first, 2: _second, 3: _third}
    found = [
        *(_profile(chain, d, True) for d in kinds[chain.order](chain)),
        *(_profile(chain, d, False) for d in kinds[chain.order](chain.mirrored())),
    ]
    return sorted((p for p in found if p is not None), key=lambda p: p.duration)


def _profile(chain: Chain, durations: Sequence[float], upward: bool) -> Profile | None:
    """Names and values of the arcs; None where one is missing by more than rounding."""
    whole = fsum(durations)
    if not isfinite(whole) or min(durations) < -_SLACK * abs(whole):
        return None
    low, high = chain.top
    names = {1: ("velocity.max",), 2: _NAMES_2, 3: _NAMES_3}[chain.order]
    rates = {1: (1,), 2: (1, 0, -1), 3: (1, 0, -1, 0, -1, 0, 1)}[chain.order]
    if not upward:
        turn = {"max": "min", "min": "max"}
        names = tuple(f"{n[:-3]}{turn[n[-3:]]}" for n in names)
        rates = tuple(-r for r in rates)
    kept = [i for i, d in enumerate(durations) if d > 0]
    tops = [high if rates[i] > 0 else low if rates[i] < 0 else 0.0 for i in kept]
    return Profile(tuple(durations[i] for i in kept), tuple(tops), tuple(names[i] for i in kept), upward)


def _first(chain: Chain) -> Iterator[tuple[float, ...]]:
    if chain.top[1] > 0:
        yield (chain.distance / chain.top[1],)


def _second(chain: Chain) -> Iterator[tuple[float, ...]]:
    """Up, plateau at the greatest velocity, down."""
    (down, up), most = chain.limits[2], chain.limits[1][1]
    down = -down
    v0, v1 = chain.start[1], chain.end[1]
    if most < inf:
        run = (most**2 - v0**2) / 2 / up + (most**2 - v1**2) / 2 / down
        yield (most - v0) / up, (chain.distance - run) / most if most else inf, (most - v1) / down
    square = (chain.distance + v0**2 / 2 / up + v1**2 / 2 / down) / (0.5 / up + 0.5 / down)
    for peak in (sqrt(max(square, 0.0)), -sqrt(max(square, 0.0))):
        yield (peak - v0) / up, 0.0, (peak - v1) / down


def _third(chain: Chain) -> Iterator[tuple[float, ...]]:
    """(7,) durations: up, greatest acceleration, down to zero, greatest velocity, down, least acceleration, up. The two
    arcs down are given as one, in the first place, where no plateau of velocity divides them."""
    case = _Case(chain)
    most, (least, top) = chain.limits[1][1], chain.limits[2]
    if most < inf:
        yield from case.with_plateau(most)
    if chain.start[1:] == chain.end[1:] and chain.distance == 0:
        return
    yield from case.free()
    if least == 0:
        yield from case.coasting(False)
    if top == 0:
        yield from case.coasting(True)
    if 0 < top < inf:
        yield from case.held(top)
    if 0 > least > -inf:
        yield from _backwards(chain)
    if 0 < top < inf and 0 > least > -inf:
        yield from case.both(top, least)


def _backwards(chain: Chain) -> Iterator[tuple[float, ...]]:
    """Held at the least acceleration only: held at the greatest, in the chain run backwards with its sign turned."""
    turned = chain.reversed().mirrored()
    for d in _Case(turned).held(turned.limits[2][1]):
        yield d[6], d[5], d[2], d[3], d[4], d[1], d[0]


class _Case:
    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        self.up, self.down = chain.top[1], -chain.top[0]
        _, self.v0, self.a0 = chain.start
        _, self.v1, self.a1 = chain.end
        self.distance = chain.distance
        self.both_ways = 0.5 / self.up + 0.5 / self.down

    def with_plateau(self, most: float) -> Iterator[tuple[float, ...]]:
        """Through a plateau of velocity: both sides are closed forms."""
        t1, hold1, t2 = _reach(most - self.v0, self.a0, self.chain.limits[2][1], self.up, self.down)
        t7, hold2, t5 = _reach(most - self.v1, -self.a1, -self.chain.limits[2][0], self.up, self.down)
        durations = (t1, hold1, t2, 0.0, t5, hold2, t7)
        if most > 0 and all(map(isfinite, durations)):
            yield (*durations[:3], (self.distance - self._run(durations)) / most, *durations[4:])

    def coasting(self, first: bool) -> Iterator[tuple[float, ...]]:
        """Where a limit of acceleration is zero: held there, at the velocity that the first or the last arc leaves."""
        speed = self.v0 - self.a0**2 / 2 / self.up if first else self.v1 - self.a1**2 / 2 / self.up
        t1, hold1, t2 = _reach(speed - self.v0, self.a0, self.chain.limits[2][1], self.up, self.down)
        t7, hold2, t5 = _reach(speed - self.v1, -self.a1, -self.chain.limits[2][0], self.up, self.down)
        durations = (t1, hold1, t2 + t5, 0.0, 0.0, hold2, t7)
        if speed and all(map(isfinite, durations)):
            rest = (self.distance - self._run(durations)) / speed
            yield (t1, rest, t5, 0.0, 0.0, hold2, t7) if first else (t1, hold1, t2, 0.0, 0.0, rest, t7)

    def free(self) -> Iterator[tuple[float, ...]]:
        """No plateau: peaks b and c of acceleration with b² - c² = k; the unknown is s = b - c."""
        k = (self.v1 - self.v0 + (self.a0**2 - self.a1**2) / 2 / self.up) / self.both_ways

        def durations(s: float) -> tuple[float, ...]:
            b, c = (k / s + s) / 2, (k / s - s) / 2
            return (b - self.a0) / self.up, 0.0, s / self.down, 0.0, 0.0, 0.0, (self.a1 - c) / self.up

        # Laurent polynomials of s, lowest power first, centred at power zero
        b, c = np.array([k / 2, 0.0, 0.5]), np.array([k / 2, 0.0, -0.5])
        one, s = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
        polynomial = self._distance((b - self.a0 * one) / self.up, s / self.down, (self.a1 * one - c) / self.up, b, one)
        yield from self._solve(polynomial, durations, lambda s: s > 0)
        if self.v1 != self.v0 and (self.a1 - self.a0) / self.up > 0:
            yield (self.a1 - self.a0) / self.up, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0

    def held(self, top: float) -> Iterator[tuple[float, ...]]:
        """Held at the greatest acceleration: the unknown is the least acceleration c."""

        def durations(c: float) -> tuple[float, ...]:
            gain = (
                (top**2 - self.a0**2) / 2 / self.up
                + (self.a1**2 - c**2) / 2 / self.up
                + (top**2 - c**2) / 2 / self.down
            )
            hold = (self.v1 - self.v0 - gain) / top
            return (top - self.a0) / self.up, hold, (top - c) / self.down, 0.0, 0.0, 0.0, (self.a1 - c) / self.up

        gain = self.v1 - self.v0 - (top**2 - self.a0**2 + self.a1**2) / 2 / self.up - top**2 / 2 / self.down
        hold = np.array([gain, 0.0, self.both_ways]) / top
        polynomial = self._held_distance(top, hold)
        yield from self._solve(polynomial, durations, lambda c: True)

    def both(self, top: float, least: float) -> Iterator[tuple[float, ...]]:
        """Held at both accelerations: the distance is quadratic in the first hold."""
        t1, t2, t3 = (top - self.a0) / self.up, (top - least) / self.down, (self.a1 - least) / self.up
        gain = (top**2 - self.a0**2 + self.a1**2 - least**2) / 2 / self.up + (top**2 - least**2) / 2 / self.down
        rest = self.v1 - self.v0 - gain

        def durations(hold: float) -> tuple[float, ...]:
            return t1, hold, t2, 0.0, 0.0, (rest - top * hold) / least, t3

        values = [self._run(durations(x)) for x in (0.0, 1.0, -1.0)]
        curve, slope = (values[1] + values[2]) / 2 - values[0], (values[1] - values[2]) / 2
        polynomial = np.array([values[0] - self.distance, slope, curve])
        yield from self._solve(polynomial, durations, lambda hold: True)

    def _distance(self, t1: Vector, t2: Vector, t3: Vector, peak: Vector, one: Vector) -> Vector:
        """Laurent polynomial of the distance left over, for up, down, up with a peak of acceleration."""
        speed = _add(self.v0 * one, _product(peak, peak) / 2 / self.up, -(self.a0**2) / 2 / self.up * one)
        return _add(
            self.v0 * t1, self.a0 / 2 * _product(t1, t1), self.up / 6 * _product(t1, t1, t1),
            _product(speed, t2), _product(peak, t2, t2) / 2, -self.down / 6 * _product(t2, t2, t2),
            self.v1 * t3, -self.a1 / 2 * _product(t3, t3), self.up / 6 * _product(t3, t3, t3),
            -self.distance * one,
        )  # fmt: skip

    def _held_distance(self, top: float, hold: Vector) -> Vector:
        """The same with a hold at the greatest acceleration, a polynomial of the least one, lowest power first."""
        t1 = (top - self.a0) / self.up
        t2, t3 = np.array([top, -1.0]) / self.down, np.array([self.a1, -1.0]) / self.up
        speed = self.v0 + (top**2 - self.a0**2) / 2 / self.up
        out = np.zeros(5)
        for term in (
            [self.v0 * t1 + self.a0 * t1**2 / 2 + self.up * t1**3 / 6 - self.distance],
            speed * hold, top / 2 * np.convolve(hold, hold),
            speed * t2, top * np.convolve(hold, t2), top / 2 * np.convolve(t2, t2),
            -self.down / 6 * _product(t2, t2, t2),
            self.v1 * t3, -self.a1 / 2 * np.convolve(t3, t3), self.up / 6 * _product(t3, t3, t3),
        ):  # fmt: skip
            out[: len(term)] += term
        return out

    def _run(self, durations: Sequence[float]) -> float:
        """The distance covered."""
        x, v, a = 0.0, self.v0, self.a0
        for rate, d in zip((self.up, 0.0, -self.down, 0.0, -self.down, 0.0, self.up), durations, strict=True):
            x += d * (v + d / 2 * (a + d / 3 * rate))
            v += d * (a + d / 2 * rate)
            a += d * rate
        return x

    def _solve(
        self, polynomial: Vector, durations: Callable[[float], tuple[float, ...]], wanted: Callable[[float], bool]
    ) -> Iterator[tuple[float, ...]]:
        """Durations at the real roots, each refined on the distance itself."""
        for x in _real(polynomial):
            if not wanted(x) or min(first := durations(x)) < -_ROUGH * sum(map(abs, first)):
                continue
            step = 1e-6 * max(abs(x), 1e-6)
            best, error = x, abs(self._run(first) - self.distance)
            for _ in range(3):
                here = self._run(durations(best)) - self.distance
                slope = (self._run(durations(best + step)) - self._run(durations(best - step))) / 2 / step
                if not slope or not isfinite(here / slope) or not wanted(best - here / slope):
                    break
                again = best - here / slope
                left = abs(self._run(durations(again)) - self.distance)
                if left >= error:
                    break
                best, error = again, left
            yield durations(best)


def _reach(gain: float, start: float, top: float, up: float, down: float) -> tuple[float, float, float]:
    """(up, hold, down) durations to gain a velocity and end at zero acceleration."""
    square = (gain + start**2 / 2 / up) / (0.5 / up + 0.5 / down)
    peak = min(sqrt(square) if square >= 0 else inf, top)
    if peak == inf:
        return inf, inf, inf
    spare = gain - (peak**2 - start**2) / 2 / up - peak**2 / 2 / down
    if peak == 0:
        hold = 0.0 if abs(spare) <= 1e-14 * (abs(gain) + start**2 / up) else inf
    else:
        hold = spare / peak if peak == top else 0.0
    return (peak - start) / up, hold, peak / down


def _real(coefficients: Vector) -> list[float]:
    """Real roots, lowest power first; nearly real ones too, which a double root may have become."""
    trimmed = np.trim_zeros(coefficients[::-1], "f")
    if len(trimmed) < 2 or not np.all(np.isfinite(trimmed)):
        return []
    roots = np.roots(trimmed)
    return [float(x) for x in roots.real[np.abs(roots.imag) <= 1e-4 * np.abs(roots)]]


def _product(*factors: Vector) -> Vector:
    out = factors[0]
    for f in factors[1:]:
        out = np.convolve(out, f)
    return out


def _add(*terms: Vector) -> Vector:
    """Sum of Laurent polynomials centred at power zero."""
    size = max(map(len, terms))
    out = np.zeros(size)
    for t in terms:
        shift = (size - len(t)) // 2
        out[shift : size - shift] += t
    return out
