"""Shared builders: the moves that the tests vary, in SI units."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import trajopt

PUBLISHED_CURVES = Path(__file__).parents[2] / "shared" / "reference" / "clemen_rupp_2023"  # may be absent


def term(minimize: str, norm: Any = None, weight: float = 1.0) -> trajopt.Term:
    """One objective term."""
    return trajopt.Term(minimize=minimize, norm=norm, weight=weight)


def axis(
    minimize: str | list[trajopt.Term] = "jerk",
    norm: Any = None,
    *,
    time: Any = 1.0,
    distance: Any = 1.0,
    start: dict[str, Any] | None = None,
    end: dict[str, Any] | None = None,
    via: tuple[trajopt.Via, ...] = (),
    dwell: float = 0.0,
    limits: dict[str, Any] | None = None,
    load: dict[str, Any] | None = None,
    intervals: int = 50,
    scheme: str = "exact",
    solver: str = "auto",
) -> trajopt.Problem:
    """A move of one axis from 0 to ``distance``, at rest at both ends unless ``start`` or ``end`` say otherwise."""
    terms = minimize if isinstance(minimize, list) else [term(minimize, norm)]
    return trajopt.Problem(
        move=trajopt.Move(
            time=time,
            start=trajopt.State(**{"position": 0.0, **(start or {})}),
            end=trajopt.State(**{"position": distance, **(end or {})}),
            via=via,
            dwell=dwell,
        ),
        limits=trajopt.Limits(**(limits or {})),
        load=trajopt.Load(**(load or {})),
        objective=trajopt.Objective(terms=tuple(terms)),
        transcription=trajopt.Transcription(intervals=intervals, scheme=scheme, solver=solver),
    )


TABLE_I: dict[str, Any] = {  # Clemen & Rupp 2023, Table I; D from their companion repository
    "distance": 0.254,
    "limits": {"velocity": (0.0, 0.5), "acceleration": 4.905, "jerk": 98.1, "power": 100.0},
    "load": {"inertia": 10.0},
}


def table_i(minimize: str | list[trajopt.Term], norm: Any = None, **changes: Any) -> trajopt.Problem:
    """The move of Clemen & Rupp 2023, Table I: N = 200, exact scheme."""
    return axis(minimize, norm, **{**TABLE_I, "intervals": 200, **changes})


def solved(problem: trajopt.Problem) -> trajopt.Solution:
    """The solution of a problem that must have one, checked and (when SOLVED) certified within 1e-6."""
    solution = trajopt.solve(problem)
    assert solution.status.solved, f"{solution.status.value}: {solution.message}"
    if solution.status is trajopt.Verdict.SOLVED:
        assert solution.certificate["gap"] <= 1e-6
    return solution
