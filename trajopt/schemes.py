"""Transcription schemes: how the chain of integrators crosses an interval, and what its samples stand for.

Both advance every derivative by its Taylor series over the step. `EXACT` keeps it whole: the top derivative is
constant on the interval and everything below is integrated exactly. `EULER` stops after the first term, which is
eq. (4) of Clemen & Rupp; it exists to reproduce published numbers, and so do its plain sums as norms.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, factorial
from typing import Any

import numpy as np

from trajopt.mesh import Floats
from trajopt.signals import SHARES, Arithmetic, Signal


@dataclass(frozen=True)
class Scheme:
    """A scheme by the number of Taylor terms it keeps, and its order of accuracy."""

    name: str
    terms: int
    accuracy: int

    def change(self, model: Arithmetic, chain: list[Any], i: int, steps: Any) -> Any:
        """(N,) by how much the i-th derivative grows over the intervals, from the chain above it at the left ends.

        ``chain[i]`` holds (N+1,) node values below the order and (N,) interval values at the order; ``steps`` (N,) s.
        """
        value: Any = None
        for r in range(1, min(self.terms, len(chain) - 1 - i) + 1):
            left = chain[i + r] if i + r == len(chain) - 1 else chain[i + r][:-1]
            part = model.times(steps**r / factorial(r), left)
            value = part if value is None else value + part
        return value

    def signal(self, model: Arithmetic, chain: list[Any], i: int, steps: Any) -> Signal:
        """The i-th derivative as a signal: its node values, and Bernstein coefficients where it is a polynomial."""
        degree = len(chain) - 1 - i
        if degree == 0:
            return Signal(None, (chain[i],))
        if self.terms == 1:
            return Signal(chain[i], ())
        pieces = [chain[i][:-1]]
        for b in range(1, degree):
            value = chain[i][:-1]
            for r in range(1, b + 1):
                value = value + model.times(comb(b, r) / comb(degree, r) * steps**r / factorial(r), chain[i + r][:-1])
            pieces.append(value)
        return Signal(chain[i], (*pieces, chain[i][1:]))

    def weights(self, signal: Signal, steps: Any) -> Any:
        """What fraction of the duration each sample of the signal stands for, from the (N,) ``steps`` as fractions of
        it (expressions where its parts are free); plain ones for Euler."""
        if signal.points:
            inner = [share * steps for share in SHARES]
            ends = [inner[0], inner[-1]] if signal.nodes is None else [2 * SHARES[0] * trapezoids(steps)]
            return np.concatenate([ends[0], *inner[1:-1], *ends[1:]])
        if signal.nodes is not None:
            if self.terms == 1:
                return np.ones(len(steps) + 1)
            return trapezoids(steps)
        if self.terms == 1:
            return np.ones(len(steps))
        return steps if signal.degree == 0 else np.concatenate([steps, steps]) / 2

    def rollout(self, start: Floats, top: Floats, steps: Floats) -> list[Floats]:
        """The chain that follows from ``start`` (m,) and the top derivative (N,): m arrays (N+1,) and ``top``."""
        order = len(start)
        chain: list[Floats] = [np.empty(0)] * order + [top]
        shares = [steps / r for r in range(1, min(self.terms, order) + 1)]
        for i in reversed(range(order)):
            change: Any = 0.0
            for r in reversed(range(1, min(self.terms, order - i) + 1)):  # Horner's scheme
                left = chain[i + r] if i + r == order else chain[i + r][:-1]
                change = shares[r - 1] * (left + change)
            chain[i] = np.empty(len(steps) + 1)
            chain[i][0] = 0.0
            np.cumsum(change, out=chain[i][1:])
            chain[i] += start[i]
        return chain

    def influence(self, i: int, order: int, node: int, steps: Floats) -> Floats:
        """(N,) the change of the i-th derivative at ``node`` per unit of the top derivative on each interval."""
        depth = order - i
        effect = np.zeros(len(steps))
        if self.terms == 1:
            later = np.arange(node - 1, -1, -1)
            effect[:node] = steps[:node] ** depth * [float(comb(int(n), depth - 1)) for n in later]
            return effect
        nodes = np.concatenate([[0.0], np.cumsum(steps)])
        left = nodes[node] - nodes[: node + 1]
        effect[:node] = (left[:-1] ** depth - left[1:] ** depth) / factorial(depth)
        return effect


def trapezoids(steps: Any) -> Any:
    """(N+1,) the weights of the trapezoidal rule."""
    return np.asarray(np.concatenate([steps, [0.0]]) / 2 + np.concatenate([[0.0], steps]) / 2)


EXACT = Scheme("exact", terms=4, accuracy=2)
EULER = Scheme("euler", terms=1, accuracy=1)
SCHEMES = {scheme.name: scheme for scheme in (EXACT, EULER)}
