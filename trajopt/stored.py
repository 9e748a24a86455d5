"""Solutions read back from their result files: checked first, then the same object that wrote them."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from trajopt import checker
from trajopt.errors import BadInput, NoSolution, TrajoptError
from trajopt.mesh import Mesh
from trajopt.problem import DERIVATIVES, Problem
from trajopt.problem_file import explain
from trajopt.routing import Route
from trajopt.scaling import sizes_of
from trajopt.schemes import SCHEMES
from trajopt.solution import Solution
from trajopt.trajectory import Trajectory
from trajopt.verdict import Verdict


def read_result(path: str | os.PathLike[str]) -> Solution:
    """The solution of a result.json that passes the independent check, whole: seal, claims, and the CSV beside it.

    Raises BadInput for what is no result of a move, NoSolution for one without a trajectory, TrajoptError for one that
    the checker rejects.
    """
    source = Path(path) / "result.json" if Path(path).is_dir() else Path(path)
    try:
        report = checker.check_file(source)
    except checker.CheckerInputError as error:
        raise BadInput(f"{error}; give the result.json of a solve") from None
    data = json.loads(source.read_text(encoding="utf-8"))
    if data.get("format") != Solution.FORMAT:
        raise BadInput(f"{source}: format is {data.get('format')!r}; only the result of a move of one axis,"
                       f" {Solution.FORMAT!r}, has a trajectory")  # fmt: skip
    if not report.passed:
        raise TrajoptError(f"{source}: rejected by the checker, nothing is taken from it: {report.summary()}")
    if data["trajectory"] is None:
        raise NoSolution(f"{source}: {data['status']} carries no trajectory; {Verdict(data['status']).advice}")
    try:
        return from_data(data)
    except ValidationError as error:
        raise BadInput(f"{source}: {explain(error)}") from None


def from_data(data: Mapping[str, Any]) -> Solution:
    """The solution that `Solution.to_dict` wrote; nothing is checked. Raises pydantic's ValidationError."""
    problem = Problem.model_validate(data["problem"])
    named = ("metrics", "certificate", "audit", "explanation", "structure", "timings")
    return Solution(
        Verdict(data["status"]),
        problem,
        Route(**data["route"]),
        data["objective"],
        data["duration"],
        **{name: data[name] or {} for name in named},
        prices=data["prices"],
        trajectory=None if data["trajectory"] is None else _trajectory(problem, data),
        message=data["message"],
    )


def _trajectory(problem: Problem, data: Mapping[str, Any]) -> Trajectory:
    stored, duration = data["trajectory"], data["duration"]
    chain = [np.array(stored[name], dtype=float) for name in DERIVATIVES[: stored["order"] + 1]]
    origin = problem.move.start_position or 0.0
    chain[0] = chain[0] - origin
    mesh = Mesh(np.array(stored["time"], dtype=float) / duration)
    sizes = sizes_of(problem, stored["order"])
    return Trajectory(problem, mesh, SCHEMES[stored["scheme"]], sizes, duration, origin, tuple(chain))
