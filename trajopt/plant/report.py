"""A command in words, for people at a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Console

from trajopt.verdict import Verdict

if TYPE_CHECKING:
    from trajopt.plant.solution import PlantSolution

_MOST_ARCS = 12


def print_command(solution: PlantSolution) -> None:
    """Verdict, least time, switch times, residual vibration, certificate, and who solved it and why."""
    console = Console(highlight=False, soft_wrap=True, markup=False)
    title, command = solution.problem.title, solution.command
    console.print(solution.status.value, style="bold", end="")
    console.print(f"  {title}" if title else "")
    if command is None:
        console.print(f"  {solution.message or solution.status.advice}")
        if solution.status is not Verdict.UNDECIDED:
            console.print(f"next: {solution.status.advice}")
        return
    console.print(f"minimised time = {solution.objective:.12g} s, to rest at {command.y_f:g}")
    arcs = [
        f"{level:+g} to {end:.12g} s"
        for level, end in zip(command.levels, (*command.switches, command.duration), strict=True)
    ]
    shown = arcs if len(arcs) <= _MOST_ARCS else [*arcs[:5], f"… {len(arcs) - 10} more …", *arcs[-5:]]
    console.print(f"input: {', '.join(shown)}, then {command.u_ss:g}")
    found = solution.metrics
    for k in range(1, len(found)):
        if f"mode{k}_residual" in found:
            console.print(
                f"  mode of {found[f'mode{k}_frequency']:.6g} Hz, damping {found[f'mode{k}_damping']:.4g}: "
                f"residual vibration {found[f'mode{k}_residual']:.2g} %"
            )
    certificate = solution.certificate
    if certificate["lower_bound"] is None:
        console.print(certificate["bounds"])
    else:
        bound, gap = certificate["lower_bound"], 100 * certificate["gap"]
        console.print(f"lower bound {bound:.12g} s for {certificate['bounds']}: at most {gap:.2g} % could be gained")
    console.print(f"solved by {solution.route.solver} through {solution.route.model}: {solution.route.reason}")
    audit = solution.audit
    unchecked = f"; not checked: {', '.join(audit['not_checked'])}" if audit.get("not_checked") else ""
    console.print(
        f"checked independently: {audit.get('checks', 0)} checks passed; "
        f"end at rest and final value to {audit.get('tolerance')}{unchecked}"
    )
    console.print(", ".join(f"{name} {1000 * t:.0f} ms" for name, t in solution.timings.items()))
