"""Signals over the mesh: what a limit bounds, a norm measures and a load turns into force and power.

A signal is a polynomial on every interval, held by its Bernstein coefficients: they bound it between nodes, and sums
and products of polynomials are sums and products of coefficients. What a load over position makes is none; it is held
by its values at the Lobatto points of every interval, whose weights integrate polynomials of degree five exactly. The
same code works on the expressions of any model and on floats.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import comb, sqrt
from operator import add
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from trajopt.curve import Curve

LOBATTO: Final = (0.0, (1 - 1 / sqrt(5)) / 2, (1 + 1 / sqrt(5)) / 2, 1.0)
SHARES: Final = (1 / 12, 5 / 12, 5 / 12, 1 / 12)


class Arithmetic(Protocol):
    """What signals need of a model."""

    def times(self, factor: Any, x: Any) -> Any:
        """Elementwise product of a constant and an expression (or two expressions, where the model allows it)."""

    def concatenate(self, parts: list[Any]) -> Any:
        """One vector of several."""

    def squares(self, x: Any) -> Any:
        """The vector x²."""


class OnFloats:
    """The arithmetic of plain numpy arrays."""

    def times(self, factor: Any, x: Any) -> Any:
        return factor * x

    def concatenate(self, parts: list[Any]) -> Any:
        return np.concatenate(parts)

    def squares(self, x: Any) -> Any:
        return np.square(x)

    def magnitude(self, x: Any) -> Any:
        """|x|."""
        return np.abs(x)

    def along(self, position: Any, wanted: list[tuple[Curve, int]]) -> list[Any]:
        """The derivatives of curves, each by its order, at a vector of positions."""
        return [curve.at(position, order) for curve, order in wanted]

    def raised(self, x: Any, exponent: float, size: float) -> tuple[Any, Any]:
        """|x| to an exponent of one or more, and its slope in x."""
        return np.abs(x) ** exponent, exponent * np.abs(x) ** (exponent - 1) * np.sign(x)

    def signs(self, velocity: Signal, size: float) -> tuple[Any, tuple[Any, ...]]:
        """The sign of a velocity at the nodes, and at the ends of the intervals."""
        nodes = np.sign(velocity.nodes)
        return nodes, (nodes[:-1], nodes[1:])


class Smoothed:
    """What has corners, smoothed so that Ipopt can follow; on expressions and on floats."""

    def raised(self, x: Any, exponent: float, size: float) -> tuple[Any, Any]:
        """|x| to an exponent and its slope, from below: smoothed over 1e-4 of its size, with a convex function."""
        square, smooth = x * x * (1 / size**2), 1e-8
        value = (square + smooth) ** (exponent / 2) - smooth ** (exponent / 2)
        slope = exponent * x * (square + smooth) ** (exponent / 2 - 1)
        return size**exponent * value, size ** (exponent - 2) * slope

    def signs(self, signal: Signal, size: float) -> tuple[Any, tuple[Any, ...]]:
        """x/sqrt(x² + w²) at the nodes and at the ends of the intervals: the sign of a signal over its size, smoothed
        over w = 1e-3."""

        def smooth(values: Any) -> Any:
            x = values * (1 / size)
            return x / (x * x + 1e-6) ** 0.5

        if signal.nodes is None:
            return None, (smooth(signal.pieces[0]), smooth(signal.pieces[-1]))
        nodes = smooth(signal.nodes)
        return nodes, (nodes[:-1], nodes[1:])


class BetweenReversals(OnFloats):
    """The arithmetic of arrays where no velocity changes its sign between nodes."""

    def signs(self, velocity: Signal, size: float) -> tuple[Any, tuple[Any, ...]]:
        """The sign of a velocity at the nodes, and of its mean on the intervals, whose ends may rest."""
        return np.sign(velocity.nodes), (np.sign(np.mean(velocity.pieces or (np.zeros(1),), axis=0)),)


@dataclass(frozen=True)
class Signal:
    """``nodes`` (N+1,) values at nodes, None where the signal may jump there; ``pieces``: the Bernstein coefficients
    on the intervals, lowest first, (N,) each; empty where only the nodes mean something (Euler). With ``points`` the
    pieces are values at these fractions of the intervals."""

    nodes: Any
    pieces: tuple[Any, ...]
    points: tuple[float, ...] = ()

    @property
    def degree(self) -> int:
        """Degree of the interval polynomials."""
        return len(self.pieces) - 1

    @cached_property
    def rows(self) -> NDArray[np.float64]:
        """(degree + 1, N) the pieces of a signal of floats."""
        found = np.empty((len(self.pieces), max(map(np.size, self.pieces))))
        for row, piece in zip(found, self.pieces, strict=True):
            row[:] = piece
        return found

    def samples(self, model: Arithmetic) -> Any:
        """The values a norm sees: at the nodes, or on the intervals, or at both ends of every interval."""
        if self.points:
            return model.concatenate(self.stations)
        if self.nodes is not None:
            return self.nodes
        return self.pieces[0] if self.degree == 0 else model.concatenate([self.pieces[0], self.pieces[-1]])

    def within(self, model: Arithmetic, s: float) -> Any:
        """(N,) the values at a fraction ``s`` of every interval."""
        n = self.degree
        terms = [model.times(comb(n, i) * s**i * (1 - s) ** (n - i), x) for i, x in enumerate(self.pieces)]
        return sum(terms[1:], terms[0])

    @property
    def stations(self) -> list[Any]:
        """Vectors of the values where the signal is sampled: at the nodes, or at the left and at the right ends of the
        intervals; with ``points`` at the nodes and at those."""
        if self.points:
            return [*([] if self.nodes is None else [self.nodes]), *self.pieces]
        return [self.nodes] if self.nodes is not None else [self.pieces[0], self.pieces[-1]]

    def where(self, model: Arithmetic, other: Signal) -> list[Any]:
        """The values where another signal is sampled."""
        if other.points and not self.points:
            return [*([] if other.nodes is None else [self.nodes]), *(self.within(model, s) for s in other.points)]
        return self.stations if self.points or other.nodes is not None else [self.pieces[0], self.pieces[-1]]


def gauss(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points on [0, 1] and their shares: the mean of any polynomial of degree 2·count - 1, exactly."""
    points, weights = np.polynomial.legendre.leggauss(count)
    return (points + 1) / 2, weights / 2


def sampled(stations: list[Any], like: Signal) -> Signal:
    """The signal of which only the values are known where another one is sampled."""
    if like.points and like.nodes is not None:
        return Signal(stations[0], tuple(stations[1:]), like.points)
    return Signal(stations[0], ()) if len(stations) == 1 else Signal(None, tuple(stations), like.points)


def fitted(values: list[NDArray[np.float64]], points: NDArray[np.float64]) -> Signal:
    """The polynomials through values at ``points`` of every interval, ends included, as many as coefficients."""
    n = len(points) - 1
    basis = np.array([[comb(n, i) * s**i * (1 - s) ** (n - i) for i in range(n + 1)] for s in points])
    return Signal(None, tuple(np.linalg.solve(basis, np.stack(values))))


def constant(value: Any, intervals: int) -> Signal:
    """A signal that is ``value`` everywhere."""
    return Signal(np.full(intervals + 1, value), (np.full(intervals, value),))


def linear(nodes: Any) -> Signal:
    """The piecewise-linear signal through floats at the nodes."""
    return Signal(nodes, (nodes[:-1], nodes[1:]))


def _each(model: Arithmetic, combine: Callable[[Any, Any], Any], a: Signal, b: Signal) -> Signal:
    like = a if a.points else b
    return sampled([combine(x, y) for x, y in zip(a.where(model, like), b.where(model, like), strict=True)], like)


def product(model: Arithmetic, a: Signal, b: Signal) -> Signal:
    """a·b. ``a`` must be constant unless the model is nonconvex."""
    if a.points or b.points:
        return _each(model, model.times, a, b)
    nodes = None if a.nodes is None or b.nodes is None else model.times(a.nodes, b.nodes)
    if not a.pieces or not b.pieces:
        return Signal(nodes, ())
    degree = a.degree + b.degree
    pieces: list[Any] = []
    for k in range(degree + 1):
        parts = [
            model.times(comb(a.degree, i) * comb(b.degree, k - i) / comb(degree, k) * x, b.pieces[k - i])
            for i, x in enumerate(a.pieces)
            if 0 <= k - i <= b.degree
        ]
        pieces.append(sum(parts[1:], parts[0]))
    return Signal(nodes, tuple(pieces))


def plus(model: Arithmetic, a: Signal, b: Signal) -> Signal:
    """a + b, at the higher of the two degrees."""
    if a.points or b.points:
        return _each(model, add, a, b)
    nodes = None if a.nodes is None or b.nodes is None else a.nodes + b.nodes
    if not a.pieces or not b.pieces:
        return Signal(nodes, ())
    degree = max(a.degree, b.degree)
    a, b = (product(model, Signal(None, (1.0,) * (degree - x.degree + 1)), x) for x in (a, b))
    return Signal(nodes, tuple(x + y for x, y in zip(a.pieces, b.pieces, strict=True)))
