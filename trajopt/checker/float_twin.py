"""The float twin: all sums in floats, on whole arrays."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from trajopt.checker.case import DERIVATIVES, EPS, POWERS, SPLITS, Array, Case, Curve
from trajopt.checker.polynomials import (
    absolute_integral,
    bernstein,
    both_signs,
    highest,
    product,
    square_integral,
    values_at,
)
from trajopt.checker.report import Found, Number, to_float
from trajopt.checker.splines import Spline

LOBATTO: Final = (0.0, (1 - 1 / math.sqrt(5)) / 2, (1 + 1 / math.sqrt(5)) / 2, 1.0)  # where a load over position ...
_PEAK: Final = 3e-9  # relative: how closely one between the nodes is sought
_SUM: Final = 1e-11  # relative: how closely integrals and norms are summed
SHARES: Final = (1 / 12, 5 / 12, 5 / 12, 1 / 12)  # ... is sampled, and what share of an interval each point stands for


class _Pieces(NamedTuple):
    """Stretches of one polynomial each: interval, start (s after its left node), length (s). Any order."""

    interval: NDArray[np.intp]
    offset: Array
    length: Array

    def take(self, which: NDArray[np.bool_]) -> _Pieces:
        return _Pieces(self.interval[which], self.offset[which], self.length[which])

    def joined(self, other: _Pieces) -> _Pieces:
        return _Pieces(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))

    def halved(self) -> _Pieces:
        half = self.length / 2
        return _Pieces(self.interval, self.offset, half).joined(_Pieces(self.interval, self.offset + half, half))


class Instants(NamedTuple):
    """Where a quantity is sampled: nodes (or intervals, for the top derivative) and the weight of each sample."""

    node: NDArray[np.intp]
    interval: NDArray[np.intp]
    weight: Array


class FloatTwin:
    """All sums in floats, on whole arrays."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.euler = case.scheme == "euler"
        self.step = np.full(case.count, case.end_time / case.count) if self.euler else np.diff(case.time)
        top = case.signal[-1]
        self.left = (*case.signal[:-1], np.append(top, top[-1]))

    # dynamics

    @cached_property
    def longest(self) -> float:
        """The longest interval, s."""
        return float(self.step.max())

    @cached_property
    def peaks(self) -> tuple[float, ...]:
        """By derivative: the largest value at the nodes, or of the top one on the intervals."""
        return tuple(float(np.abs(values).max()) for values in self.case.signal)

    @cached_property
    def factors(self) -> list[Array]:
        """Of the Taylor series: step^j / j!"""
        return [self.step**j / math.factorial(j) for j in range(self.case.order + 1)]

    @cached_property
    def defects(self) -> list[tuple[Array, float]]:
        """By derivative: re-integrated minus given increment of each interval, and its rounding error."""
        found = []
        for i in range(self.case.order):
            reach = 1 if self.euler else self.case.order - i
            terms = [self.factors[j] * self.left[i + j][:-1] for j in range(1, reach + 1)]
            given = np.diff(self.left[i])  # first, so that a far-off origin costs no digits
            sizes = [self.longest**j / math.factorial(j) * self.peaks[i + j] for j in range(1, reach + 1)]
            found.append((sum(terms, -given), 8 * EPS * (sum(sizes) + float(np.abs(given).max()))))
        return found

    @cached_property
    def drifts(self) -> list[Array]:
        """By derivative: the whole move re-integrated from its start, minus the given nodes.

        The difference itself is integrated, from the defects: it is small, and so is its rounding.
        """
        order = self.case.order
        found = [np.zeros(self.case.count + 1) for _ in range(order + 1)]
        for i in reversed(range(order)):
            reach = 1 if self.euler else order - i
            terms = [self.factors[j] * found[i + j][:-1] for j in range(1, reach + 1) if i + j < order]
            found[i][1:] = np.cumsum(sum(terms, self.defects[i][0]))
        return found

    def defect(self, i: int) -> Found:
        values, rounding = self.defects[i]
        k = int(np.argmax(np.abs(values)))
        return Found(float(abs(values[k])), float(self.case.time[k + 1]), rounding)

    def drift(self, i: int) -> Found:
        k = int(np.argmax(np.abs(self.drifts[i])))
        span, count = self.case.end_time, self.case.count
        reach = range(self.case.order - i)
        rounding = sum(count * self.defects[i + j][1] * span**j / math.factorial(j) for j in reach)
        return Found(float(abs(self.drifts[i][k])), float(self.case.time[k]), rounding)

    def state(self, i: int, node: int, target: float) -> Found:
        return Found(abs(float(self.case.signal[i][node]) - target), float(self.case.time[node]))

    # between the nodes: polynomials in s, 0 <= s <= 1, a row of coefficients per piece

    @cached_property
    def pieces(self) -> _Pieces:
        """The intervals, split at the corners of tables, and one of no length for the last node."""
        return self.split(np.array(self.case.corners))

    def split(self, times: Array) -> _Pieces:
        """The intervals, split at times, and one of no length for the last node."""
        time = self.case.time
        left = np.union1d(time, times) if len(times) else time
        interval = np.searchsorted(time, left, side="right") - 1
        return _Pieces(interval, left - time[interval], np.append(np.diff(left), 0.0))

    @cached_property
    def one_way(self) -> _Pieces:
        """The pieces, split where friction changes its direction, and where a load over position changes from one
        polynomial to the next."""
        mixed: _Pieces = self.split(np.array([*self.case.corners, *self.knots])) if self.case.splines else self.pieces
        if not self.case.turns:
            return mixed
        done = []
        for _ in range(SPLITS):
            velocity = bernstein(self.rows(1, mixed))
            whole = np.all(velocity >= -self.case.rest, axis=1) | np.all(velocity <= self.case.rest, axis=1)
            done.append(mixed.take(whole))
            if whole.all():
                break
            mixed = mixed.take(~whole).halved()
        else:
            done.append(mixed)
        return _Pieces(*(np.concatenate(parts) for parts in zip(*done, strict=True)))

    @cached_property
    def knots(self) -> list[float]:
        """The times (s) at which the axis passes a knot of a load over position."""
        rows = self.rows(0, self.pieces)
        bounds = bernstein(rows)
        found: list[float] = []
        for spline in self.case.splines:
            first = np.searchsorted(spline.breaks, bounds.min(axis=1))
            last = np.searchsorted(spline.breaks, bounds.max(axis=1))
            for k in np.flatnonzero(last > first):
                start, length = self.case.time[self.pieces.interval[k]] + self.pieces.offset[k], self.pieces.length[k]
                for knot in spline.breaks[first[k] : last[k]]:
                    row = rows[k].copy()
                    row[0] -= knot
                    roots = np.roots(np.trim_zeros(row[::-1], "f"))
                    real = roots[np.abs(roots.imag) < 1e-9].real
                    found += [start + length * s for s in real if 0 < s < 1]
        return found

    def pieces_of(self, name: str) -> _Pieces:
        return self.one_way if self.case.is_loaded(name) else self.pieces

    def rows(self, i: int, pieces: _Pieces) -> Array:
        """Coefficients (pieces, order - i + 1) of the i-th derivative."""
        order, k = self.case.order, pieces.interval
        states = [values[k] for values in self.left[i:]]
        if np.any(pieces.offset):
            states = [
                np.sum([pieces.offset**n / math.factorial(n) * states[j + n] for n in range(order - i - j + 1)], axis=0)
                for j in range(order - i + 1)
            ]
        found, factor = np.empty((len(k), len(states))), np.ones(len(k))
        for j, values in enumerate(states):
            found[:, j] = factor * values
            factor = factor * pieces.length / (j + 1)
        return found

    def line(self, curve: Curve, pieces: _Pieces) -> tuple[Array, Array]:
        """A table at both ends of each piece."""
        start = self.case.time[pieces.interval] + pieces.offset
        return curve.at(start), curve.at(start + pieces.length)

    @cached_property
    def drawn(self) -> dict[tuple[str, float], tuple[Array, Array]]:
        return {}

    def polynomial(self, name: str, at_rest: float = 0.0) -> tuple[Array, Array]:
        """Any quantity on its pieces, as coefficients of powers and of Bernstein polynomials.

        ``at_rest`` is the friction where the axis stands still.
        """
        if (name, at_rest) not in self.drawn:
            loaded = self.case.is_loaded(name)
            rows = self.loaded_rows(name, at_rest) if loaded else self.rows(DERIVATIVES.index(name), self.pieces)
            self.drawn[name, at_rest] = rows, bernstein(rows)
        return self.drawn[name, at_rest]

    @cached_property
    def extents(self) -> dict[tuple[str, float], tuple[float, float]]:
        return {}

    def extent(self, name: str, at_rest: float = 0.0) -> tuple[float, float]:
        """The lowest and the highest Bernstein coefficient of a quantity, which none of its values passes."""
        if (name, at_rest) not in self.extents:
            self.extents[name, at_rest] = _range(self.polynomial(name, at_rest)[1])
        return self.extents[name, at_rest]

    def one_way_rows(self, i: int) -> Array:
        """Coefficients of the i-th derivative on the pieces of one direction."""
        return self.polynomial(DERIVATIVES[i])[0] if self.one_way is self.pieces else self.rows(i, self.one_way)

    @cached_property
    def velocity_rows(self) -> Array:
        """Coefficients of velocity on the pieces of one direction."""
        return self.one_way_rows(1)

    def loaded_rows(self, name: str, at_rest: float) -> Array:
        """Coefficients of force, of a mix of it and velocity, or of power on the pieces of one direction."""
        assert self.case.inertia is not None
        velocity = self.velocity_rows
        if name == "power":
            return product(self.polynomial("force", at_rest)[0], velocity)
        if name != "force":
            a, b = map(float, self.case.mixes[name])
            found = a * self.polynomial("force", at_rest)[0]
            found[:, : velocity.shape[1]] += b * velocity
            return found
        inertia, acceleration = self.case.inertia, self.one_way_rows(2)
        if self.case.splines:
            force = self.rows_along(velocity, acceleration)
            force[:, 0] += self.friction(velocity, at_rest) if self.case.coulomb else 0.0
            return force
        assert isinstance(inertia, Curve)
        force = self.case.viscous * velocity  # of one degree more than acceleration, enough for a linear inertia
        if len(inertia.value) == 1:
            force[:, :-1] += inertia.value[0] * acceleration
        else:
            left, right = self.line(inertia, self.one_way)
            force += product(np.stack([left, right - left], axis=1), acceleration)
        force[:, 0] += self.friction(velocity, at_rest) if self.case.coulomb else 0.0
        return force

    def rows_along(self, velocity: Array, acceleration: Array) -> Array:
        """Coefficients of F(q) + J'(q) v²/2 + J(q) a + viscous·v on the pieces of one direction: q(s) put into the
        polynomials of a spline gives polynomials."""
        position, inertia = self.rows(0, self.one_way), self.case.inertia
        parts = [self.case.viscous * velocity]
        if isinstance(inertia, Curve):
            parts.append(inertia.value[0] * acceleration)
        elif inertia is not None:
            parts.append(product(inertia.along(position), acceleration))
            parts.append(product(inertia.along(position, 1) / 2, product(velocity, velocity)))
        if self.case.force is not None:
            parts.append(self.case.force.along(position))
        found = np.zeros((len(velocity), max(part.shape[1] for part in parts)))
        for part in parts:
            found[:, : part.shape[1]] += part
        return found

    def friction(self, velocity: Array, at_rest: float) -> Array:
        """Coulomb friction on each piece, from the coefficients of its velocity."""
        values = bernstein(velocity)
        forward, backward = values.max(axis=1) > self.case.rest, values.min(axis=1) < -self.case.rest
        return np.where(forward, self.case.coulomb, np.where(backward, -self.case.coulomb, at_rest))

    # at the nodes

    def instants(self, name: str) -> Instants:
        """The samples of a quantity and what each stands for (s; 1 in the plain sums of the Euler scheme)."""
        count, interval = self.case.count, np.arange(self.case.count)
        if not self.case.depends_on_top(name):
            weight = np.zeros(count + 1)
            weight[:-1] += self.step / 2
            weight[1:] += self.step / 2
            found = Instants(np.arange(count + 1), np.minimum(np.arange(count + 1), count - 1), weight)
        elif self.case.is_loaded(name):
            both = np.concatenate([interval, interval])
            found = Instants(np.concatenate([interval, interval + 1]), both, np.tile(self.step / 2, 2))
        else:
            found = Instants(interval, interval, self.step)
        return found._replace(weight=np.ones_like(found.weight)) if self.euler else found

    def sampled(self, i: int, instants: Instants) -> Array:
        return self.case.signal[i][instants.interval if i == self.case.order else instants.node]

    def samples(self, name: str, convention: int = 0) -> tuple[Array, Array]:
        """Values and weights; for ``convention`` see `Case.conventions`."""
        instants = self.instants(name)
        if not self.case.is_loaded(name):
            return self.sampled(DERIVATIVES.index(name), instants), instants.weight
        if self.case.splines:
            return self.samples_along(name, convention)
        velocity = self.sampled(1, instants)
        friction = self.case.coulomb * friction_signs(velocity, self.case.rest)[convention]
        return self.loaded(name, instants, velocity, friction), instants.weight

    def samples_along(self, name: str, convention: int) -> tuple[Array, Array]:
        """The same of a load over position, which is sampled at the four Lobatto points of every interval."""
        whole = _Pieces(np.arange(self.case.count), np.zeros(self.case.count), self.step)
        powers = np.array(LOBATTO) ** np.arange(self.case.order + 1)[:, None]
        position, velocity, acceleration = (
            (rows @ powers[: rows.shape[1]]).ravel() for rows in (self.rows(i, whole) for i in range(3))
        )
        friction = self.case.coulomb * friction_signs(velocity, self.case.rest)[convention]
        force = self.force_along(position, velocity, acceleration) + friction
        return self.of_force(name, force, velocity), np.outer(self.step, SHARES).ravel()

    def force_along(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """F(q) + J'(q) v²/2 + J(q) a + viscous·v."""
        inertia, force = self.case.inertia, self.case.viscous * velocity
        if isinstance(inertia, Curve):
            force = force + inertia.value[0] * acceleration
        elif inertia is not None:
            force = force + inertia.at(position) * acceleration + inertia.at(position, 1) * velocity**2 / 2
        return force if self.case.force is None else force + self.case.force.at(position)

    def loaded(self, name: str, instants: Instants, velocity: Array, friction: Array) -> Array:
        acceleration = self.sampled(2, instants)
        if self.case.splines:
            force = self.force_along(self.sampled(0, instants), velocity, acceleration) + friction
        else:
            assert isinstance(self.case.inertia, Curve)
            inertia = self.case.inertia.at(self.case.time[instants.node])
            force = inertia * acceleration + self.case.viscous * velocity + friction
        return self.of_force(name, force, velocity)

    def of_force(self, name: str, force: Array, velocity: Array) -> Array:
        """What is made of force and velocity."""
        if name in self.case.mixes:
            a, b = map(float, self.case.mixes[name])
            return a * force + b * velocity
        return force * velocity if name == "power" else self.drawn_power(name, force, velocity)

    def drawn_power(self, name: str, force: Array, velocity: Array) -> Array:
        """The power that heats the copper, or that the motor draws (negative: feeds back)."""
        motor = self.case.motor
        assert motor is not None
        current = force / motor.constant
        copper = motor.resistance * current**2
        if name == "copper power":
            return copper
        iron = motor.eddy * (velocity * current) ** 2
        iron += motor.hysteresis * np.abs(velocity) * np.abs(current) ** motor.exponent
        return copper + iron + motor.switching * np.abs(current) + force * velocity

    def peak(self, name: str) -> float:
        """How large a quantity gets, never too small; of a position the largest excursion."""
        origin = float(self.case.signal[0][0]) if name == "position" else 0.0
        low, high = _range(self.samples(name)[0]) if self.euler else self.extent(name)
        return max(abs(low - origin), abs(high - origin))

    @cached_property
    def magnitudes(self) -> tuple[float, ...]:
        """By derivative: the sum of what its polynomials are summed from, for bounds on rounding."""
        if self.euler:
            return self.peaks
        return tuple(
            sum(self.longest**j / math.factorial(j) * peak for j, peak in enumerate(self.peaks[i:]))
            for i in range(len(self.peaks))
        )

    @cached_property
    def noises(self) -> dict[str, float]:
        return {}

    def noise(self, name: str) -> float:
        """A generous bound on the rounding of any one value of a quantity."""
        if name not in self.noises:
            self.noises[name] = self._noise(name)
        return self.noises[name]

    def _noise(self, name: str) -> float:
        if not self.case.is_loaded(name):
            return 64 * EPS * self.magnitudes[DERIVATIVES.index(name)]
        assert self.case.inertia is not None
        inertia = float(max(abs(value) for value in self.case.inertia.value))
        force = inertia * self.magnitudes[2] + self.case.viscous * self.magnitudes[1] + self.case.coulomb
        force += sum(self.noise_along(spline) for spline in self.case.splines)
        if name in self.case.mixes:
            a, b = map(float, self.case.mixes[name])
            return 64 * EPS * (abs(a) * force + abs(b) * self.magnitudes[1])
        if name == "power":
            return 64 * EPS * force * self.magnitudes[1]
        return 64 * EPS * float(self.drawn_power(name, np.array(force), np.array(self.magnitudes[1])))

    def noise_along(self, spline: Spline) -> float:
        """How large what a spline adds to force can get, its digits lost in differences of rows included."""
        size, slope = float(np.abs(spline.value).max()), spline.at(spline.position, 1)
        if spline is self.case.force:
            return size
        lost = size / float(np.min(np.diff(spline.position)))
        return float((np.abs(slope).max() + lost) * self.magnitudes[1] ** 2)

    # answers

    def excess(self, name: str, tolerance: float) -> Found:
        """How far a limit is exceeded; where the axis rests, friction may take whatever value keeps the limit."""
        found = [Found(0.0)]
        for side, limit, label in zip((-1, 1), self.case.limits[name], ("min", "max"), strict=True):
            if limit is not None:
                ask = self.excess_at_nodes if self.euler else self.excess_between
                found.append(ask(name, side, limit, tolerance)._replace(note=label))
        worst = max(found, key=lambda one: (math.isnan(one.violation), one.violation))
        return worst._replace(rounding=self.noise(name))

    def total(self, name: str) -> float:
        """An RMS over the cycle or an energy of the move, with the friction at rest that makes the least of it."""
        least = min(to_float(value) for value in self.metric(name)[:-1])
        if name != "rms_force":
            return least
        square = least**2 * self.case.end_time + self.held**2 * self.case.dwell
        return math.sqrt(square / (self.case.end_time + self.case.dwell))

    @property
    def held(self) -> float:
        """The force that holds a load over position through the dwell."""
        return 0.0 if self.case.force is None else float(self.case.force.at(self.case.signal[0][-1:])[0])

    def excess_in_total(self, name: str) -> Found:
        limit = self.case.limits[name][1]
        assert limit is not None
        return Found(max(self.total(name) - limit.value[0], 0.0), None, to_float(self.metric(name)[-1]))

    def excess_at_nodes(self, name: str, side: int, limit: Curve, tolerance: float) -> Found:
        instants = self.instants(name)
        values = self.samples(name)[0]
        if name in self.case.mixes:
            velocity = self.sampled(1, instants)
            sign = np.where(np.abs(velocity) <= self.case.rest, -side, np.sign(velocity))
            values = self.loaded(name, instants, velocity, self.case.coulomb * sign)
        time = self.case.time[instants.node]
        over = side * (values - limit.at(time))
        k = int(np.argmax(over))
        return Found(float(over[k]), float(time[k])) if over[k] > 0 else Found(0.0)

    def excess_between(self, name: str, side: int, limit: Curve, tolerance: float) -> Found:
        at_rest, slack = -side * self.case.coulomb if self.case.is_loaded(name) else 0.0, tolerance * 1e-3
        if len(limit.value) == 1 and side * (self.extent(name, at_rest)[side > 0] - limit.value[0]) <= slack:
            return Found(0.0)
        rows = self.polynomial(name, at_rest)[1]
        over = side * (rows - self.limit_rows(limit, self.pieces_of(name), rows.shape[1] - 1))
        if over.max() <= slack:
            return Found(0.0)
        value, piece, s = highest(over, slack, 0.0)
        interval, offset, length = (values[piece] for values in self.pieces_of(name))
        return Found(value, float(self.case.time[interval] + offset + s * length))

    def limit_rows(self, limit: Curve, pieces: _Pieces, degree: int) -> Array:
        """A limit in Bernstein form, of degree one at least where it varies."""
        if len(limit.value) == 1:
            return np.full((1, 1), limit.value[0])
        left, right = self.line(limit, pieces)
        return left[:, None] + (right - left)[:, None] * np.linspace(0.0, 1.0, max(degree, 1) + 1)

    def objective(self) -> list[Number]:
        """The objective for each convention of friction at rest, and its rounding."""
        terms = self.case.terms
        conventions = self.case.conventions(*(name for name, _, _ in terms))
        totals = [sum(weight * self.term(name, norm, c)[0] for name, norm, weight in terms) for c in conventions]
        rounding = sum(weight * self.term(name, norm, 0)[1] for name, norm, weight in terms)
        return [*totals, rounding + 1e-12 * abs(totals[0])]

    def term(self, name: str, norm: str | None, convention: int) -> tuple[float, float]:
        """The value and rounding of one term without its weight; a norm we do not know counts as nothing."""
        if name == "time":
            return self.case.duration, 0.0
        quantity = POWERS.get(name, name)
        values, weights = self.samples(quantity, convention)
        if name in POWERS:
            weights = np.full_like(weights, self.step[0]) if self.euler else weights
            if name != "energy":
                values = self.counted(values) if name == "electrical_energy" else values
                return float(weights @ values), self.noise(quantity) * float(np.sum(weights))
            norm = "l1"
        elif name == "position":
            values = values - values[0]
        duration = 1.0 if self.euler else self.case.end_time
        noise = np.full_like(values, self.noise(quantity))
        return _norm(norm, values, weights, duration), _norm(norm, noise, weights, duration)

    def excess_of_term(self, name: str, norm: str | None, most: float) -> Found:
        """By how much a term exceeds its ceiling, by the convention on friction at rest that makes the least of it."""
        found = [self.term(name, norm, convention) for convention in self.case.conventions(name)]
        value, rounding = min(found)
        return Found(max(value - most, 0.0), None, rounding + 1e-12 * abs(value))

    def counted(self, values: Array) -> Array:
        """Electrical power as it counts: of what is fed back the share that is recovered."""
        assert self.case.motor is not None
        return np.where(values > 0, values, self.case.motor.recovery * values)

    def metric(self, name: str) -> list[Number]:
        """A metric for each convention of friction at rest, and its rounding."""
        kind, quantity = metric_of(name)
        found = self.metric_at_nodes(kind, quantity) if self.euler else self.metric_between(kind, quantity)
        span = 1.0 if kind in ("peak", "rms") else self.case.end_time
        return [*found, self.noise(quantity) * span + (_PEAK if kind == "peak" else _SUM) * to_float(found[0])]

    def metric_at_nodes(self, kind: str, quantity: str) -> list[Number]:
        found: list[Number] = []
        weights = np.full(self.case.count + 1, self.step[0])
        weights[[0, -1]] *= (1.0, 0.0) if kind == "distance" else 0.5  # a path as the scheme integrates it, eq. (4)
        if self.case.depends_on_top(quantity):
            weights = self.step
        for convention in self.case.conventions(quantity):
            values = self.samples(quantity, convention)[0]
            if kind in ("drawn", "fed back"):
                values = self.counted(values) if kind == "drawn" else np.maximum(-values, 0.0)
                found.append(float(weights @ values))
                continue
            norm = {"peak": "linf", "rms": "l2"}.get(kind, "l1")
            found.append(_norm(norm, values, weights, self.case.end_time))
        return found

    def metric_between(self, kind: str, quantity: str) -> list[Number]:
        coulomb = self.case.coulomb if self.case.feels_friction_at_rest(quantity) else 0.0
        resting = (0.0, coulomb, -coulomb) if coulomb else (0.0,)
        if kind == "peak":  # friction at rest first as it makes the least of the peak
            found = [self.peak_between(quantity, -coulomb, coulomb)] if coulomb else []
            return [*found, *(self.peak_between(quantity, at_rest, at_rest) for at_rest in resting)]
        length = self.pieces_of(quantity).length
        if kind == "rms":
            squares = [square_integral(self.polynomial(quantity, at_rest)[0], length) for at_rest in resting]
            return [math.sqrt(square / self.case.end_time) for square in squares]
        if kind == "copper":
            assert self.case.motor is not None
            squares = [square_integral(self.polynomial("current", at_rest)[0], length) for at_rest in resting]
            return [self.case.motor.resistance * square for square in squares]
        if kind in ("drawn", "fed back"):
            return [self.flow(kind, at_rest) for at_rest in resting]
        return [absolute_integral(self.polynomial(quantity)[1], length, _SUM / 4)]

    @cached_property
    def exchanged(self) -> float:
        """The energy that goes to and fro, mechanical and as heat, J."""
        return sum(to_float(self.metric(name)[0]) for name in ("energy", "copper_loss"))

    def flow(self, kind: str, at_rest: float) -> float:
        """The electrical energy of the move, or the energy fed back in it."""
        assert self.case.motor is not None
        force, velocity = self.polynomial("force", at_rest)[0], self.velocity_rows
        drawn, returned = both_signs(
            lambda index, s: self.drawn_power(
                "electrical power", values_at(force, index, s), values_at(velocity, index, s)
            ),
            self.one_way.length,
        )
        return drawn - self.case.motor.recovery * returned if kind == "drawn" else returned

    def peak_between(self, quantity: str, rest_above: float, rest_below: float) -> float:
        above, below = self.polynomial(quantity, rest_above)[1], self.polynomial(quantity, rest_below)[1]
        reached = max(_range(above[:, [0, -1]])[1], -_range(below[:, [0, -1]])[0], 0.0)  # below it friction holds
        most = max(self.extent(quantity, rest_above)[1], -self.extent(quantity, rest_below)[0])
        if most <= reached * (1 + _PEAK):
            return reached
        return highest(np.concatenate([above, -below]), 0.0, _PEAK)[0]


def _range(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def metric_of(name: str) -> tuple[str, str]:
    """What kind of metric of which quantity a name asks for."""
    special = {
        "energy": ("l1", "power"),
        "distance": ("distance", "velocity"),
        "copper_loss": ("copper", "copper power"),
        "electrical_energy": ("drawn", "electrical power"),
        "brake_energy": ("fed back", "electrical power"),
    }
    kind, _, quantity = name.partition("_")
    return special.get(name, (kind, quantity))


def friction_signs(velocity: Array, rest: float) -> list[Array]:
    """Signs of friction at samples, by convention (see `Case.conventions`)."""
    sign = np.sign(velocity)
    resting = np.abs(velocity) <= rest
    return [np.where(resting, 0.0, sign), np.where(resting, 1.0, sign), np.where(resting, -1.0, sign), sign]


def _norm(norm: str | None, values: Array, weights: Array, duration: float) -> float:
    if norm == "l1":
        return float(weights @ np.abs(values))
    if norm == "l2":
        return math.sqrt(weights @ np.square(values) / duration)
    return float(np.abs(values).max()) if norm == "linf" else 0.0
