"""Clarabel by itself, on the cone programs that a solve of ours hands to it, with the same settings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import clarabel
import numpy as np
from scipy import sparse

import trajopt
from trajopt import model_cvxpy


def programs(problem: trajopt.Problem) -> list[tuple[Any, ...]]:
    """What one solve hands to Clarabel: (P, q, A, b, cones, settings) each."""
    kept: list[tuple[Any, ...]] = []
    interface = model_cvxpy.SOLVERS["CLARABEL"]

    class Recorder(type(interface)):  # type: ignore[misc]
        def solve_via_data(self, data: Any, warm: bool, verbose: bool, options: Any, *rest: Any) -> Any:
            dims = data["dims"]
            cones = [clarabel.ZeroConeT(dims.zero), clarabel.NonnegativeConeT(dims.nonneg)]
            cones += [clarabel.SecondOrderConeT(size) for size in dims.soc]
            settings = self.parse_solver_opts(False, options)
            P, A = sparse.csc_array(sparse.triu(data["P"])), sparse.csc_array(data["A"])
            kept.append((P, np.asarray(data["c"]), A, np.asarray(data["b"]), cones, settings))
            return super().solve_via_data(data, warm, verbose, options, *rest)

    model_cvxpy.SOLVERS["CLARABEL"] = Recorder()
    try:
        trajopt.solve(problem)
    finally:
        model_cvxpy.SOLVERS["CLARABEL"] = interface
    return kept


def alone(problem: trajopt.Problem) -> Callable[[], int]:
    """What sets up and solves those programs, and returns how many they are."""
    known = programs(problem)

    def run() -> int:
        for P, q, A, b, cones, settings in known:
            clarabel.DefaultSolver(P, q, A, b, cones, settings).solve()
        return len(known)

    return run
