"""A solution in words and a short table, for people at a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from trajopt import units
from trajopt.fields import Limit
from trajopt.prices import sentence
from trajopt.problem import Problem

if TYPE_CHECKING:
    from trajopt.answer import Answer
    from trajopt.axes.solution import AxesSolution
    from trajopt.plant.solution import PlantSolution
    from trajopt.solution import Solution

_ROWS = ("velocity", "acceleration", "jerk", "snap", "force", "power", "current", "voltage")
_ENERGIES = {
    "energy": "energy ∫|P|dt",
    "copper_loss": "copper loss",
    "electrical_energy": "electrical energy",
    "brake_energy": "fed back",
}


def print_solution(solution: Solution | PlantSolution | AxesSolution) -> None:
    """Verdict, objective, duration, peaks and RMS with units, certificate, and who solved it and why."""
    if not isinstance(solution.problem, Problem):
        return _print_another_kind(solution)
    assert not hasattr(solution, "motion") and not hasattr(solution, "command")
    console = Console(highlight=False, soft_wrap=True, markup=False)
    title = solution.problem.title
    console.print(solution.status.value, style="bold", end="")
    console.print(f"  {title}" if title else "")
    if not solution.status.solved:
        for line in solution.explanation.get("text") or [solution.message or solution.status.advice]:
            console.print(f"  {line}")
        console.print(f"next: {solution.status.advice}")
        return
    assert solution.objective is not None and solution.duration is not None
    console.print(f"minimised {objective_text(solution)}, in {solution.duration:.9g} s")
    for ceiling in solution.problem.objective.ceilings or ():
        console.print(f"with {solution.problem.shown(ceiling.term.label)} at most {ceiling.at_most:.9g} (SI)")
    console.print(_table(solution))
    console.print(certificate_text(solution))
    if (optimum := solution.certificate.get("continuous_optimum")) is not None:
        above = 100 * solution.certificate["above_continuous"]
        console.print(f"in continuous time the optimum is {optimum:.9g}; this move is {above:.2g} % above it")
    for row in [row for row in solution.prices if row["per_unit"]][:3]:
        console.print(f"  {sentence(row, solution.problem.shown(row['name']), objective_label(solution))}")
    for line in _structure_text(solution.structure):
        console.print(f"  {line}")
    for row in solution.comparison():
        console.print(f"  {_comparison_text(row)}")
    chosen = solution.route
    console.print(f"solved by {chosen.solver} through {chosen.model}: {chosen.reason}")
    if (excess := _between_nodes(solution)) is not None:
        console.print(excess)
    if chosen.tie_break:
        console.print(f"tie broken: {chosen.tie_break}")
    audit = solution.audit
    console.print(f"checked independently: {audit.get('checks', 0)} checks passed, tolerance {audit.get('tolerance')}")
    console.print(", ".join(f"{name} {1000 * t:.0f} ms" for name, t in solution.timings.items()))


def _print_another_kind(solution: Any) -> None:
    if hasattr(solution, "command"):
        from trajopt.plant.report import print_command

        return print_command(solution)
    from trajopt.axes.report import print_motion

    print_motion(solution)


def _structure_text(structure: Mapping[str, Any]) -> list[str]:
    """The arcs of a minimum time, and what the ordinary S-curve would lose."""
    if "arcs" not in structure:
        return []
    arcs = [f"{arc.get('limit') or arc['name']} {arc['to'] - arc['from']:.4g} s" for arc in structure["arcs"]]
    shown = arcs if len(arcs) <= 9 else [*arcs[:4], f"… {len(arcs) - 8} more …", *arcs[-4:]]
    of = f" of {structure['of']}" if "of" in structure else ""
    lines = [f"arcs{of}: " + ", ".join(shown)]
    if structure.get("chatters"):
        lines.append("the optimum switches without end towards the velocity limit; cut off where nothing is lost")
    if "s_curve" in structure:
        curve = structure["s_curve"]
        lines.append(f"the ordinary S-curve takes {curve['duration']:.9g} s, {100 * curve['loss']:.3g} % more")
    return lines


def _comparison_text(row: Mapping[str, Any]) -> str:
    """``saves 26 % against the best trapezoid, which breaks the jerk limit``."""
    if row["saving"] is None:
        return f"no {row['profile'].removeprefix('best ')} keeps the limits"
    breaks = f", which breaks the {' and '.join(row['breaks'])} limit" if row["breaks"] else ""
    saving = f"{abs(100 * row['saving']):.3g} %"
    outcome = f"saves {saving} against" if row["saving"] >= 0 else f"costs {saving} more than"
    return f"{outcome} the {row['profile']}{breaks}"


def objective_text(solution: Solution) -> str:
    """``power linf = 1.68200675``: what was minimised and its value, with its unit where it is a single signal."""
    terms = solution.problem.objective.terms
    text = objective_name(solution.problem)
    kind = units.kinds(solution.problem.rotary)[terms[0].minimize]
    pure = len(terms) == 1 and (terms[0].norm is None or terms[0].norm.name in ("l2", "linf"))
    return f"{text} = {solution.objective:.9g}" + (f" {kind.unit}" if pure else "")


def objective_name(problem: Problem) -> str:
    """``power linf``, ``0.5 × energy + 0.5 × power linf``: what is minimised."""
    terms = problem.objective.terms
    return " + ".join((f"{t.weight:g} × " if len(terms) > 1 else "") + problem.shown(t.label) for t in terms)


def _between_nodes(solution: Solution) -> str | None:
    """Where a peak was minimised at samples and is exceeded between them, by how much."""
    terms = solution.problem.objective.terms
    peak = solution.metrics.get(f"peak_{terms[0].minimize}")
    if len(terms) > 1 or terms[0].norm is None or terms[0].norm.name != "linf" or peak is None:
        return None
    assert solution.objective is not None
    excess = peak / (terms[0].weight * solution.objective) - 1 if solution.objective else 0.0
    return (
        f"the peak was minimised at the nodes; between them it is {100 * excess:.2g} % higher"
        if excess > 1e-6
        else None
    )


def objective_label(solution: Solution) -> str:
    """``power linf``, or ``objective`` for a weighted sum."""
    terms = solution.problem.objective.terms
    return solution.problem.shown(terms[0].label) if len(terms) == 1 else "objective"


def certificate_text(solution: Solution) -> str:
    """What is known about better moves."""
    certificate = solution.certificate
    starts = f" ({certificate['agreed']} of {certificate['starts']} starts agree)" if "starts" in certificate else ""
    if certificate["lower_bound"] is None:
        return f"{certificate['bounds']}{starts}"
    bound, gap = certificate["lower_bound"], 100 * certificate["gap"]
    return f"lower bound {bound:.9g} for {certificate['bounds']}: at most {gap:.2g} % could be gained{starts}"


def print_timings(solution: Answer) -> None:
    """Where the time of a solve went, the most first, and the rest that no account holds."""
    spent = dict(solution.timings)
    total = spent.pop("total", sum(spent.values()))
    spent["else"] = max(total - sum(spent.values()), 0.0)
    rows = [*sorted(spent.items(), key=lambda row: -row[1]), ("total", total)]
    for name, seconds in rows:
        print(f"{name:16} {1e3 * seconds:10.1f} ms {100 * seconds / max(total, 1e-12):6.1f} %")


def _table(solution: Solution) -> Table:
    kinds = units.kinds(solution.problem.rotary)
    table = Table(box=None, pad_edge=False)
    table.add_column("")
    for heading in ("peak", "rms", "limit"):
        table.add_column(heading, justify="right")
    table.add_column("unit")
    given = solution.problem.limits.given
    for name in _ROWS:
        if f"peak_{name}" not in solution.metrics:
            continue
        limit = given.get(name)
        shown = "" if limit is None else "by time" if limit.varies else _limit_text(limit.lowest, limit.highest)
        found = [solution.metrics.get(f"{kind}_{name}") for kind in ("peak", "rms")]
        values = ["" if x is None else f"{x:.6g}" for x in found]
        table.add_row(kinds[name].name, *values, shown, kinds[name].unit)
    if (limit := given.get("rms_force")) is not None:
        _add_cycle(table, solution, limit)
    for name, label in _ENERGIES.items():
        if name in solution.metrics:
            limit = given.get(name)
            most = "" if limit is None else f"{limit.highest:g}"
            table.add_row(label, f"{solution.metrics[name]:.6g}", "", most, "J")
    return table


def _add_cycle(table: Table, solution: Solution, limit: Limit) -> None:
    """The RMS of force over the move and the rest after it, in which a load over position is held."""
    assert solution.duration is not None
    kind = units.kinds(solution.problem.rotary)["rms_force"]
    dwell, load = solution.problem.move.dwell, solution.problem.load
    held = 0.0 if load.force is None else float(load.force.at(solution.at(solution.duration)["position"]))
    square = solution.metrics["rms_force"] ** 2 * solution.duration + held**2 * dwell
    rms = sqrt(square / (solution.duration + dwell))
    table.add_row(f"{kind.name} of the cycle", "", f"{rms:.6g}", f"{limit.highest:g}", kind.unit)


def _limit_text(lowest: float, highest: float) -> str:
    return f"±{highest:g}" if lowest == -highest else f"{lowest:g} … {highest:g}"
