"""A motion in words and a short table, for people at a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from trajopt import units
from trajopt.problem import DERIVATIVES

if TYPE_CHECKING:
    from trajopt.axes.problem import AxesProblem
    from trajopt.axes.solution import AxesSolution

_ROWS = (*DERIVATIVES[1:], "force", "power")


def print_motion(solution: AxesSolution) -> None:
    """Verdict, objective, duration, the peaks of every axis with units, certificate, and who solved it and why."""
    console = Console(highlight=False, soft_wrap=True, markup=False)
    title = solution.problem.title
    console.print(solution.status.value, style="bold", end="")
    console.print(f"  {title}" if title else "")
    if solution.motion is None:
        for line in solution.explanation.get("text") or [solution.message or solution.status.advice]:
            console.print(f"  {line}")
        console.print(f"next: {solution.status.advice}")
        return
    console.print(f"minimised {objective_text(solution)}, in {solution.duration:.9g} s")
    console.print(_table(solution))
    for line in [*_tip_text(solution), certificate_text(solution)]:
        console.print(line)
    chosen, audit = solution.route, solution.audit
    console.print(f"solved by {chosen.solver} through {chosen.model}: {chosen.reason}")
    unchecked = f"; not checked: {', '.join(audit['not_checked'])}" if audit.get("not_checked") else ""
    console.print(f"checked independently: {audit['checks']} checks passed, tolerance {audit['tolerance']}{unchecked}")
    console.print(", ".join(f"{name} {1000 * t:.0f} ms" for name, t in solution.timings.items()))


def objective_text(solution: AxesSolution) -> str:
    """``0.5 power linf of shoulder + 0.5 power linf of elbow = 212.84``."""
    return f"{objective_name(solution.problem)} = {solution.objective:.9g}"


def objective_name(problem: AxesProblem) -> str:
    """What is minimised, without its value."""
    parts: list[str] = []
    for term in problem.objective.terms:
        if term.minimize == "time":
            parts.append("time" if term.weight == 1 else f"{term.weight:g} time")
            continue
        label = term.label.replace("force", "torque") if problem.arm is not None else term.label
        own = [
            f"{'' if share == 1 else f'{share:g} '}{label} of {axis.name}"
            for share, axis in zip(term.shares(len(problem.axes)), problem.axes, strict=True)
            if share
        ]
        parts.append(f"the largest of {', '.join(own)}" if term.combine == "max" else " + ".join(own))
    return " + ".join(parts)


def _table(solution: AxesSolution) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("peak (limit)")
    for axis in solution.problem.axes:
        table.add_column(axis.name, justify="right")
    mixed = len({axis.rotary for axis in solution.problem.axes}) > 1
    table.add_column("" if mixed else "unit")
    for name in _ROWS:
        cells, kinds = [], [units.kinds(axis.rotary)[name] for axis in solution.problem.axes]
        for axis, kind in zip(solution.problem.axes, kinds, strict=True):
            found, limit = solution.metrics.get(f"{axis.name}.peak_{name}"), axis.limits.given.get(name)
            most = "" if limit is None else f" ({max(abs(limit.lowest), abs(limit.highest)):g})"
            cells.append("" if found is None else f"{found:.6g}{most}{f' {kind.unit}' if mixed else ''}")
        if any(cells):
            table.add_row(kinds[0].name, *cells, "" if mixed else kinds[0].unit)
    energies = [solution.metrics.get(f"{axis.name}.energy") for axis in solution.problem.axes]
    if any(x is not None for x in energies):
        table.add_row("energy ∫|P|dt", *("" if x is None else f"{x:.6g}" for x in energies), "J")
    return table


def _tip_text(solution: AxesSolution) -> list[str]:
    motion, tip = solution.motion, solution.problem.tip
    if motion is None or tip is None or tip.velocity is None or motion.release is None:
        return []
    found = motion.tip(motion.release)
    lines = [f"released at {motion.release:.6g} s with the tip at ({found['x']:.6g}, {found['y']:.6g}) m,"
             f" ({found['vx']:.6g}, {found['vy']:.6g}) m/s"]  # fmt: skip
    if (forward := solution.certificate.get("forward_only_bound")) is not None:
        asked = (tip.velocity[0] ** 2 + tip.velocity[1] ** 2) ** 0.5
        verdict = "the wind-up is required" if asked > forward else "a wind-up is not required"
        lines.append(f"without a wind-up the tip reaches at most {forward:.6g} m/s: {verdict}")
    return lines


def certificate_text(solution: AxesSolution) -> str:
    """What is known about better motions."""
    found = solution.certificate
    if "feasible" in found:
        others = [f"{x:.6g}" for x in found["optima"][1:5]]
        more = f", also seen: {', '.join(others)}" if others else ""
        return (
            f"{found['feasible']} of {found['starts']} starts were feasible, {found['agreed']} agree on the best of"
            f" {found['distinct']} distinct optima, spread {100 * found['spread']:.3g} %{more} (coarse mesh)"
        )
    if found.get("lower_bound") is None:
        return str(found.get("bounds"))
    return f"lower bound {found['lower_bound']:.9g} for {found['bounds']}: at most {100 * found['gap']:.2g} % to gain"
