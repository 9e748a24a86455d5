"""Clarabel by itself, on the programs that a solve of ours hands to its solvers, whichever they are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from unittest import mock

import clarabel
import numpy as np
from scipy import sparse

import trajopt
from trajopt.certificate import ConeProgram
from trajopt.model_cvxpy import ConvexModel

_SETTINGS = {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11, "static_regularization_constant": 1e-10}


def programs(problem: trajopt.Problem) -> list[ConeProgram]:
    """What one solve hands to its solvers."""
    kept: dict[int, ConeProgram] = {}
    run = ConvexModel.run

    def recorded(model: ConvexModel, *args: Any, **options: Any) -> Any:
        kept[id(model.program)] = model.program
        return run(model, *args, **options)

    with mock.patch.object(ConvexModel, "run", recorded):
        trajopt.solve(problem)
    return list(kept.values())


def _data(program: ConeProgram) -> tuple[Any, ...]:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    for name, value in _SETTINGS.items():
        setattr(settings, name, value)
    cones = [clarabel.ZeroConeT(program.zero), clarabel.NonnegativeConeT(program.nonnegative)]
    cones += [clarabel.SecondOrderConeT(size) for size in program.cones]
    P = sparse.csc_array(sparse.triu(program.P))
    return P, program.q, sparse.csc_array(program.A), np.asarray(program.b), cones, settings


def alone(problem: trajopt.Problem) -> Callable[[], int]:
    """What sets up and solves those programs, and returns how many they are."""
    known = [_data(program) for program in programs(problem)]

    def run() -> int:
        for data in known:
            clarabel.DefaultSolver(*data).solve()
        return len(known)

    return run
