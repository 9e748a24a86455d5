"""An energy-optimal move of a servomotor: its cost, arcs, switch times, and its state at any time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from trajopt.velocity_domain.law import NAMES, NEUTRAL, NU, S2, SUBS, Law
from trajopt.velocity_domain.motor import Floats
from trajopt.velocity_domain.pieces import Piece, at_end, mapped


@dataclass(frozen=True)
class Arc:
    """A stretch of time, s, under one name."""

    name: str
    start: float
    end: float


@dataclass(frozen=True)
class State:
    """(n,) each: rad, rad/s, rad/s², A."""

    position: Floats
    velocity: Floats
    acceleration: Floats
    current: Floats


@dataclass(frozen=True)
class ServoOptimum:
    """The cheapest move of ``distance`` rad in ``duration`` s, with the law and the pieces it is made of."""

    law: Law
    pieces: tuple[Piece, ...]
    distance: float
    duration: float

    @cached_property
    def energy(self) -> float:
        """The cost, J."""
        return float(sum(at_end(p.cost) for p in self.pieces))

    @property
    def peak(self) -> float:
        """The largest speed, rad/s."""
        return self.law.peak

    @property
    def distance_price(self) -> float:
        """dE/d(distance), J/rad."""
        return self.law.slope

    @property
    def time_price(self) -> float:
        """dE/d(duration), W; positive where the move would be cheaper in less time."""
        return self.law.time_price

    @cached_property
    def starts(self) -> Floats:
        """(k + 1,) the times at which the k pieces start, and the end of the last."""
        return np.concatenate([[0.0], np.cumsum([p.duration for p in self.pieces])])

    @cached_property
    def arcs(self) -> tuple[Arc, ...]:
        """The arcs by the names of the paper: PA, PU, PV, Z, NU, NA; PC and NC where the drive limits the current. As
        there, NU in S2 and NU in S12 are two arcs: the current follows different laws."""
        kinds = [p.code if p.code // 4 == NU else 4 * (p.code // 4) for p in self.pieces]
        return self._grouped([name for name in NAMES for _ in range(4)], kinds)

    @cached_property
    def subtrajectories(self) -> tuple[Arc, ...]:
        """The sub-trajectories S11 (P > 0, u > 0), S2 (P <= 0) and S12 (P > 0, u < 0)."""
        return self._grouped(list(SUBS), [S2 if p.code % 4 == NEUTRAL else p.code % 4 for p in self.pieces])

    @property
    def sequence(self) -> str:
        return "-".join(arc.name for arc in self.arcs)

    @property
    def switch_times(self) -> tuple[float, ...]:
        """The times between arcs, s."""
        return tuple(arc.start for arc in self.arcs[1:])

    def at(self, time: Any) -> State:
        """The state at times within [0, duration], any shape flattened to (n,)."""
        time = np.clip(np.atleast_1d(np.asarray(time, dtype=float)).ravel(), 0.0, self.starts[-1])
        which = np.clip(np.searchsorted(self.starts, time, side="right") - 1, 0, len(self.pieces) - 1)
        before = np.concatenate([[0.0], np.cumsum([at_end(p.distance) for p in self.pieces])])
        position, below, acceleration = (np.zeros_like(time) for _ in range(3))
        for i in np.unique(which):
            piece, here = self.pieces[i], which == i
            s = _parameter(piece, time[here] - self.starts[i])
            below[here] = mapped(np.array(piece.begin), np.array(piece.end), s)
            position[here] = before[i] + chebyshev.chebval(2 * s - 1, piece.distance)
            acceleration[here] = self.acceleration_on(piece, below[here])
        velocity = self.law.peak - below
        return State(position, velocity, acceleration, self.law.motor.current(velocity, acceleration))

    def acceleration_on(self, piece: Piece, below: Floats) -> Floats:
        """(n,) accelerations at speeds ``below`` the peak on a piece, rad/s²."""
        if piece.way == 0:
            return np.zeros_like(below)
        return (self.law.rising if piece.way > 0 else self.law.falling)(below)[0]

    def _grouped(self, names: list[str], kinds: list[int]) -> tuple[Arc, ...]:
        found = []
        for kind, group in groupby(range(len(kinds)), key=lambda i: kinds[i]):
            members = list(group)
            found.append(Arc(names[kind], float(self.starts[members[0]]), float(self.starts[members[-1] + 1])))
        return tuple(found)


def _parameter(piece: Piece, elapsed: Floats) -> Floats:
    """(n,) the parameters s of a piece at times since its start, by bisection: time increases with s."""
    low, high = np.zeros_like(elapsed), np.ones_like(elapsed)
    for _ in range(54):
        middle = (low + high) / 2
        early = chebyshev.chebval(2 * middle - 1, piece.time) < elapsed
        low, high = np.where(early, middle, low), np.where(early, high, middle)
    return (low + high) / 2
