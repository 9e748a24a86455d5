"""Solve the problem of a plant: find the command, have it checked and bounded. Nothing is called solved before."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np

from trajopt import checker
from trajopt.attempt import Clock
from trajopt.plant.command import Command
from trajopt.plant.minimum_time import time_optimal
from trajopt.plant.plant import Plant
from trajopt.plant.problem import PlantProblem, translated
from trajopt.plant.solution import PlantSolution
from trajopt.routing import route
from trajopt.verdict import Verdict

_REST = 1e-6  # the worst end error of a simulation by other exponentials, relative


def solve(problem: PlantProblem, seconds: float | None = None) -> PlantSolution:
    """`trajopt.solve` of a plant in this process, which nothing interrupts at ``seconds``.

    SOLVED: proven shortest by an independent check. SOLVED_LOCAL: it brings the plant to rest, and the lower bound says
    how much shorter another could be. Raises BadInput for what no command can do.
    """
    clock = Clock(seconds)
    since, stated = perf_counter(), problem.plant
    unsolved = PlantSolution(Verdict.UNDECIDED, problem, route(problem))
    try:
        with translated("plant"):
            command = time_optimal(stated.model, *stated.input, stated.final_input, stated.final_value, stated.added)
    except RuntimeError as reason:
        clock.charge("arcs", since)
        return replace(unsolved, timings=clock.timings(), message=str(reason))
    clock.charge("arcs", since)
    since = perf_counter()
    solution = _certified(unsolved, command)
    report = checker.check(solution.to_dict(), problem.canonical())
    clock.charge("check", since)
    if not report.passed or not command.end_error <= _REST:
        fault = str(report.worst) if not report.passed else f"end off by {command.end_error:.2g}"
        message = f"the command found did not pass the check ({fault}); scale the plant's numbers, or widen the limits"
        return replace(unsolved, audit=report.to_dict(), timings=clock.timings(), message=message)
    return replace(solution, audit=report.to_dict(), timings=clock.timings())


def _certified(unsolved: PlantSolution, command: Command) -> PlantSolution:
    """The solution, not yet checked, with the checker's own lower bound."""
    status = Verdict.SOLVED if command.optimal else Verdict.SOLVED_LOCAL
    least, found = command.duration, _metrics(unsolved.problem.plant.model, command)
    solution = replace(unsolved, status=status, objective=least, duration=least, metrics=found, command=command)
    bound = checker.command_bound(solution.to_dict())
    gap = None if bound is None else (least - bound) / least
    about = "no bound known: a local optimum" if bound is None else "every command within the input limits"
    return replace(solution, certificate={"lower_bound": bound, "gap": gap, "bounds": about})


def _metrics(plant: Plant, command: Command) -> dict[str, float]:
    """The number of switches; of each oscillatory mode frequency (Hz), damping ratio, residual vibration (per cent)."""
    found = {"switches": float(len(command.switches))}
    poles = sorted((p for p, _ in plant.modes if p.imag > 0), key=abs)
    for k, p in enumerate(poles, 1):
        damping = abs(p.real) / abs(p)
        found[f"mode{k}_frequency"] = abs(p) / (2 * np.pi)
        found[f"mode{k}_damping"] = damping
        found[f"mode{k}_residual"] = float(command.residual_vibration(abs(p), damping))
    return found
