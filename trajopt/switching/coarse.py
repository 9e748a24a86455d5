"""A coarse linear program over a top derivative constant on intervals, and the arcs that its answer shows."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial, inf, isfinite
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import linprog

from trajopt.switching.chain import NAMES, Chain
from trajopt.switching.ramps import Piece
from trajopt.switching.stationary import Condition

Vector = npt.NDArray[np.float64]

_ACTIVE = 1e-5  # relative: a node this close to a limit is on it
_SLIVER = 0.02  # of an interval: an arc this short is rounding
_STILL = 0.03  # relative: a top derivative that is zero, a limit that is held
_GAP = 3  # nodes: a plateau rings on a grid, so that active nodes this close belong together


@dataclass(frozen=True)
class Touch:
    """A limit met at the border after ``arcs`` arcs: all derivatives between it and the top are zero but the next."""

    arcs: int
    derivative: int
    upper: bool


@dataclass(frozen=True)
class Sketch:
    """Arcs and touches as far as a grid can tell."""

    pieces: tuple[Piece, ...]
    touches: tuple[Touch, ...]


class Grid:
    """Moves of a fixed duration on so many intervals, with limits kept at the nodes."""

    def __init__(self, chain: Chain, duration: float, intervals: int) -> None:
        self.chain, self.step, n = chain, duration / intervals, chain.order
        lag = np.arange(intervals)[:, None] - np.arange(intervals)[None, :]
        late, early = (np.clip(lag + shift, 0, None) * self.step for shift in (1, 0))
        times = self.step * np.arange(1, intervals + 1)
        start = (0.0, *chain.start[1:])
        self.maps = [(late ** (n - i) - early ** (n - i)) / factorial(n - i) for i in range(n)]
        self.free: list[Vector] = [
            np.sum([x * times**k / factorial(k) for k, x in enumerate(start[i:])], axis=0) for i in range(n)
        ]

    def reaches(self) -> bool:
        return self._solve(np.zeros(len(self.maps[0])), 0) is not None

    def farthest(self, way: float) -> Vector | None:
        """(N,) top derivative of the move that goes farthest in a direction, its other end values as prescribed."""
        result = self._solve(-way * self.maps[0][-1], 1)
        return None if result is None else np.asarray(result.x)

    def prices(self, way: float) -> tuple[list[Condition], list[float]] | None:
        """The conditions that hold back the farthest move in a direction, and the costates' jumps there, scaled so that
        the position's at the end is ``way``."""
        result, last = self._solve(-way * self.maps[0][-1], 1), len(self.maps[0])
        if result is None:
            return None
        scale, sizes = float(np.max(np.abs(self.maps[0][-1]))), [float(np.max(np.abs(m))) for m in self.maps]
        found = [(Condition(last, 0, self.chain.distance), way)]
        for i, marginal in enumerate(result.eqlin.marginals, start=1):
            found.append((Condition(last, i, self.chain.end[i]), float(marginal) * scale / sizes[i]))
        rows = np.split(np.asarray(result.ineqlin.marginals), len(result.ineqlin.marginals) // (last - 1) or 1)
        for (i, sign, limit), marginals in zip(self._sides(), rows, strict=False):
            for k in map(int, np.flatnonzero(marginals)):
                found.append((Condition(k + 1, i, sign * limit), float(sign * marginals[k]) * scale / sizes[i]))
        return [c for c, _ in found], [p for _, p in found]

    def _sides(self) -> list[tuple[int, float, float]]:
        """(derivative, sign, limit of what has that sign) of all finite limits below the top."""
        return [
            (i, sign, limit)
            for i, (low, high) in enumerate(self.chain.limits[:-1])
            for sign, limit in ((1.0, high), (-1.0, -low))
            if limit < inf
        ]

    def _solve(self, cost: Vector, prescribed: int) -> Any:
        sizes = [np.max(np.abs(m)) for m in self.maps]
        if not all(sizes):  # of a duration so short that nothing moves
            return None
        rows = [sign * self.maps[i][:-1] / sizes[i] for i, sign, _ in self._sides()]
        bounds = [(limit - sign * self.free[i][:-1]) / sizes[i] for i, sign, limit in self._sides()]
        goal = (self.chain.distance, *self.chain.end[1:])
        ends = np.array([self.maps[i][-1] / sizes[i] for i in range(prescribed, self.chain.order)])
        goals = [(goal[i] - self.free[i][-1]) / sizes[i] for i in range(prescribed, self.chain.order)]
        result = linprog(
            cost / (np.max(np.abs(cost)) or 1.0),
            np.vstack(rows) if rows else None,
            np.concatenate(bounds) if rows else None,
            ends if len(ends) else None,
            goals if len(ends) else None,
            bounds=self.chain.top,
            method="highs",
        )
        return result if result.status == 0 else None

    def sketch(self, tops: Vector) -> Sketch:
        """The arcs that a solution shows: plateaus where a limit holds, elsewhere the top derivative at its limits, an
        interval between them divided as its mean demands."""
        held, touched = self._active(tops)
        pieces: list[Piece] = []
        touches: list[Touch] = []
        for k, u in enumerate(tops):
            here = held[k]
            before, after = (held[i] if 0 <= i < len(tops) else None for i in (k - 1, k + 1))
            for active, share in [(here, 1.0)] if here else self._shares(u, before, after, pieces):
                if share <= _SLIVER:
                    continue
                joined = pieces and pieces[-1].active == active and not (touches and touches[-1].arcs == len(pieces))
                length = share * self.step + (pieces.pop().duration if joined else 0.0)
                pieces.append(Piece(self._top(active), float(length), active))
            if k in touched and pieces:
                touches.append(Touch(len(pieces), *touched[k]))
        return Sketch(tuple(pieces), tuple(touches))

    def _top(self, active: str) -> float:
        name, _, side = active.partition(".")
        return self.chain.top[side == "max"] if name == NAMES[self.chain.order] else 0.0

    def _shares(self, u: float, before: str | None, after: str | None, pieces: list[Piece]) -> list[tuple[str, float]]:
        """What an interval off the plateaus is made of, in order."""
        low, high = self.chain.top
        up, down = (f"{NAMES[self.chain.order]}.{side}" for side in ("max", "min"))
        if before or after:
            full = (up, u / high) if u > 0 else (down, u / low)
            rest = 1 - full[1]
            return [(before, rest), full] if before else [full, (str(after), rest)]
        share = (u - low) / (high - low)
        parts = [(up, share), (down, 1 - share)]
        # what continues the arc before comes first
        return parts if pieces and pieces[-1].active == up else parts[::-1]

    def _active(self, tops: Vector) -> tuple[list[str | None], dict[int, tuple[int, bool]]]:
        """The limit on which each interval runs, if any, and the nodes that touch one."""
        n = self.chain.order
        held: list[str | None] = [None] * len(tops)
        touched: dict[int, tuple[int, bool]] = {}
        distances: list[tuple[str, Vector]] = []
        for i in range(n):
            values = self.maps[i] @ tops + self.free[i]
            for side, limit in zip(("min", "max"), self.chain.limits[i], strict=True):
                if not isfinite(limit):
                    continue
                size = max(abs(limit), float(np.max(np.abs(values))))
                far = np.abs(values - limit) / size
                distances.append((f"{NAMES[i]}.{side}", np.maximum(far, np.concatenate([[1.0], far[:-1]]))))
                for first, last in _clusters(np.flatnonzero(far[:-1] <= _ACTIVE), _GAP):
                    if i == 0 or (i < n - 2 and last - first <= _GAP):
                        touched[(first + last) // 2] = (i, side == "max")
                    elif i < n - 1:
                        # a limit two below the top is held, if for less than the grid can show
                        held[first + (i < n - 2) : last + 1] = [f"{NAMES[i]}.{side}"] * (last - first + (i == n - 2))
        still = np.abs(tops) <= _STILL * max(self.chain.top)
        for k in map(int, np.flatnonzero(still)):
            name, far = min(distances, key=lambda item: float(item[1][k]), default=("", np.ones(len(tops))))
            if held[k] is None and far[k] <= _STILL:
                held[k] = name
        return held, {k: touch for k, touch in touched.items() if not any(held[max(k - 1, 0) : k + 3])}


def _clusters(nodes: npt.NDArray[np.intp], gap: int) -> list[tuple[int, int]]:
    out: list[tuple[int, int]] = []
    for k in map(int, nodes):
        if out and k - out[-1][1] <= gap:
            out[-1] = (out[-1][0], k)
        else:
            out.append((k, k))
    return out
