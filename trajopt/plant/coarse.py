"""The structure of a command from linear programs on a mesh: how far the input reaches, and its switching function.

At a fixed duration the greatest multiple of the wanted move that some input constant on each interval makes is a linear
program; its multipliers are the costate. The duration where the multiple is one is found by a secant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial
from typing import Final

import clarabel
import numpy as np
from scipy import sparse

from trajopt.plant.basis import Basis, basis_for
from trajopt.plant.exponentials import Floats
from trajopt.plant.sigma import roots

_LONGEST: Final = 4096.0  # durations are sought up to this multiple of the first guess
_MOST: Final = 1500  # intervals


@dataclass(frozen=True)
class Move:
    """What is asked, inputs in units of the larger limit: poles with those added for robustness, input limits, final
    input, and the state of the last integrator at rest, y_f/lim s^r G(s) in that unit and s^r."""

    poles: tuple[complex, ...]
    low: float
    high: float
    u_ss: float
    rest: float

    @property
    def rigid(self) -> int:
        """r."""
        return self.poles.count(0j)

    def basis(self, horizon: float) -> Basis:
        """The equations for moves of about ``horizon`` seconds."""
        return basis_for(self.poles, horizon, self.u_ss, self.rest / horizon**self.rigid)

    def guess(self) -> float:
        """s, the slowest time of the modes or of the rigid body."""
        times = [1 / abs(p) for p in self.poles if p]
        if self.rigid:
            times.append((factorial(self.rigid) * abs(self.rest)) ** (1 / self.rigid))
        return max(times)


@dataclass(frozen=True)
class Coarse:
    """An answer on a mesh: the duration, its basis and the costate c (n,), signed so that sigma > 0 asks for umax."""

    duration: float
    basis: Basis
    costate: Floats

    def switches(self) -> tuple[float, Floats]:
        """The sign of the first arc and the backward times of the roots of sigma, falling."""
        return roots(self.basis, self.costate, 1.0)


def coarse(move: Move, intervals: int, near: Floats, guess: float) -> Coarse:
    """The shortest duration on a mesh of about ``intervals``, finer about the fractions ``near``; ValueError if the end
    is out of reach at any. ``guess`` (s): where to begin."""
    factor = 2.0 if not len(near) else 1.0 + 1.0 / intervals
    low = top = guess
    low_reach = top_reach = _reach(move, guess, intervals, near)[0]
    while top_reach < 1:
        low, low_reach = top, top_reach
        top *= factor
        if top > _LONGEST * guess:
            raise ValueError(
                f"input limits: the end state is not reached within {low:.3g} s; widen the limits beyond u_ss"
            )
        top_reach = _reach(move, top, intervals, near)[0]
    while low_reach >= 1:
        top, top_reach = low, low_reach
        low /= factor
        low_reach = _reach(move, low, intervals, near)[0]
    return _secant(move, (low, top), (low_reach, top_reach), intervals, near)


def _secant(
    move: Move, times: tuple[float, float], reaches: tuple[float, float], intervals: int, near: Floats
) -> Coarse:
    """The duration where the reach is one, by the method of Illinois on logarithms."""
    (a, b), (fa, fb) = np.log(times), np.log(np.maximum(reaches, 1e-300))
    side = 0
    for _ in range(60):
        c = (a * fb - b * fa) / (fb - fa) if fb - fa < 50 else (a + b) / 2
        value, basis, costate = _reach(move, float(np.exp(c)), intervals, near)
        fc = float(np.log(max(value, 1e-300)))
        if abs(fc) < 1e-9 or b - a < 1e-12:
            break
        if fc > 0:
            b, fb = c, fc
            fa, side = (fa / 2 if side > 0 else fa), 1
        else:
            a, fa = c, fc
            fb, side = (fb / 2 if side < 0 else fb), -1
    return Coarse(float(np.exp(c)), basis, costate)


def mesh(poles: Sequence[complex], horizon: float, intervals: int, near: Floats) -> Floats:
    """(N+1,) backward times from 1 down to 0: equal steps that resolve every oscillation, finer ones near zero for
    modes that decay fast, and ever finer ones about the fractions ``near``."""
    fastest = max(abs(p.imag) for p in poles) * horizon
    count = int(min(max(intervals, intervals / 6 * fastest / np.pi), _MOST))
    layers = [
        x / abs(p.real * horizon) for p in poles if p.real for x in np.geomspace(0.05, 8.0, max(intervals // 6, 8))
    ]
    closer = np.concatenate([[0.0], *(sign * 0.3 ** np.arange(9) / count for sign in (-1.0, 1.0))])
    about = (near[:, None] + closer).ravel()
    nodes = np.concatenate([np.linspace(0.0, 1.0, count + 1), layers, about])
    nodes = np.unique(nodes[(nodes >= 0) & (nodes <= 1)])
    apart: Floats = nodes[np.append(True, np.diff(nodes) > 1e-9)][::-1]
    return apart


def _reach(move: Move, horizon: float, intervals: int, near: Floats) -> tuple[float, Basis, Floats]:
    """The greatest multiple of the move in ``horizon`` seconds, the basis, and the costate."""
    basis = move.basis(horizon)
    values = basis.tables(mesh(move.poles, horizon, intervals, near))[0]
    effect = values[:, :-1] - values[:, 1:]
    wanted = basis.targets() - move.u_ss * values[:, 0]
    size = float(np.linalg.norm(wanted))
    orthogonal, triangle = np.linalg.qr(effect.T)
    right = np.linalg.solve(triangle.T, wanted / size)
    stretch = float(np.linalg.norm(right))
    multiple, multipliers = _program(orthogonal.T, right / stretch, move.low - move.u_ss, move.high - move.u_ss)
    costate = np.linalg.solve(triangle, multipliers)
    return multiple / stretch / size, basis, costate / np.linalg.norm(costate)


def _program(rows: Floats, wanted: Floats, low: float, high: float) -> tuple[float, Floats]:
    """max x with rows w = x wanted, low <= w <= high: its value and the multipliers of the rows."""
    n, count = rows.shape
    equal = sparse.csc_array(np.column_stack([rows, -wanted]))
    eye = sparse.hstack([sparse.eye_array(count), sparse.csc_array((count, 1))])
    a = sparse.csc_matrix(sparse.vstack([equal, eye, -eye]))
    b = np.concatenate([np.zeros(n), np.full(count, high), np.full(count, -low)])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cost = np.zeros(count + 1)
    cost[-1] = -1.0
    cones = [clarabel.ZeroConeT(n), clarabel.NonnegativeConeT(2 * count)]
    found = clarabel.DefaultSolver(sparse.csc_matrix((count + 1, count + 1)), cost, a, b, cones, settings).solve()
    return float(found.x[-1]), -np.array(found.z[:n])
