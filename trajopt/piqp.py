"""PIQP through its own interface: CVXPY's hands on no rows with two sides, which save it a fifth of its time."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Final

import numpy as np
from scipy import sparse

from trajopt.certificate import ConeProgram
from trajopt.model import Claim, Floats, Integers

_INFINITE: Final = 1e30
_CLAIMS: Final = {  # out of iterations is a failure: the next rung may do better
    "PIQP_SOLVED": Claim.OPTIMAL,
    "PIQP_PRIMAL_INFEASIBLE": Claim.INFEASIBLE,
    "PIQP_DUAL_INFEASIBLE": Claim.UNBOUNDED,
}


def solve(
    program: ConeProgram, opposite: tuple[Integers, Integers], settings: dict[str, Any]
) -> tuple[Claim, str, int, Floats, Floats]:
    """Solve a quadratic program: the claim, PIQP's word, iterations, and the primal and dual vectors of ``program``.

    ``opposite``: (n,) rows of inequalities, and (n,) those with the same coefficients but for the sign. Raises
    ImportError where PIQP is not installed.
    """
    piqp: Any = import_module("piqp")
    solver = piqp.SparseSolver()
    for name, value in settings.items():
        setattr(solver.settings, name, getattr(piqp.KKTSolver, value) if name == "kkt_solver" else value)
    zero, (first, second) = program.zero, opposite
    upper = program.b[zero:]
    lower, kept = np.full(len(upper), -_INFINITE), np.ones(len(upper), dtype=bool)
    lower[first], kept[second] = -upper[second], False
    rows = np.flatnonzero(kept)
    equal, within = _by_columns(program.A, [np.arange(zero), zero + rows])
    solver.setup(P=program.P, c=program.q, A=equal, b=program.b[:zero], G=within, h_l=lower[rows], h_u=upper[rows])
    solver.solve()
    result = solver.result
    at_upper, at_lower = np.zeros(len(upper)), np.zeros(len(upper))
    at_upper[rows], at_lower[rows] = result.z_u, result.z_l
    at_upper[second] = at_lower[first]
    dual = np.concatenate([result.y, at_upper])
    status = result.info.status.name
    return _CLAIMS.get(status, Claim.FAILED), status, result.info.iter, np.array(result.x), dual


def _by_columns(A: sparse.csr_array, parts: list[Integers]) -> list[sparse.csc_array]:
    """Some rows of A, and others, by columns: scipy takes as long to pick each as to turn all of it."""
    turned = A.tocsc()
    found = []
    for rows in parts:
        place = np.full(A.shape[0], -1, dtype=turned.indices.dtype)
        place[rows] = np.arange(len(rows))
        places = place[turned.indices]
        entries = np.flatnonzero(places >= 0)
        first = np.searchsorted(entries, turned.indptr)
        found.append(sparse.csc_array((turned.data[entries], places[entries], first), (len(rows), A.shape[1])))
    return found
