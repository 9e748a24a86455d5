"""Servo trajectories by direct transcription: optimal, checked and certified.

    solution = trajopt.solve(trajopt.load("move.toml"))

Importing trajopt loads no solver, model or plotting library; each comes when it is used.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOMES = {
    "load": "trajopt.problem_file",
    "from_dict": "trajopt.problem_file",
    "solve": "trajopt.worker",
    "route": "trajopt.routing",
    "synchronise": "trajopt.axes.synchronise",
    **dict.fromkeys(("pareto", "Front"), "trajopt.fronts"),
    "check": "trajopt.checker",
    "check_file": "trajopt.checker",
    "Solution": "trajopt.solution",
    "read_result": "trajopt.stored",
    "compare": "trajopt.plots.trajectories",
    "Verdict": "trajopt.verdict",
    **dict.fromkeys(
        (
            "Problem", "Move", "State", "Via", "Limits", "Load", "Vibration", "Objective", "Term", "Ceiling",
            "Transcription",
        ),
        "trajopt.problem",
    ),  # fmt: skip
    **dict.fromkeys(("PlantProblem", "PlantSection", "Robust"), "trajopt.plant.problem"),
    "PlantSolution": "trajopt.plant.solution",
    **dict.fromkeys(
        ("AxesProblem", "Axis", "AxisMove", "Together", "AxesTerm", "AxesObjective", "Search"), "trajopt.axes.problem"
    ),
    **dict.fromkeys(("ArmSection", "Tip", "Line", "ParametricCurve"), "trajopt.axes.arm"),
    "AxesSolution": "trajopt.axes.solution",
    **dict.fromkeys(("TrajoptError", "BadInput", "NoSolution", "MissingSolver", "InternalError"), "trajopt.errors"),
    **dict.fromkeys(("Limit", "Table"), "trajopt.fields"),
    "Curve": "trajopt.curve",
    "Envelope": "trajopt.envelope",
    **dict.fromkeys(("sin", "cos"), "trajopt.elementwise"),
    **dict.fromkeys(("Norm", "L1", "L2", "Linf"), "norms"),
}

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'trajopt' has no attribute {name!r}")
    found = globals()[name] = getattr(import_module(_HOMES[name]), name)  # is not asked for again
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
