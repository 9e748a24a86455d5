"""The constraint equations of a move and the functions of its costate, in dimensionless backward time h = (T - t)/L.

With impulses A_i (the jumps of the input) at backward times h_i, the plant rests at its new equilibrium iff

    sum A_i D_j(h_i) = target_j,    j = 1 .. n,

where the D_j are divided exponentials of each group of neighbouring poles. For an isolated pole of multiplicity m they
span h^q exp(s_k h), q < m: the equations of Tuttle and Seering (1996), multiplied by exp(s_k T) against overflow. Poles
slow on the scale L share a group with those at zero, and a further node at zero makes their D_j step responses. The
switching function is sigma(h) = sum c_j D_j'(h).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from trajopt.plant.exponentials import Complexes, Floats, divided_exponentials

_CLOSE: Final = 1.0  # poles nearer than this on their effective horizon share a group
DECAYED: Final = 36.0  # exp(-36) is a rounding error


@dataclass(frozen=True)
class Group:
    """Neighbouring poles times L; ``targets`` for each. ``slow``: a node at zero stands before them. ``paired``: the
    conjugates are left out, so that real and imaginary parts both count."""

    nodes: tuple[complex, ...]
    targets: tuple[complex, ...]
    slow: bool
    paired: bool

    def rows(self, h: Floats) -> tuple[Floats, Floats, Floats]:
        """Three (k, len(h)) arrays: D and its first and second derivative."""
        nodes = ((0j,) if self.slow else ()) + self.nodes
        value = divided_exponentials(nodes, h)
        step = np.diag(np.array(nodes, complex)) + np.diag(np.ones(len(nodes) - 1), -1)
        first = int(self.slow)
        tables = (value, step @ value, step @ step @ value)
        return self._real(tables[0][first:]), self._real(tables[1][first:]), self._real(tables[2][first:])

    def right(self) -> Floats:
        """(k,) the targets of the rows."""
        return self._real(np.array(self.targets, complex)[:, None])[:, 0]

    def _real(self, table: Complexes) -> Floats:
        return np.vstack([table.real, table.imag]) if self.paired else table.real


@dataclass(frozen=True)
class Basis:
    """All groups of a plant at a horizon, and the (n,) sizes by which their rows are divided."""

    groups: tuple[Group, ...]
    sizes: tuple[float, ...]

    def tables(self, h: Floats) -> tuple[Floats, Floats, Floats]:
        """Three (n, len(h)) arrays: the scaled D, D' and D''."""
        parts = [group.rows(np.asarray(h, float)) for group in self.groups]
        sizes = np.array(self.sizes)[:, None]
        value, slope, curve = (np.vstack([part[i] for part in parts]) / sizes for i in range(3))
        return value, slope, curve

    def targets(self) -> Floats:
        """(n,) the scaled right-hand sides."""
        result: Floats = np.concatenate([group.right() for group in self.groups]) / np.array(self.sizes)
        return result


def basis_for(poles: Sequence[complex], horizon: float, u_ss: float, rest: float) -> Basis:
    """The basis of poles (1/s) for moves of about ``horizon`` seconds. ``u_ss`` is the final input in the caller's unit
    and ``rest`` = y_f/lim s^r G(s)/horizon^r in the same unit."""
    groups = tuple(_group(nodes, u_ss, rest) for nodes in _gathered([p * horizon for p in poles]))
    h = np.concatenate([[0.0], np.geomspace(1e-4, 1.0, 60)])
    peaks = [np.max(np.abs(group.rows(h)[0]), axis=1) for group in groups]
    return Basis(groups, tuple(float(x) for x in np.concatenate(peaks)))


def _gathered(nodes: list[complex]) -> list[list[complex]]:
    """Groups of nodes by single linkage; of two groups that are conjugates only the upper."""
    groups: list[list[complex]] = [[p for p in nodes if _is_slow(p)]]
    for p in (p for p in nodes if not _is_slow(p)):
        joined = [g for g in groups[1:] if any(_is_near(p, q) for q in g)]
        groups = [groups[0]] + [g for g in groups[1:] if g not in joined] + [[p, *(q for g in joined for q in g)]]
    upper = [g for g in groups if not all(p.imag < 0 for p in g)]
    return [g for g in upper if g]


def _is_slow(p: complex) -> bool:
    return abs(p) <= _CLOSE


def _is_near(p: complex, q: complex) -> bool:
    slowest = -max(p.real, q.real)
    return abs(p - q) * min(1.0, DECAYED / max(slowest, 1e-300)) <= _CLOSE


def _group(nodes: list[complex], u_ss: float, rest: float) -> Group:
    slow = _is_slow(nodes[0])
    ordered = sorted(nodes, key=lambda p: (p != 0, p.real, p.imag))
    paired = all(p.imag > 0 for p in ordered)
    targets: list[complex] = []
    rigid = ordered.count(0j)
    for j, p in enumerate(ordered):
        if not slow:
            targets.append(0j)
        elif j < rigid:
            targets.append(complex(rest if j == rigid - 1 else 0.0))
        else:
            targets.append((targets[-1] if targets else complex(u_ss)) / -p)
    return Group(tuple(ordered), tuple(targets), slow, paired)
