"""Solvers of convex programs: PIQP itself, Clarabel and OSQP by CVXPY's interfaces. The only file that imports cvxpy.

Where PIQP does, CVXPY is not even imported: that takes as long as fifty solves.
"""

from __future__ import annotations

from importlib import import_module
from types import SimpleNamespace
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from trajopt.certificate import ConeProgram
from trajopt.model import Claim, Floats, Integers

Ended: TypeAlias = tuple[Claim, str, int, Floats, Floats]  # the claim, the solver's word, iterations, x and z
_CLARABEL: Final = {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11, "max_iter": 200}
_PIQP_TOLERANCES: Final = ("eps_abs", "eps_rel", "eps_duality_gap_abs", "eps_duality_gap_rel")
_SETTINGS: Final[dict[str, dict[str, Any]]] = {
    # Measured: four times as fast as Clarabel, as exact, in 10 to 25 iterations; or not at all. Longer steps with less
    # regularisation save an eighth of them; even longer ones fail at times.
    "piqp": dict.fromkeys(_PIQP_TOLERANCES, 1e-11) | {
        "max_iter": 50, "kkt_solver": "sparse_ldlt_ineq_cond", "preconditioner_iter": 3, "tau": 0.997,
        "delta_init": 1e-6, "preconditioner_scale_cost": True,
    },
    # A fifth slower, and reliable up to N = 100000, where more than this cannot be asked for; there shorter steps do
    # with fewer iterations.
    "piqp-firm": dict.fromkeys(_PIQP_TOLERANCES, 1e-9) | {
        "max_iter": 100, "reg_lower_limit": 1e-12, "preconditioner_iter": 3, "tau": 0.97, "delta_init": 1e-7,
    },
    # Measured: little regularisation is accurate, and fails from N = 20000 on; more solves those.
    "clarabel": _CLARABEL | {"static_regularization_constant": 1e-10},
    "clarabel-firm": _CLARABEL | {"static_regularization_constant": 1e-8},
    "clarabel-soft": _CLARABEL | {"static_regularization_constant": 1e-7},
    "clarabel-faer": _CLARABEL | {"static_regularization_constant": 1e-10, "direct_solve_method": "faer"},
    "osqp-last": {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 10_000, "polishing": True},
    "osqp": {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 200_000, "polishing": True},
}
RESCUES: Final = ("clarabel-faer", "osqp-last")  # another factorisation; slow, and not for cones: where none came near
QUADRATIC: Final = ("piqp", "piqp-firm")  # the rungs for linear and quadratic programs
LADDER: Final = (*QUADRATIC, "clarabel", "clarabel-firm", "clarabel-soft", *RESCUES)
_INFINITE: Final = 1e30
_FAR: Final = 0.3  # of a row, which has size one; measured: half and twice that are slower
_PIQP_CLAIMS: Final = {  # out of iterations is a failure: the next rung may do better
    "PIQP_SOLVED": Claim.OPTIMAL,
    "PIQP_PRIMAL_INFEASIBLE": Claim.INFEASIBLE,
    "PIQP_DUAL_INFEASIBLE": Claim.UNBOUNDED,
}


def run(solver: str, program: ConeProgram, seconds: float | None, near: Floats | None = None) -> Ended:
    """How a run by a rung of LADDER or ``osqp`` ended: the claim, the solver's word, its iterations, and the primal and
    dual vectors. Raises ImportError where the solver is not installed.

    ``near``: an x that keeps all rows, and to which the answer is probably close.
    """
    settings = _SETTINGS[solver]
    if solver in QUADRATIC:  # PIQP knows no time limit, but takes few iterations
        ended = None if near is None else _near(program, settings, near)
        return _by_piqp(program, settings) if ended is None else ended
    limit = {} if seconds is None else {"time_limit": seconds}
    return _by_cvxpy(solver.partition("-")[0], program, settings | limit)


def _near(program: ConeProgram, settings: dict[str, Any], x: Floats) -> Ended | None:
    """The optimum without the inequalities from which x is far; None where it does not keep those as well."""
    far = (program.b - program.A @ x)[program.zero :] > _FAR
    ended = _by_piqp(program, settings, far)
    claim, found = ended[0], ended[3]
    keeps = claim is Claim.OPTIMAL and np.all((program.A @ found <= program.b)[program.zero :][far])
    return ended if keeps else None


def _by_piqp(program: ConeProgram, settings: dict[str, Any], without: NDArray[np.bool_] | None = None) -> Ended:
    """PIQP by its own interface: CVXPY's hands on no rows with two sides, which save it a fifth of its time.
    ``without``: (n,) inequalities that are left out."""
    piqp: Any = import_module("piqp")
    solver = piqp.SparseSolver()
    for name, value in settings.items():
        setattr(solver.settings, name, getattr(piqp.KKTSolver, value) if name == "kkt_solver" else value)
    zero, (first, second) = program.zero, program.opposite
    upper = program.b[zero:] if without is None else np.where(without, _INFINITE, program.b[zero:])
    lower = np.full(len(upper), -_INFINITE)
    lower[first] = -upper[second]
    kept = (upper < _INFINITE) | (lower > -_INFINITE)
    kept[second] = False
    rows = np.flatnonzero(kept)
    equal, within = _by_columns(program.A, [np.arange(zero), zero + rows])
    solver.setup(P=program.P, c=program.q, A=equal, b=program.b[:zero], G=within, h_l=lower[rows], h_u=upper[rows])
    solver.solve()
    result = solver.result
    at_upper, at_lower = np.zeros((2, program.nonnegative))
    at_upper[rows], at_lower[rows] = result.z_u, result.z_l
    at_upper[second] = at_lower[first]
    dual = np.concatenate([result.y, at_upper])
    status = result.info.status.name
    return _PIQP_CLAIMS.get(status, Claim.FAILED), status, result.info.iter, np.array(result.x), dual


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


def _by_cvxpy(solver: str, program: ConeProgram, settings: dict[str, Any]) -> Ended:
    cvxpy: Any = import_module("cvxpy")
    known = import_module("cvxpy.reductions.solvers.defines")
    claims = {
        cvxpy.OPTIMAL: Claim.OPTIMAL,
        cvxpy.OPTIMAL_INACCURATE: Claim.INACCURATE,
        cvxpy.INFEASIBLE: Claim.INFEASIBLE,
        cvxpy.INFEASIBLE_INACCURATE: Claim.FAILED,
        cvxpy.UNBOUNDED: Claim.UNBOUNDED,
        cvxpy.USER_LIMIT: Claim.LIMIT,
    }
    interface = known.SOLVER_MAP_QP["OSQP"] if solver == "osqp" else known.SOLVER_MAP_CONIC["CLARABEL"]
    raw = interface.solve_via_data(_data(solver, program), False, False, settings)
    if solver == "osqp":
        status, iterations, z = interface.STATUS_MAP.get(raw.info.status_val), raw.info.iter, raw.y
    else:
        status, iterations, z = interface.STATUS_MAP.get(str(raw.status)), raw.iterations, raw.z
    x, z = (np.array(part, dtype=float) for part in (raw.x, z))  # copies: a view keeps the solver's memory
    return claims.get(status, Claim.FAILED), status or cvxpy.SOLVER_ERROR, iterations, x, z


def _data(solver: str, program: ConeProgram) -> dict[str, Any]:
    """The program under the names that CVXPY's interfaces read."""
    P, A, b, zero = program.P, program.A, program.b, program.zero
    if solver == "osqp":
        equal, below = _by_columns(A, [np.arange(zero), np.arange(zero, len(b))])
        return {"P": P, "q": program.q, "A": equal, "b": b[:zero], "F": below, "G": b[zero:]}
    dims = SimpleNamespace(
        zero=zero, nonneg=program.nonnegative, soc=list(program.cones), exp=0, psd=[], p3d=[], pnd=[]
    )
    return {"P": P, "c": program.q, "A": sparse.csc_array(A), "b": b, "dims": dims}
