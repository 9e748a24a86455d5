"""Lower bounds by weak duality, recomputed from the dual vector by our own arithmetic; a solver's gap is only a claim.

For the cone program min ½x'Px + q'x, Ax + s = b, s in K, and any z in the dual cone, convexity gives for every
feasible x' with |x'| <= reach:

    f(x') >= -½x'Px - b'z - reach·||Px + q + A'z||_1        (the last term pays for inexact stationarity)

It bounds the discretised problem: no move on this mesh and scheme is better.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

Floats = NDArray[np.float64]
REACH = 1e3  # or ten times the largest value found: no scaled variable of an optimal move is assumed to be larger


@dataclass(frozen=True)
class ConeProgram:
    """min ½x'Px + q'x with Ax + s = b; s is zero on the first ``zero`` rows, nonnegative on the next ``nonnegative``,
    and in second-order cones of the sizes ``cones`` on the rest."""

    P: sparse.csc_array
    q: Floats
    A: sparse.csc_array
    b: Floats
    zero: int
    nonnegative: int
    cones: tuple[int, ...] = ()

    def value(self, x: Floats) -> float:
        """The objective at x."""
        return float(0.5 * x @ (self.P @ x) + self.q @ x)


def lower_bound(program: ConeProgram, x: Floats, z: Floats) -> float:
    """A lower bound on the optimal value from a primal and a dual vector, both possibly inexact; -inf if not finite."""
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(z))):
        return -np.inf
    reach = _reach(program, max(REACH, 10 * float(np.max(np.abs(x), initial=0.0))))
    z = _into_dual_cone(program, z)
    gradient = program.P @ x + program.q
    residual = gradient + program.A.T @ z
    if reach @ np.abs(residual) > 1e-9 * abs(program.value(x)):
        z = _restore_stationarity(program, z, gradient)
        residual = gradient + program.A.T @ z
    curvature = 0.5 * x @ (program.P @ x)
    return float(-curvature - program.b @ z - reach @ np.abs(residual))


def is_infeasible(program: ConeProgram, z: Floats) -> bool:
    """Whether z proves that no x with |x| <= reach satisfies Ax + s = b (Farkas): b'z + reach·|A'z| < 0."""
    if not np.all(np.isfinite(z)) or not np.any(z):
        return False
    z = _into_dual_cone(program, z / np.max(np.abs(z)))
    reach = _reach(program, REACH)
    z = _restore_stationarity(program, z, np.zeros(len(program.q)))
    residual = program.A.T @ z
    rounding = 1e-13 * float(np.abs(program.b) @ np.abs(z))
    return bool(program.b @ z + reach @ np.abs(residual) < -rounding)


def _reach(program: ConeProgram, otherwise: float) -> Floats:
    """(n,) what no variable exceeds in size: by its own bounds where rows with one entry state them."""
    below, above = np.full(len(program.q), otherwise), np.full(len(program.q), otherwise)
    rows = sparse.csr_array(program.A[program.zero : program.zero + program.nonnegative])
    single = np.flatnonzero(np.diff(rows.indptr) == 1)
    columns, entries = rows.indices[rows.indptr[single]], rows.data[rows.indptr[single]]
    bounds = program.b[program.zero : program.zero + program.nonnegative][single] / entries
    up = entries > 0
    np.minimum.at(above, columns[up], np.abs(bounds[up]))
    np.minimum.at(below, columns[~up], np.abs(bounds[~up]))
    reach: Floats = np.maximum(below, above)
    return reach


def _into_dual_cone(program: ConeProgram, z: Floats) -> Floats:
    """z with every part projected onto its dual cone; equality multipliers are free."""
    z = z.copy()
    at = program.zero + program.nonnegative
    np.maximum(z[program.zero : at], 0.0, out=z[program.zero : at])
    if program.cones:
        sizes = np.array(program.cones)
        heads = np.cumsum(sizes) - sizes
        tails = z[at:].copy()
        head, tails[heads] = tails[heads], 0.0
        length = np.sqrt(np.add.reduceat(np.square(tails), heads))
        outside = length > head
        moved = np.where(outside, np.maximum((head + length) / 2, 0.0), head)
        z[at:] = tails * np.repeat(np.where(outside, moved / np.where(outside, length, 1.0), 1.0), sizes)
        z[at + heads] = moved
    return z


def _restore_stationarity(program: ConeProgram, z: Floats, gradient: Floats) -> Floats:
    """z moved so that gradient + A'z nearly vanishes: the least change, weighted by the square of each multiplier, so
    that small ones stay nonnegative, and with free equality multipliers. Cone multipliers stay as they are.

    The change is -W A y with (A'WA + ridge) y = gradient + A'z, solved in its sparse quasi-definite form: A'WA itself
    is dense where one variable appears in all rows, as a peak does.
    """
    weight = np.concatenate([np.ones(program.zero), z[program.zero :] ** 2])
    weight[program.zero + program.nonnegative :] = 0.0
    rows = np.flatnonzero(weight > 1e-24 * max(float(weight.max(initial=0.0)), 1e-300))
    if not len(rows):
        return z
    A, n = program.A[rows], len(gradient)
    ridge = 1e-13 * max(float(weight.max()), 1e-300)
    K = sparse.block_array([[ridge * sparse.eye_array(n), A.T], [A, -sparse.diags_array(1 / weight[rows])]])
    try:
        factors = splu(
            sparse.csc_array(K), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError:  # nothing to factorise: the bound stays valid, only looser
        return z
    z, inequality = z.copy(), rows >= program.zero
    for _ in range(4):
        step = factors.solve(np.concatenate([gradient + program.A.T @ z, np.zeros(len(rows))]))[n:]
        z[rows] = np.where(inequality, np.maximum(z[rows] - step, 0.0), z[rows] - step)
    return z
