"""Tables II and III and Figures 1 to 7 of Clemen & Rupp 2023: ``python -m problems.clemen_rupp --output demo``.

Every case is solved with the paper's Euler scheme, which reproduces the printed digits, and with the exact scheme,
which shows what is left of them when nothing is integrated approximately.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from itertools import product
from pathlib import Path
from typing import Any, Final, NamedTuple

import pandas as pd
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

import trajopt
from trajopt.errors import TrajoptError
from trajopt.fronts import Front
from trajopt.solution import Solution


class Printed(NamedTuple):
    """A row: what is minimised, in words, and the digits of Table II (energy) and Table III (peak power)."""

    label: str
    energy: str
    power: str


PRINTED: Final = {
    "velocity_l1": Printed("velocity L1", "1.17", "2.37"),
    "velocity_l2": Printed("velocity L2", "1.17", "5.45"),
    "velocity_linf": Printed("velocity L∞", "1.00", "5.13"),
    "acceleration_l1": Printed("acceleration L1", "1.00", "5.13"),
    "acceleration_l2": Printed("acceleration L2", "1.85", "1.41"),
    "acceleration_linf": Printed("acceleration L∞", "3.08", "3.06"),
    "jerk_l1": Printed("jerk L1", "3.08", "3.06"),
    "jerk_l2": Printed("jerk L2", "2.80", "2.59"),
    "jerk_linf": Printed("jerk L∞", "3.08", "3.33"),
    "power_l1": Printed("power L1", "1.00", "5.13"),
    "power_l2": Printed("power L2", "1.39", "1.77"),
    "power_linf": Printed("power L∞", "1.96", "1.00"),
    "energy": Printed("energy", "1.00", "5.13"),
    "time": Printed("time", "3.08", "11.2"),
    "equal_weights": Printed("energy + power L∞", "1.50", "1.08"),  # section IV F, in the text
}
TENFOLD: Final = {
    "velocity_l1_jerk10": "L1, jerk limit × 10",
    "velocity_l2_jerk10": "L2, jerk limit × 10",
    "velocity_linf_jerk10": "L∞, jerk limit × 10",
}  # Fig. 1, dashed
SCHEMES: Final = ("euler", "exact")
Case = tuple[str, str]  # name of the problem without its prefix, scheme
CASES: Final[tuple[Case, ...]] = (*product(PRINTED, SCHEMES), *product(TENFOLD, ("euler",)))


def solve_cases(
    cases: Iterable[Case] = CASES, done: Callable[[Case], None] = lambda case: None
) -> dict[Case, Solution]:
    """Solve the named cases; ``done`` hears of each. Raises MissingSolver."""
    solutions: dict[Case, Solution] = {}
    for name, scheme in cases:
        problem = trajopt.load(f"clemen_rupp_{name}", [f'transcription.scheme="{scheme}"'])
        solutions[name, scheme] = trajopt.solve(problem)
        done((name, scheme))
    return solutions


def study(solutions: Mapping[Case, Solution]) -> pd.DataFrame:
    """One row a case of the tables, by name.

    ``<energy|power>_<scheme>`` (J, W), ``<…>_<scheme>_ratio`` to the best case of Tables II and III, ``<…>_printed``
    (text), ``<…>_agrees``: the Euler ratio, rounded as printed, is the printed one; ``determined``: the optimum is
    unique, so that it could be. A case without a solution has NaN.
    """
    table = pd.DataFrame(index=pd.Index(list(PRINTED), name="case"))
    table["minimised"] = [printed.label for printed in PRINTED.values()]
    table["determined"] = [solutions[name, "euler"].route.unique is not False for name in PRINTED]
    for quantity, metric in (("energy", "energy"), ("power", "peak_power")):
        for scheme in SCHEMES:
            column = f"{quantity}_{scheme}"
            table[column] = [solutions[name, scheme].metrics.get(metric, float("nan")) for name in PRINTED]
            table[f"{column}_ratio"] = table[column] / table[column].min()
        printed = [str(getattr(row, quantity)) for row in PRINTED.values()]
        table[f"{quantity}_printed"] = printed
        ratios = table[f"{quantity}_euler_ratio"]
        table[f"{quantity}_agrees"] = [rounded_as(p, r) == p for p, r in zip(printed, ratios, strict=True)]
    return table


def rounded_as(printed: str, value: float) -> str:
    """``value`` with as many decimals as ``printed`` has."""
    return f"{value:.{len(printed.partition('.')[2])}f}"


def disagreements(table: pd.DataFrame) -> list[str]:
    """The determined entries that differ from the printed digits, in words."""
    return [
        f"{row['minimised']}: {quantity} {row[f'{quantity}_euler_ratio']:.5g}, printed {row[f'{quantity}_printed']}"
        for _, row in table.iterrows()
        for quantity in ("energy", "power")
        if row["determined"] and not row[f"{quantity}_agrees"]
    ]


def figures(solutions: Mapping[Case, Solution], directory: Path) -> list[Path]:
    """Draw Figures 1 to 6 into ``directory``, by the Euler scheme as in the paper; returns their paths.

    A figure that lacks a solution is left out. Raises OSError.
    """
    from trajopt.plots.trajectories import compare, plot

    euler = {name: solution for (name, scheme), solution in solutions.items() if scheme == "euler"}
    paths = []
    for number, quantity in enumerate(("velocity", "acceleration", "jerk", "power"), 1):
        three = {label: euler[f"{quantity}_{norm}"] for norm, label in (("l1", "L1"), ("l2", "L2"), ("linf", "L∞"))}
        dashed = {label: euler[name] for name, label in TENFOLD.items()} if quantity == "velocity" else {}
        if all(solution.status.solved for solution in (*three.values(), *dashed.values())):
            paths.append(directory / f"fig{number}_{quantity}.png")
            panels = compare(three, dashed=dashed, title=f"Fig. {number}: least {quantity} (Euler scheme)")
            panels.figure.savefig(paths[-1], dpi=150)
    for number, name in ((5, "time"), (6, "equal_weights")):
        if euler[name].status.solved:
            paths.append(directory / f"fig{number}_{name}.png")
            plot(euler[name]).figure.savefig(paths[-1], dpi=150)
    return paths


def pareto_sweep(points: int = 51, workers: int = 1) -> Front:
    """The front of Fig. 7: evenly spaced weights (eq. 26), by the Euler scheme as in the paper."""
    problem = trajopt.load("clemen_rupp_energy", ['transcription.scheme="euler"'])
    problem = problem.replace(title="Fig. 7: total energy against peak power (Euler scheme)")
    front: Front = trajopt.pareto(problem, "energy,peak_power", points=points, workers=workers)
    return front


def print_tables(table: pd.DataFrame, console: Console) -> None:
    """Tables II and III: the printed digits beside ours, and what the marks mean."""
    for title, quantity in (
        ("Table II: energy relative to the best case", "energy"),
        ("Table III: peak power relative to the best case", "power"),
    ):
        console.print(_table(table, title, quantity))
    console.print(_words(table))


def _table(table: pd.DataFrame, title: str, quantity: str) -> Table:
    shown = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False)
    shown.add_column("minimised")
    for heading in ("printed", "Euler", "", "exact"):
        shown.add_column(heading, justify="right")
    for _, row in table.iterrows():
        printed = row[f"{quantity}_printed"]
        euler, exact = (rounded_as(printed, row[f"{quantity}_{scheme}_ratio"]) for scheme in SCHEMES)
        mark = "*" if not row["determined"] else "=" if row[f"{quantity}_agrees"] else "differs"
        shown.add_row(row["minimised"], printed, euler, mark, exact)
    return shown


def _words(table: pd.DataFrame) -> str:
    """What the marks mean, and what the two schemes tell, with the numbers of this run."""
    best = {scheme: [table[f"{quantity}_{scheme}"].min() for quantity in ("energy", "power")] for scheme in SCHEMES}
    peaks = {name: [table[f"power_{scheme}"][name] for scheme in SCHEMES] for name in ("energy", "time")}
    free = [str(label) for label in table["minimised"][~table["determined"]]]
    lines = [
        "=  the printed digits. Best case: "
        + "; ".join(f"{energy:.6f} J and {power:.6f} W ({scheme})" for scheme, (energy, power) in best.items())
    ]
    if free:
        lines += [
            f"*  {', '.join(free)}: no unique optimum; ours is the smoothest one (least jerk L2).",
            "   Velocity L1: ∫|v|dt of a one-way move is its distance, so every feasible move is optimal. The printed",
            "   1.17 and 2.37 are where one interior-point run stopped among them: an accident, not to be reproduced.",
        ]
    lines += [
        "exact: integrates without error, keeps limits between nodes, measures energy and peak power at every instant.",
        "   Euler's peaks are too high to first order in the step:"
        f" {peaks['energy'][0]:.2f} W against {peaks['energy'][1]:.2f} W for energy,",
        f"   {peaks['time'][0]:.2f} W against {peaks['time'][1]:.2f} W for time.",
    ]
    return "\n".join(lines)


def _draw_front(front: Front, directory: Path) -> list[Path]:
    """Fig. 7 as a picture and a table. Raises OSError."""
    if not front.points:
        return []
    paths = [directory / "fig7_pareto_front.png", directory / "fig7_pareto_front.csv"]
    figure: Any = front.plot().figure
    figure.savefig(paths[0], dpi=150)
    front.frame.to_csv(paths[1], index=False)
    return paths


def _with_units(column: str) -> str:
    unit = {"energy": "J", "power": "W"}.get(column.partition("_")[0], "")
    return f"{column} [{unit}]" if unit and column.endswith(SCHEMES) else column


def main(arguments: list[str] | None = None) -> int:
    """Compute, print and write; 0 when all is solved and every determined entry has the printed digits, else 3."""
    parser = argparse.ArgumentParser(prog="python -m problems.clemen_rupp", description=(__doc__ or "").split(":")[0])
    parser.add_argument("--output", type=Path, default=Path("demo"), help="folder for the figures and the CSV (demo)")
    output = parser.parse_args(arguments).output
    console = Console(highlight=False, soft_wrap=True)
    output.mkdir(parents=True, exist_ok=True)
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("solving", total=len(CASES))
        solutions = solve_cases(done=lambda case: progress.update(task, advance=1, description=" ".join(case)))
        progress.update(progress.add_task("Fig. 7", total=None))
        front = pareto_sweep(workers=os.cpu_count() or 1)
    table = study(solutions)
    print_tables(table, console)
    csv = output / "tables_2_and_3.csv"
    table.rename(columns=_with_units).to_csv(csv)
    drawn = [*figures(solutions, output), *_draw_front(front, output)]
    for path in (csv, *drawn):
        console.print(f"wrote {path}")
    unsolved = {case: solution for case, solution in solutions.items() if not solution.status.solved}
    for case, solution in unsolved.items():
        console.print(f"not solved: {' '.join(case)}: {solution.status.value}, {solution.message}")
    for fault in disagreements(table):
        console.print(f"not as published: {fault}")
    if not front.status.solved:
        console.print(f"not solved: Fig. 7: {front.message}")
    return 3 if unsolved or disagreements(table) or not front.status.solved else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (TrajoptError, OSError) as error:
        print(f"clemen_rupp: {error}", file=sys.stderr)
        sys.exit(error.exit_code if isinstance(error, TrajoptError) else 4)
