"""The rational twin: the sums of the float twin without any rounding.

What a load over position makes is left to the float twin: when the axis passes a knot of its splines is no fraction.
"""

from __future__ import annotations

import math
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

from trajopt.checker.case import DERIVATIVES, POWERS, SPLITS, Case, Curve
from trajopt.checker.float_twin import FloatTwin, metric_of
from trajopt.checker.polynomials import (
    Poly,
    absolute_integral_exactly,
    bernstein_exactly,
    constant,
    highest_exactly,
    integral_exactly,
    plus,
    split_at_sign,
    square_integral_exactly,
    times,
)
from trajopt.checker.report import Found, Number, to_float


class _Piece(NamedTuple):
    """A stretch of one polynomial: interval, start after its left node and length in units of the twin's clock."""

    interval: int
    offset: int
    length: int


class RationalTwin:
    """The sums in whole numbers over common denominators. Floats are ratios of whole numbers.

    Times count in ``clock``-ths of a second; the i-th derivative in ``unit[i]``-ths, such that h^j/j! times the
    (i+j)-th derivative is a whole number of them.
    """

    def __init__(self, case: Case) -> None:
        self.case = case
        self.euler = case.scheme == "euler"

    @cached_property
    def clock(self) -> int:
        ticks = max(float(t).as_integer_ratio()[1] for t in (*self.case.time.tolist(), *self.case.corners))
        return ticks * self.case.count if self.euler else ticks << (SPLITS if self.case.turns else 0)

    @cached_property
    def unit(self) -> list[int]:
        finest = max(x.as_integer_ratio()[1] for values in self.case.signal for x in values.tolist())
        order = self.case.order
        return [finest * self.clock ** (order - i) * math.factorial(order - i) for i in range(order + 1)]

    @cached_property
    def left(self) -> list[list[int]]:
        """The derivatives at the left of each interval, and the last nodes, in their units."""
        signals = zip(self.case.signal, self.unit, strict=True)
        found = [[_counts(x, unit) for x in values.tolist()] for values, unit in signals]
        found[-1].append(found[-1][-1])
        return found

    @cached_property
    def ticks(self) -> list[int]:
        if self.euler:
            step = _counts(self.case.end_time, self.clock) // self.case.count
            return [k * step for k in range(self.case.count + 1)]
        return [_counts(t, self.clock) for t in self.case.time.tolist()]

    # dynamics

    def advanced(self, i: int, h: int, states: list[int]) -> int:
        """The i-th derivative after ``h`` ticks, from the derivatives i and up before them."""
        reach = self.case.order - i
        if self.euler:
            return states[0] + h * states[1] * reach
        return sum(h**j * states[j] * math.comb(reach, j) for j in range(reach + 1))

    @cached_property
    def reintegrated(self) -> list[tuple[list[int], list[int]]]:
        """By derivative: defects of the intervals, and drifts of the nodes from the start on."""
        order, ticks = self.case.order, self.ticks
        found: list[tuple[list[int], list[int]]] = []
        drifting = [[0] * (self.case.count + 1) for _ in range(order + 1)]
        for i in reversed(range(order)):
            defects = []
            for k in range(self.case.count):
                h = ticks[k + 1] - ticks[k]
                defect = self.advanced(i, h, [x[k] for x in self.left[i:]]) - self.left[i][k + 1]
                drifting[i][k + 1] = self.advanced(i, h, [x[k] for x in drifting[i:]]) + defect
                defects.append(defect)
            found.insert(0, (defects, drifting[i]))
        return found

    def defect(self, i: int) -> Found:
        return self.largest(i, self.reintegrated[i][0], 1)

    def drift(self, i: int) -> Found:
        return self.largest(i, self.reintegrated[i][1], 0)

    def largest(self, i: int, values: list[int], shift: int) -> Found:
        k = max(range(len(values)), key=lambda k: abs(values[k]))
        return Found(Fraction(abs(values[k]), self.unit[i]), float(self.case.time[k + shift]))

    def state(self, i: int, node: int, target: float) -> Found:
        given = Fraction(float(self.case.signal[i][node]))
        return Found(abs(given - Fraction(target)), float(self.case.time[node]))

    # between the nodes

    @cached_property
    def pieces(self) -> list[_Piece]:
        """The intervals, split at the corners of tables, and one of no length for the last node."""
        ticks, found = self.ticks, []
        starts = sorted({*ticks, *(_counts(t, self.clock) for t in self.case.corners)})
        k = 0
        for start, stop in zip(starts, [*starts[1:], starts[-1]], strict=True):
            while k < self.case.count and ticks[k + 1] <= start:
                k += 1
            found.append(_Piece(k, start - ticks[k], stop - start))
        return found

    @cached_property
    def one_way(self) -> list[_Piece]:
        """The pieces, split where friction changes its direction."""
        if not self.case.turns:
            return self.pieces
        done, mixed = [], [(piece, SPLITS) for piece in self.pieces]
        while mixed:
            piece, depth = mixed.pop()
            values, unit = bernstein_exactly(self.derivative(1, piece))
            rest, scale = self.case.rest.as_integer_ratio()
            if depth == 0 or min(values) * scale >= -rest * unit or max(values) * scale <= rest * unit:
                done.append(piece)
                continue
            half = piece.length // 2
            mixed.append((piece._replace(length=half), depth - 1))
            mixed.append((_Piece(piece.interval, piece.offset + half, half), depth - 1))
        return done

    def pieces_of(self, name: str) -> list[_Piece]:
        return self.one_way if self.case.is_loaded(name) else self.pieces

    def derivative(self, i: int, piece: _Piece) -> Poly:
        reach = self.case.order - i
        states = [values[piece.interval] for values in self.left[i:]]
        if piece.offset:
            states = [self.advanced(i + j, piece.offset, states[j:]) for j in range(reach + 1)]
        return [piece.length**j * x * math.comb(reach, j) for j, x in enumerate(states)], self.unit[i]

    def line(self, curve: Curve, piece: _Piece) -> Poly:
        if len(curve.value) == 1:
            value, unit = curve.value[0].as_integer_ratio()
            return [value], unit
        start = self.ticks[piece.interval] + piece.offset
        left = curve.exactly(Fraction(start, self.clock))
        rise = curve.exactly(Fraction(start + piece.length, self.clock)) - left
        return plus(constant(left), ([0, rise.numerator], rise.denominator))

    @cached_property
    def drawn(self) -> dict[tuple[str, float], tuple[list[Poly], list[Poly]]]:
        return {}

    def polynomials(self, name: str, at_rest: float = 0.0) -> tuple[list[Poly], list[Poly]]:
        """Any quantity on its pieces, in powers and in Bernstein form; ``at_rest`` is the friction at standstill."""
        if (name, at_rest) not in self.drawn:
            powers = [self.polynomial(name, piece, at_rest) for piece in self.pieces_of(name)]
            self.drawn[name, at_rest] = powers, [bernstein_exactly(poly) for poly in powers]
        return self.drawn[name, at_rest]

    def polynomial(self, name: str, piece: _Piece, at_rest: float) -> Poly:
        if not self.case.is_loaded(name):
            return self.derivative(DERIVATIVES.index(name), piece)
        assert isinstance(self.case.inertia, Curve)
        velocity = self.derivative(1, piece)
        force = times(self.line(self.case.inertia, piece), self.derivative(2, piece))
        if self.case.viscous:
            force = plus(force, times(constant(Fraction(self.case.viscous)), velocity))
        if self.case.coulomb:
            force = plus(force, constant(Fraction(self.friction(velocity, at_rest))))
        if name == "power":
            return times(force, velocity)
        a, b = self.case.mixes[name]
        return force if name == "force" else plus(times(constant(a), force), times(constant(b), velocity))

    def friction(self, velocity: Poly, at_rest: float) -> float:
        values, unit = bernstein_exactly(velocity)
        rest, scale = self.case.rest.as_integer_ratio()
        if max(values) * scale > rest * unit:
            return self.case.coulomb
        return -self.case.coulomb if min(values) * scale < -rest * unit else at_rest

    # at the nodes

    def instants(self, name: str) -> list[tuple[int, int, Fraction]]:
        """(node, interval, weight) of each sample; see `FloatTwin.instants`."""
        count, ticks = self.case.count, self.ticks
        half = [Fraction(ticks[k + 1] - ticks[k], 2 * self.clock) for k in range(count)]
        if not self.case.depends_on_top(name):
            weights = [a + b for a, b in zip([Fraction(0), *half], [*half, Fraction(0)], strict=True)]
            found = [(k, min(k, count - 1), weight) for k, weight in enumerate(weights)]
        elif self.case.is_loaded(name):
            found = [(k + end, k, half[k]) for end in (0, 1) for k in range(count)]
        else:
            found = [(k, k, 2 * half[k]) for k in range(count)]
        return [(node, k, Fraction(1)) for node, k, _ in found] if self.euler else found

    def sampled(self, i: int, node: int, interval: int) -> Fraction:
        return Fraction(float(self.case.signal[i][interval if i == self.case.order else node]))

    def samples(self, name: str, convention: int = 0) -> tuple[list[Fraction], list[Fraction]]:
        """Values and weights; for ``convention`` see `Case.conventions`."""
        instants = self.instants(name)
        weights = [weight for _, _, weight in instants]
        if not self.case.is_loaded(name):
            i = DERIVATIVES.index(name)
            return [self.sampled(i, node, k) for node, k, _ in instants], weights
        resting = (0, 1, -1, None)[convention]
        return [self.loaded(name, node, k, resting) for node, k, _ in instants], weights

    def loaded(self, name: str, node: int, interval: int, resting: int | None) -> Fraction:
        """Force or power at a node; ``resting`` is the sign of friction at rest, None for that of the velocity."""
        assert isinstance(self.case.inertia, Curve)
        velocity = self.sampled(1, node, interval)
        sign = (velocity > 0) - (velocity < 0)
        if resting is not None and abs(velocity) <= Fraction(self.case.rest):
            sign = resting
        inertia = self.case.inertia.exactly(Fraction(float(self.case.time[node])))
        force = inertia * self.sampled(2, node, interval) + Fraction(self.case.viscous) * velocity
        force += sign * Fraction(self.case.coulomb)
        if name in self.case.mixes:
            a, b = self.case.mixes[name]
            return a * force + b * velocity
        return force * velocity if name == "power" else self.drawn_power(name, force, velocity)

    def drawn_power(self, name: str, force: Fraction, velocity: Fraction) -> Fraction:
        """See `FloatTwin.drawn_power`; a power that is no whole number is taken to 50 digits."""
        motor = self.case.motor
        assert motor is not None
        current = force / Fraction(motor.constant)
        copper = Fraction(motor.resistance) * current**2
        if name == "copper power":
            return copper
        iron = Fraction(motor.eddy) * (velocity * current) ** 2
        iron += Fraction(motor.hysteresis) * abs(velocity) * _raised(abs(current), motor.exponent)
        return copper + iron + Fraction(motor.switching) * abs(current) + force * velocity

    # answers

    def excess(self, name: str, tolerance: float) -> Found:
        """How far a limit is exceeded; where the axis rests, friction may take whatever value keeps the limit."""
        if self.in_floats(name):
            return FloatTwin(self.case).excess(name, tolerance)
        found = [Found(Fraction(0))]
        for side, limit, label in zip((-1, 1), self.case.limits[name], ("min", "max"), strict=True):
            if limit is not None:
                ask = self.excess_at_nodes if self.euler else self.excess_between
                found.append(ask(name, side, limit, tolerance)._replace(note=label))
        return max(found, key=lambda one: one.violation)

    def in_floats(self, name: str) -> bool:
        """Whether a quantity is made by a load over position."""
        return bool(self.case.splines) and self.case.is_loaded(name)

    def total(self, name: str) -> Fraction:
        """See `FloatTwin.total`."""
        if self.case.splines:
            return Fraction(FloatTwin(self.case).total(name))
        least = min(Fraction(value) for value in self.metric(name)[:-1])
        duration = Fraction(self.case.end_time)
        return least * _root(duration / (duration + Fraction(self.case.dwell))) if name == "rms_force" else least

    def excess_in_total(self, name: str) -> Found:
        limit = self.case.limits[name][1]
        assert limit is not None
        return Found(max(self.total(name) - Fraction(limit.value[0]), Fraction(0)))

    def excess_at_nodes(self, name: str, side: int, limit: Curve, tolerance: float) -> Found:
        worst = Found(Fraction(0))
        plain = self.samples(name)[0]
        for value, (node, interval, _) in zip(plain, self.instants(name), strict=True):
            if name in self.case.mixes:
                value = self.loaded(name, node, interval, -side)
            time = float(self.case.time[node])
            over = side * (value - limit.exactly(Fraction(time)))
            worst = max(worst, Found(over, time), key=lambda one: one.violation)
        return worst

    def excess_between(self, name: str, side: int, limit: Curve, tolerance: float) -> Found:
        pieces = self.pieces_of(name)
        powers, rows = self.polynomials(name, -side * self.case.coulomb if self.case.is_loaded(name) else 0.0)
        if len(limit.value) == 1:
            level, unit = limit.value[0].as_integer_ratio()
            over = [([side * (unit * x - level * scale) for x in values], scale * unit) for values, scale in rows]
        else:
            over = [bernstein_exactly(self.over(*pair, limit, side)) for pair in zip(pieces, powers, strict=True)]
        value, k, s = highest_exactly(over, Fraction(tolerance) / 10**9, Fraction(0))
        if value == 0:
            return Found(value)
        start = Fraction(self.ticks[pieces[k].interval] + pieces[k].offset, self.clock)
        return Found(value, to_float(start + s * Fraction(pieces[k].length, self.clock)))

    def over(self, piece: _Piece, poly: Poly, limit: Curve, side: int) -> Poly:
        line, unit = self.line(limit, piece)
        return plus(([side * x for x in poly[0]], poly[1]), ([-side * x for x in line], unit))

    def objective(self) -> list[Number]:
        """The objective for each convention of friction at rest, and its rounding, none."""
        found: list[Number] = []
        terms = self.case.terms
        for convention in self.case.conventions(*(name for name, _, _ in terms)):
            values = (Fraction(weight) * self.term(name, norm, convention) for name, norm, weight in terms)
            found.append(sum(values, Fraction(0)))
        return [*found, 0.0]

    def term(self, name: str, norm: str | None, convention: int) -> Fraction:
        """The value of one term without its weight; a norm we do not know counts as nothing."""
        if name == "time":
            return Fraction(self.case.duration)
        if self.in_floats(POWERS.get(name, name)):
            return Fraction(FloatTwin(self.case).term(name, norm, convention)[0])
        values, weights = self.samples(POWERS.get(name, name), convention)
        if name in POWERS:
            weights = [Fraction(self.ticks[1], self.clock)] * len(weights) if self.euler else weights
            if name != "energy":
                values = [self.counted(value) for value in values] if name == "electrical_energy" else values
                return sum((w * x for w, x in zip(weights, values, strict=True)), Fraction(0))
            norm = "l1"
        elif name == "position":
            values = [value - values[0] for value in values]
        return _norm_exactly(norm, values, weights, Fraction(1 if self.euler else self.case.end_time))

    def excess_of_term(self, name: str, norm: str | None, most: float) -> Found:
        """See `FloatTwin.excess_of_term`."""
        value = min(self.term(name, norm, convention) for convention in self.case.conventions(name))
        return Found(max(value - Fraction(most), Fraction(0)))

    def counted(self, value: Fraction) -> Fraction:
        assert self.case.motor is not None
        return value if value > 0 else Fraction(self.case.motor.recovery) * value

    def metric(self, name: str) -> list[Number]:
        """A metric for each convention of friction at rest, and its rounding, none."""
        kind, quantity = metric_of(name)
        if self.in_floats(quantity):
            return [*(Fraction(to_float(value)) for value in FloatTwin(self.case).metric(name)[:-1]), 0.0]
        return [*(self.metric_at_nodes if self.euler else self.metric_between)(kind, quantity), 0.0]

    def metric_at_nodes(self, kind: str, quantity: str) -> list[Fraction]:
        step = Fraction(self.ticks[1], self.clock)
        ends = (step, Fraction(0)) if kind == "distance" else (step / 2, step / 2)
        norm = {"peak": "linf", "rms": "l2"}.get(kind, "l1")
        found = []
        for convention in self.case.conventions(quantity):
            values = self.samples(quantity, convention)[0]
            weights = [step] * len(values)
            if not self.case.depends_on_top(quantity):
                weights[0], weights[-1] = ends
            if kind in ("drawn", "fed back"):
                values = [self.counted(x) if kind == "drawn" else max(-x, Fraction(0)) for x in values]
                found.append(sum((w * x for w, x in zip(weights, values, strict=True)), Fraction(0)))
                continue
            found.append(_norm_exactly(norm, values, weights, Fraction(self.case.end_time)))
        return found

    def metric_between(self, kind: str, quantity: str) -> list[Fraction]:
        coulomb = self.case.coulomb if self.case.feels_friction_at_rest(quantity) else 0.0
        resting = (0.0, coulomb, -coulomb) if coulomb else (0.0,)
        if kind == "peak":
            found = [self.peak_between(quantity, -coulomb, coulomb)] if coulomb else []
            return [*found, *(self.peak_between(quantity, at_rest, at_rest) for at_rest in resting)]
        lengths = [Fraction(piece.length, self.clock) for piece in self.pieces_of(quantity)]
        if kind == "rms":
            squares = [square_integral_exactly(self.polynomials(quantity, at_rest)[0], lengths) for at_rest in resting]
            return [_root(square / Fraction(self.case.end_time)) for square in squares]
        if kind == "copper":
            assert self.case.motor is not None
            squares = [square_integral_exactly(self.polynomials("current", at_rest)[0], lengths) for at_rest in resting]
            return [Fraction(self.case.motor.resistance) * square for square in squares]
        if kind in ("drawn", "fed back"):
            return [self.flow(kind, at_rest, lengths) for at_rest in resting]
        return [absolute_integral_exactly(self.polynomials(quantity)[1], lengths)]

    def flow(self, kind: str, at_rest: float, lengths: list[Fraction]) -> Fraction:
        """See `FloatTwin.flow`, whose own number it is where the exponent leaves no polynomial."""
        motor = self.case.motor
        assert motor is not None
        if motor.hysteresis and motor.exponent != 2:
            return Fraction(FloatTwin(self.case).flow(kind, at_rest))
        currents, powers = self.polynomials("current", at_rest)[0], self.polynomials("power", at_rest)[0]
        rows = []
        for piece, u, mechanical in zip(self.one_way, currents, powers, strict=True):
            v = self.derivative(1, piece)
            square = times(u, u)
            even = plus(mechanical, times(constant(Fraction(motor.resistance)), square))
            even = plus(even, times(constant(Fraction(motor.eddy)), times(square, times(v, v))))
            way = 1 if sum(bernstein_exactly(v)[0]) >= 0 else -1
            even = plus(even, times(constant(way * Fraction(motor.hysteresis)), times(square, v)))
            odd = times(constant(Fraction(motor.switching)), u)
            ahead, behind = plus(even, odd), plus(even, ([-x for x in odd[0]], odd[1]))
            rows.append((bernstein_exactly(u), bernstein_exactly(ahead), bernstein_exactly(behind)))
        signed, spans = split_at_sign(rows, lengths)
        net, gross = integral_exactly(signed, spans), absolute_integral_exactly(signed, spans)
        drawn, returned = (gross + net) / 2, (gross - net) / 2
        return drawn - Fraction(motor.recovery) * returned if kind == "drawn" else returned

    def peak_between(self, quantity: str, rest_above: float, rest_below: float) -> Fraction:
        above = self.polynomials(quantity, rest_above)[1]
        below = [([-x for x in values], unit) for values, unit in self.polynomials(quantity, rest_below)[1]]
        return highest_exactly(above + below, Fraction(0), Fraction(1, 10**12))[0]


def _counts(x: float, unit: int) -> int:
    """``x`` in units of 1/``unit``; the unit is fine enough by construction."""
    numerator, denominator = x.as_integer_ratio()
    return numerator * (unit // denominator)


def _norm_exactly(norm: str | None, values: list[Fraction], weights: list[Fraction], duration: Fraction) -> Fraction:
    if norm == "l1":
        return sum((w * abs(x) for w, x in zip(weights, values, strict=True)), Fraction(0))
    if norm == "l2":
        return _root(sum((w * x * x for w, x in zip(weights, values, strict=True)), Fraction(0)) / duration)
    return max(abs(x) for x in values) if norm == "linf" else Fraction(0)


def _raised(x: Fraction, exponent: float) -> Fraction:
    """A power of a number that is not negative; to 50 digits where the exponent is no whole number."""
    if exponent == 2 or x == 0:
        return x * x
    with localcontext(prec=50):
        return Fraction((Decimal(x.numerator) / Decimal(x.denominator)) ** Decimal(exponent))


def _root(x: Fraction) -> Fraction:
    """The square root, to more than 30 digits."""
    shift = max(220 + x.denominator.bit_length() - x.numerator.bit_length(), 0)
    shift += shift % 2
    return Fraction(math.isqrt((x.numerator << shift) // x.denominator), 1 << (shift // 2))
