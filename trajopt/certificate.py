"""Lower bounds by weak duality, recomputed from the dual vector by our own arithmetic; a solver's gap is only a claim.

For the cone program min ½x'Px + q'x, Ax + s = b, s in K, and any z in the dual cone, convexity gives for every
feasible x' with |x'| <= reach:

    f(x') >= -½x'Px - b'z - reach·||Px + q + A'z||_1        (the last term pays for inexact stationarity)

It bounds the discretised problem: no move on this mesh and scheme is better.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from trajopt.affine import NONE
from trajopt.model import Floats, Integers

REACH = 1e3  # or ten times the largest value found: no scaled variable of an optimal move is assumed to be larger
FARTHEST: Final = 1e5  # and none of any move
_PAID: Final = 1e-12  # of the value: what inexact stationarity may take off a bound without being mended
_MANY: Final = 5000  # rows of a system
_WAYS: Final = ((1e-13, False), *((ridge, True) for ridge in (1e-13, 1e-15, 1e-16, 1e-17)))  # of `_restored`


@dataclass(frozen=True)
class ConeProgram:
    """min ½x'Px + q'x with Ax + s = b; s is zero on the first ``zero`` rows, nonnegative on the next ``nonnegative``,
    and in second-order cones of the sizes ``cones`` on the rest. ``opposite``: (n,) nonnegative rows, counted from the
    first of them, and (n,) those with the same coefficients but for the sign, the other sides of the same limits."""

    P: sparse.csc_array
    q: Floats
    A: sparse.csr_array
    b: Floats
    zero: int
    nonnegative: int
    cones: tuple[int, ...] = ()
    opposite: tuple[Integers, Integers] = (NONE, NONE)

    def value(self, x: Floats) -> float:
        """The objective at x."""
        return float(0.5 * x @ (self.P @ x) + self.q @ x)


def lower_bound(program: ConeProgram, x: Floats, z: Floats, wanted: float = np.inf) -> float:
    """A lower bound on the optimal value from a primal and a dual vector, both possibly inexact; -inf if not finite.
    A better one than ``wanted`` is not looked for."""
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(z))):
        return -np.inf
    reach = _reach(program, max(REACH, 10 * float(np.max(np.abs(x), initial=0.0))))
    z = _into_dual_cone(program, z)
    best, unpaid = _bound(program, x, z, reach)
    enough = _PAID * abs(program.value(x))
    for ridge, moving in _WAYS[1:] + _WAYS[:1] if program.P.nnz else _WAYS:  # what is curved is best met by moving x
        if unpaid <= enough or best > wanted:
            break
        for y, w in _restored(program, x, z, ridge, moving):
            bound, unpaid = _bound(program, y, w, reach)
            best = max(best, bound)
            if unpaid <= enough or best > wanted:
                break
    return best


def _bound(program: ConeProgram, x: Floats, z: Floats, reach: Floats) -> tuple[float, float]:
    """The bound, and what inexact stationarity took off it."""
    slope = program.P @ x
    residual = float(reach @ np.abs(slope + program.q + program.A.T @ z))
    return float(-0.5 * x @ slope - program.b @ z - residual), residual


def is_infeasible(program: ConeProgram, z: Floats) -> bool:
    """Whether z proves that no x with |x| <= reach satisfies Ax + s = b (Farkas): b'z + reach·|A'z| < 0. Here reach
    is FARTHEST for what has no bounds: far beyond what moves within limits can be."""
    if not np.all(np.isfinite(z)) or not np.any(z):
        return False
    z = _into_dual_cone(program, z / np.max(np.abs(z)))
    reach = _reach(program, FARTHEST)
    nothing = np.zeros(len(program.q))
    restored = _restored(replace(program, q=nothing), nothing, z, *_WAYS[0])
    return any(_separates(program, w, reach) for w in (z, *(w for _, w in restored)))


def _separates(program: ConeProgram, z: Floats, reach: Floats) -> bool:
    rounding = 1e-13 * float(np.abs(program.b) @ np.abs(z))
    return bool(program.b @ z + reach @ np.abs(program.A.T @ z) < -rounding)


def _reach(program: ConeProgram, otherwise: float) -> Floats:
    """(n,) what no variable exceeds in size: by its own bounds where rows with one entry state them."""
    below, above = np.full(len(program.q), otherwise), np.full(len(program.q), otherwise)
    A, rows = program.A, slice(program.zero, program.zero + program.nonnegative)
    first = A.indptr[rows]
    single = np.flatnonzero(A.indptr[rows.start + 1 : rows.stop + 1] - first == 1)
    columns, entries = A.indices[first[single]], A.data[first[single]]
    bounds = program.b[rows][single] / entries
    up = entries > 0
    np.minimum.at(above, columns[up], np.abs(bounds[up]))
    np.minimum.at(below, columns[~up], np.abs(bounds[~up]))
    reach: Floats = np.maximum(below, above)
    return reach


def _into_dual_cone(program: ConeProgram, z: Floats) -> Floats:
    """z with every part projected onto its dual cone; equality multipliers are free."""
    z = _nonnegative(program, z.copy())
    if not program.cones:
        return z
    places, head, length = _tails(program, z)
    outside = length > head
    moved = np.where(outside, np.maximum((head + length) / 2, 0.0), head)
    return _resized(program, z, places, moved, np.where(outside, moved / np.where(outside, length, 1.0), 1.0))


def _under_heads(program: ConeProgram, z: Floats) -> Floats:
    """z, in place, with no negative multipliers of inequalities, and tails of cones no longer than their heads."""
    places, head, length = _tails(program, z)
    head = np.maximum(head, 0.0)
    share = np.minimum(1.0, head / np.maximum(length, 1e-300))
    return _resized(program, _nonnegative(program, z), places, head, share)


def _nonnegative(program: ConeProgram, z: Floats) -> Floats:
    rows = z[program.zero : program.zero + program.nonnegative]
    np.maximum(rows, 0.0, out=rows)
    return z


def _tails(program: ConeProgram, z: Floats) -> tuple[Integers, Floats, Floats]:
    """Of every cone, where its head is, the head, and the length of the tail."""
    if not program.cones:
        return NONE, np.empty(0), np.empty(0)
    first, sizes = program.zero + program.nonnegative, np.array(program.cones)
    heads = np.cumsum(sizes) - sizes
    squares = np.square(z[first:])
    squares[heads] = 0.0
    return first + heads, z[first + heads], np.sqrt(np.add.reduceat(squares, heads))


def _resized(program: ConeProgram, z: Floats, places: Integers, head: Floats, share: Floats) -> Floats:
    """z, in place, with other heads of cones, and shares of their tails."""
    if program.cones:
        z[program.zero + program.nonnegative :] *= np.repeat(share, program.cones)
        z[places] = head
    return z


def _restored(
    program: ConeProgram, x: Floats, z: Floats, ridge: float, moving: bool
) -> Iterator[tuple[Floats, Floats]]:
    """x and z moved, again and again, so that Px + q + A'z nearly vanishes: multipliers by the least change, weighted
    by the square of each, so that small ones stay nonnegative, and with free equality multipliers; if ``moving`` also
    x, where the objective is curved, and the tails of cone multipliers, no longer than their heads.

    The change of z is W A dx with (P + A'WA + ridge) dx = -(Px + q + A'z), solved in its sparse quasi-definite form:
    A'WA itself is dense where one variable appears in all rows, as a peak does.
    """
    weight = _weights(program, z, moving)
    rows = np.flatnonzero(weight > 1e-30 * max(float(weight.max(initial=0.0)), 1e-270))
    if not len(rows):
        return
    A, n = program.A[rows], len(x)
    own = A.power(2).T @ weight[rows]  # the diagonal of A'WA: each variable has its own size
    regular: Any = ridge * sparse.diags_array(np.where(own > 0, own, 1.0))
    if moving:
        regular = regular + program.P
    K = sparse.csc_array(sparse.block_array([[regular, A.T], [A, -sparse.diags_array(1 / weight[rows])]]))
    order: Literal["MMD_AT_PLUS_A", "COLAMD"]
    order = "MMD_AT_PLUS_A" if K.shape[0] < _MANY else "COLAMD"  # less fill; but its own time grows with the square
    try:
        factors = splu(K, permc_spec=order, diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:  # nothing to factorise: the bound stays valid, only looser
        return
    for _ in range(4):
        right = -np.concatenate([program.P @ x + program.q + program.A.T @ z, np.zeros(len(rows))])
        step = factors.solve(right)
        step += factors.solve(right - K @ step)
        if not np.max(np.abs(step)) < 1e100:  # nearly singular: nothing is restored
            return
        x = x + step[:n] if moving else x
        change = np.zeros(len(z))
        change[rows] = step[n:]
        z = _under_heads(program, z + change)
        yield x, z


def _weights(program: ConeProgram, z: Floats, tails: bool) -> Floats:
    heads = _tails(program, z)[1] * tails
    of_cones = np.repeat(heads**2, program.cones)
    inequalities = z[program.zero : program.zero + program.nonnegative]
    return np.concatenate([np.ones(program.zero), inequalities**2, of_cones])
