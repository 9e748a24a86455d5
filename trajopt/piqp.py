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
    A, zero = program.A, program.zero
    upper = program.b[zero:]
    lower, kept = np.full(len(upper), -_INFINITE), np.ones(len(upper), dtype=bool)
    first, second = opposite
    lower[first], kept[second] = -upper[second], False
    rows = np.flatnonzero(kept)
    equal, within = sparse.csc_array(A[:zero]), sparse.csc_array(A[zero + rows])
    solver.setup(
        P=program.P, c=program.q, A=equal, b=program.b[:zero], G=within, h_l=lower[rows], h_u=upper[rows]
    )  # fmt: skip
    solver.solve()
    result = solver.result
    dual = np.zeros(len(program.b))
    dual[:zero], dual[zero + rows] = result.y, result.z_u
    at_lower = np.zeros(len(upper))
    at_lower[rows] = result.z_l
    dual[zero + second] = at_lower[first]
    status = result.info.status.name
    return _CLAIMS.get(status, Claim.FAILED), status, result.info.iter, np.array(result.x), dual
