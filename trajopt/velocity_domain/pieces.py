"""A move over speed in pieces of its arcs, each a spectral series in a parameter that removes its singular ends.

On a piece, peak - speed runs from ``begin`` to ``end`` as begin + (end - begin)(3s² - 2s³), s in [0, 1]: at the peak,
where dt ~ d(speed)/sqrt(peak - speed), time is then a smooth function of s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.polynomial import chebyshev

from trajopt.velocity_domain.law import PU, PV, S2, S11, Codes, Law, Z, code
from trajopt.velocity_domain.motor import Floats

NODES: Final = 32
_GRID: Final = 240  # speeds at which the law is first looked at
_CLOSE: Final = 1e-13  # relative: how near its ends
_TAIL: Final = 1e-13  # of the duration of a move: last coefficients of a series that has converged
_NOISE: Final = 1e-11  # of the duration of a piece: the same, where the law itself has no more figures
_DEEPEST: Final = 40
_ROUNDS: Final = 10  # of narrowing a border, each to a sixteenth
_SHARES: Final = np.linspace(0, 1, 17)


@dataclass(frozen=True)
class Piece:
    """Part of one arc. ``way``: +1 up, -1 down, 0 at the peak. Series over s in [0, 1], Chebyshev: time, distance and
    cost since the start of the piece, s, rad, J."""

    way: int
    code: int
    begin: float  # peak - speed, rad/s
    end: float
    time: Floats
    distance: Floats
    cost: Floats

    @property
    def duration(self) -> float:
        return at_end(self.time)


def at_end(series: Floats) -> float:
    """The value of a series at s = 1."""
    return float(series.sum())


def nodes() -> Floats:
    """(NODES,) the parameters s at which a piece is computed."""
    return np.asarray(_basis()[0])


def series(values: Floats) -> Floats:
    """(k, NODES) values at the nodes -> (k, NODES) Chebyshev coefficients."""
    return np.asarray(values @ _basis()[1].T)


def integral(coefficients: Floats) -> Floats:
    """(k, NODES) series -> (k, NODES + 1) series of the integral from s = 0."""
    grown = chebyshev.chebint(coefficients, lbnd=-1, axis=1) / 2
    return np.asarray(grown)


def mapped(begin: Floats, end: Floats, s: Floats) -> Floats:
    """peak - speed at parameters s, without cancellation at either end."""
    return begin * (1 - s) ** 2 * (1 + 2 * s) + end * s**2 * (3 - 2 * s)


@lru_cache(maxsize=1)
def _basis() -> tuple[Floats, Floats]:
    x = np.cos(np.pi * (np.arange(NODES)[::-1] + 0.5) / NODES)
    transform = np.asarray(chebyshev.chebvander(x, NODES - 1).T * (2 / NODES), dtype=np.float64)
    transform[0] /= 2
    return (1 + x) / 2, transform


def pieces(law: Law) -> list[Piece]:
    """The pieces on the way up and on the way down, in the order of time, without a stay at the peak."""
    up = _way(law, law.rising, 1)
    return up[::-1] + _way(law, law.falling, -1)


def stay(law: Law, duration: float, limited: bool) -> Piece:
    """The piece at the peak speed, which may be the limit."""
    hold = law.motor.hold(law.peak)
    kind = code(PV if limited else PU, S11) if hold > 0 else code(Z, S2)
    over_time = np.array([duration / 2, duration / 2])
    return Piece(0, kind, 0.0, 0.0, over_time, law.peak * over_time, float(law.hold_cost(law.peak)) * over_time)


def deficit(parts: list[Piece], peak: float) -> float:
    """∫(peak - speed) dt."""
    return float(sum(peak * at_end(p.time) - at_end(p.distance) for p in parts))


def _way(law: Law, accelerations: Callable[[Floats], tuple[Floats, Codes]], way: int) -> list[Piece]:
    """The pieces of one way, from the peak to rest."""
    edges, kinds = borders(lambda y: accelerations(y)[1], law.peak)
    waiting = [(edges[i], edges[i + 1], kinds[i], 0) for i in range(len(kinds))]
    done: list[Piece] = []
    whole = 0.0
    while waiting:
        begin, end = (np.array([w[i] for w in waiting])[:, None] for i in (0, 1))
        if way > 0:
            begin, end = end, begin
        s = nodes()[None, :]
        below = mapped(begin, end, s)
        acceleration = accelerations(below.ravel())[0].reshape(below.shape)
        speed = law.peak - below
        current = law.motor.current(speed, acceleration)
        pace = (end - begin) * 6 * s * (1 - s) / -acceleration
        time = series(pace)
        whole = whole or float(np.abs(time[:, 0]).sum())
        enough = np.abs(time[:, -3:]).max(axis=1) <= np.maximum(_TAIL * whole, _NOISE * time[:, 0])
        total = integral(time), integral(series(pace * speed)), integral(series(pace * law.loss.cost(speed, current)))
        again = []
        for i, (near, far, kind, depth) in enumerate(waiting):
            if enough[i] or depth >= _DEEPEST:
                done.append(Piece(way, kind, float(begin[i, 0]), float(end[i, 0]), *(x[i] for x in total)))
            else:
                middle = (near + far) / 2
                again += [(near, middle, kind, depth + 1), (middle, far, kind, depth + 1)]
        waiting = again
    return sorted(done, key=lambda p: min(p.begin, p.end))


def borders(classify: Callable[[Floats], Codes], top: float) -> tuple[list[float], list[int]]:
    """Where a classification of (0, top) changes: the k + 1 edges from 0 to ``top`` and the k classes between them.
    Classes narrower than the grid are found where they lie between two others."""
    inner = mapped(np.zeros(1), np.full(1, top), np.linspace(0, 1, _GRID + 2)[1:-1])
    grid = np.concatenate([[_CLOSE * top], inner, [(1 - _CLOSE) * top]])
    found = classify(grid)
    edges, kinds = [0.0], [int(found[0])]
    change = np.flatnonzero(found[1:] != found[:-1])
    low, high = grid[change], grid[change + 1]
    before, after = found[change], found[change + 1]
    crossed: list[tuple[float, int]] = []
    while len(low):
        left, right = low, high
        for _ in range(_ROUNDS):
            inner = left[:, None] + (right - left)[:, None] * _SHARES
            other = classify(inner.ravel()).reshape(inner.shape) != before[:, None]
            other[:, -1] = True
            first, rows = other.argmax(axis=1), np.arange(len(left))
            left, right = inner[rows, np.maximum(first - 1, 0)], inner[rows, first]
        reached = classify(right)
        crossed += [(float(x), int(c)) for x, c in zip(right, reached, strict=True)]
        more = reached != after
        low, high, before, after = right[more], high[more], reached[more], after[more]
    for x, kind in sorted(crossed):
        edges.append(x)
        kinds.append(kind)
    return [*edges, top], kinds
