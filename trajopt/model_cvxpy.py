"""Convex models: CVXPY with Clarabel or OSQP. The only file that imports cvxpy."""

from __future__ import annotations

import warnings
from time import perf_counter
from typing import Any, Final

import cvxpy
import numpy as np
from scipy import sparse

from trajopt import certificate
from trajopt.errors import MissingSolver
from trajopt.model import Claim, Floats, Outcome, Prices, own_size

cp: Any = cvxpy  # its atoms are exported in a way that type checkers do not see
_CLARABEL: Final = {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11, "max_iter": 200}
_SETTINGS: Final[dict[str, dict[str, Any]]] = {
    # Measured: little regularisation is accurate, and fails from N = 20000 on; more solves those.
    "clarabel": _CLARABEL | {"static_regularization_constant": 1e-10},
    "clarabel-firm": _CLARABEL | {"static_regularization_constant": 1e-8},
    "clarabel-soft": _CLARABEL | {"static_regularization_constant": 1e-7},
    "clarabel-faer": _CLARABEL | {"static_regularization_constant": 1e-10, "direct_solve_method": "faer"},
    "osqp-last": {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 10_000, "polishing": True},
    "osqp": {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 200_000, "polishing": True},
}
RESCUES: Final = ("clarabel-faer", "osqp-last")  # another factorisation; slow, and not for cones: where none came near
LADDER: Final = ("clarabel", "clarabel-firm", "clarabel-soft", *RESCUES)


class ConvexModel:
    """A convex program under construction; see `trajopt.model.Model` for the meaning of the methods."""

    convex = True

    def __init__(self) -> None:
        self._rows: list[Any] = []
        self._names: dict[str, list[Any]] = {}
        self._objective: Any = 0.0

    def vector(self, count: int, size: float, lower: Floats, upper: Floats, name: str = "", at: Any = None) -> Any:
        x = cp.Variable(count)
        for bound, sign, side in ((lower, -1.0, "min"), (upper, 1.0, "max")):
            active = np.flatnonzero(np.isfinite(bound))
            if len(active):
                some = x if len(active) == count else x[active]
                limit = bound[active]
                key, where = (f"{name}.{side}", at[active]) if at is not None else ("", None)
                row_size = max(size, float(np.max(np.abs(limit))))
                self.nonpositive(size * sign * some - sign * limit, row_size, key, where, own_size(limit, size))
        return size * x

    def variable(self, count: int) -> Any:
        return cp.Variable(count)

    def zero(self, residual: Any, size: float = 1.0) -> None:
        self._rows.append(residual / size == 0)

    def nonpositive(self, residual: Any, size: float = 1.0, name: str = "", at: Any = None, own: Any = None) -> Any:
        row = residual / size <= 0
        self._rows.append(row)
        if name:
            self._names.setdefault(name, []).append((row, size, at, own))
        return row

    def times(self, factor: Any, x: Any) -> Any:
        if isinstance(x, float | np.ndarray):
            return factor * x
        return factor * x if np.ndim(factor) == 0 else cp.multiply(factor, x)

    def concatenate(self, parts: list[Any]) -> Any:
        return cp.hstack(parts)

    def total(self, weights: Floats, x: Any) -> Any:
        return weights @ x

    def squares(self, x: Any) -> Any:
        return cp.square(x)

    def magnitude(self, x: Any) -> Any:
        return cp.abs(x)

    def at_least_length(self, bound: Any, x: Any, weights: Floats) -> None:
        self._rows.append(cp.SOC(bound, cp.multiply(weights, x)))

    def minimize(self, value: Any) -> None:
        self._objective = value

    def value(self, x: Any) -> Floats:
        return np.asarray(x.value if hasattr(x, "value") else x, dtype=float)

    def run(self, solver: str, seconds: float | None = None) -> Outcome:
        """Solve by a rung of LADDER or ``osqp``. The claim is the solver's, but an infeasible one has been
        verified; the bound is recomputed from the duals."""
        started = perf_counter()
        name = solver.partition("-")[0]
        problem = cp.Problem(cp.Minimize(self._objective), self._rows)
        options = dict(_SETTINGS[solver])
        if seconds is not None:
            options["time_limit"] = seconds
        try:
            data, chain, inverse = problem.get_problem_data(name.upper(), solver_opts=options)
        except cp.SolverError as error:
            if name.upper() not in cp.installed_solvers():
                raise MissingSolver(
                    f"{name} is not installed; 'pip install {name}' or 'make demo' brings it"
                ) from error
            return Outcome(Claim.FAILED, f"{name} does not take cone programs")
        raw = chain.solve_via_data(problem, data, solver_opts=options)
        try:
            with warnings.catch_warnings():  # "may be inaccurate": the check decides that
                warnings.simplefilter("ignore")
                problem.unpack_results(raw, chain, inverse)
        except cp.SolverError:
            return Outcome(Claim.FAILED, str(raw.status), seconds=perf_counter() - started)
        claim = _CLAIMS.get(problem.status, Claim.FAILED)
        program, z = _program(data), np.asarray(raw.z if name == "clarabel" else raw.y, dtype=float)
        value, bound = np.nan, -np.inf
        if claim is Claim.INFEASIBLE and not certificate.is_infeasible(program, z):
            claim = Claim.FAILED
        if claim in (Claim.OPTIMAL, Claim.INACCURATE):
            x = np.asarray(raw.x)
            value = float(problem.value)
            bound = value - (program.value(x) - certificate.lower_bound(program, x, z))
        stats = problem.solver_stats
        seconds = perf_counter() - started
        pair = (np.asarray(raw.x), z)
        return Outcome(claim, problem.status, value, stats.num_iters or 0, seconds, bound, self._prices(), pair)

    def lagrangian(self, pair: tuple[Floats, Floats]) -> float:
        problem = cp.Problem(cp.Minimize(self._objective), self._rows)
        program = _program(problem.get_problem_data(cp.CLARABEL)[0])
        x, z = pair
        return program.value(x) + float(z @ (program.A @ x - program.b))

    def _prices(self) -> dict[str, Prices]:
        """The prices of named rows; empty where the solver gave no duals."""
        with np.errstate(over="ignore"):  # of a limit absurdly small against the move
            return self._read_prices()

    def _read_prices(self) -> dict[str, Prices]:
        return {
            name: Prices(
                np.concatenate([at for _, _, at, _ in rows]),
                np.concatenate([np.atleast_1d(row.dual_value) / size for row, size, _, _ in rows]),
                np.concatenate([own for _, _, _, own in rows]),
            )
            for name, rows in self._names.items()
            if all(row.dual_value is not None for row, _, _, _ in rows)
        }


_CLAIMS: Final = {
    cp.OPTIMAL: Claim.OPTIMAL,
    cp.OPTIMAL_INACCURATE: Claim.INACCURATE,
    cp.INFEASIBLE: Claim.INFEASIBLE,
    cp.INFEASIBLE_INACCURATE: Claim.FAILED,
    cp.UNBOUNDED: Claim.UNBOUNDED,
    cp.USER_LIMIT: Claim.LIMIT,
}


def _program(data: dict[str, Any]) -> certificate.ConeProgram:
    """What the solver was given, in one form for both."""
    dims = data["dims"]
    P = data.get("P")
    if "F" in data:  # OSQP: equalities, then inequalities F x <= G
        A, b, q = sparse.vstack([data["A"], data["F"]]), np.concatenate([data["b"], data["G"]]), data["q"]
    else:
        A, b, q = data["A"], data["b"], data["c"]
    P = sparse.csc_array((len(q), len(q))) if P is None else sparse.csc_array(P)
    return certificate.ConeProgram(P, q, sparse.csc_array(A), b, dims.zero, dims.nonneg, tuple(dims.soc))
