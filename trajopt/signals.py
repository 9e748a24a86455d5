"""Signals over the mesh: what a limit bounds, a norm measures and a load turns into force and power.

A signal is a polynomial on every interval, held by its Bernstein coefficients: they bound it between nodes, and sums
and products of polynomials are sums and products of coefficients. The same code works on the expressions of any model
and on floats.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import Any, Protocol

import numpy as np


class Arithmetic(Protocol):
    """What signals need of a model."""

    def times(self, factor: Any, x: Any) -> Any:
        """Elementwise product of a constant and an expression (or two expressions, where the model allows it)."""

    def concatenate(self, parts: list[Any]) -> Any:
        """One vector of several."""


class OnFloats:
    """The arithmetic of plain numpy arrays."""

    def times(self, factor: Any, x: Any) -> Any:
        return factor * x

    def concatenate(self, parts: list[Any]) -> Any:
        return np.concatenate(parts)

    def signs(self, velocity: Signal, size: float) -> tuple[Any, tuple[Any, ...]]:
        """The sign of a velocity at the nodes, and on the intervals (of its mean: it must not change on one)."""
        return np.sign(velocity.nodes), (np.sign(np.mean(velocity.pieces or (np.zeros(1),), axis=0)),)


@dataclass(frozen=True)
class Signal:
    """``nodes`` (N+1,) values at nodes, None where the signal may jump there; ``pieces``: the Bernstein coefficients
    on the intervals, lowest first, (N,) each; empty where only the nodes mean something (Euler)."""

    nodes: Any
    pieces: tuple[Any, ...]

    @property
    def degree(self) -> int:
        """Degree of the interval polynomials."""
        return len(self.pieces) - 1

    def samples(self, model: Arithmetic) -> Any:
        """The values a norm sees: at the nodes, or on the intervals, or at both ends of every interval."""
        if self.nodes is not None:
            return self.nodes
        return self.pieces[0] if self.degree == 0 else model.concatenate([self.pieces[0], self.pieces[-1]])


def constant(value: Any, intervals: int) -> Signal:
    """A signal that is ``value`` everywhere."""
    return Signal(np.full(intervals + 1, value), (np.full(intervals, value),))


def linear(nodes: Any) -> Signal:
    """The piecewise-linear signal through floats at the nodes."""
    return Signal(nodes, (nodes[:-1], nodes[1:]))


def product(model: Arithmetic, a: Signal, b: Signal) -> Signal:
    """a·b. ``a`` must be constant unless the model is nonconvex."""
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
    nodes = None if a.nodes is None or b.nodes is None else a.nodes + b.nodes
    if not a.pieces or not b.pieces:
        return Signal(nodes, ())
    degree = max(a.degree, b.degree)
    a, b = (product(model, Signal(None, (1.0,) * (degree - x.degree + 1)), x) for x in (a, b))
    return Signal(nodes, tuple(x + y for x, y in zip(a.pieces, b.pieces, strict=True)))
