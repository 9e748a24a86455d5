"""``trajopt pareto``: a front traced with a progress bar, kept as far as it is when interrupted, and printed."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Final

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from trajopt.errors import BadInput
from trajopt.fronts.front import Front
from trajopt.fronts.tracing import check_workers, prepare
from trajopt.workers import Processes

_ROWS: Final = 25  # a longer front is shortened


def read_error(text: str | None) -> float | None:
    """``0.5%``, ``0.5 %`` or ``0.005`` as a share. Raises BadInput."""
    if text is None:
        return None
    number, percent = text.strip().removesuffix("%"), text.strip().endswith("%")
    try:
        return float(number) / (100 if percent else 1)
    except ValueError:
        raise BadInput(f'error: must be a share such as 0.5% or 0.005, got {text[:60]!r}') from None


def ready(problem: Any, objectives: str, workers: int, asked: dict[str, Any]) -> Any:
    """What makes a `Search`; every fault of the request is found before anything is solved. Raises BadInput."""
    check_workers(workers)
    return prepare(problem, objectives, **asked)


def run(made: Any, workers: int, output: Path | None) -> Front:
    """Trace in processes of their own, so that an interrupt is heard at once; with ``output`` what is finished by then
    is written before it is passed on. Raises OSError, KeyboardInterrupt."""
    console = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[known]}"),
               TimeElapsedColumn())  # fmt: skip
    with Progress(*columns, console=console, transient=True, disable=not sys.stderr.isatty()) as bar:
        shown = bar.add_task("0 solved", total=None, known="")

        def progress(done: int, error: float | None) -> None:
            bar.update(shown, description=f"{done} solved")
            if error is not None:
                bar.update(shown, known=f"known within {100 * error:.2g} %")

        search = None
        try:
            with Processes(workers) as hands:
                search = made(hands, progress)
                front: Front = search.run()
        except KeyboardInterrupt:
            if output is not None and search is not None and search.answers:
                search.front(interrupted=True).save(output)
            raise
    if output is not None:
        front.save(output)
    return front


def print_front(front: Front) -> None:
    """Verdict, how well the front is known, and a row a point."""
    console = Console(highlight=False, soft_wrap=True, markup=False)
    console.print(front.status.value, style="bold", end="")
    console.print(f"  {front.problem.title}" if front.problem.title else "")
    console.print(f"{' against '.join(front.names)}: {len(front.points)} points from {front.solves} solves")
    console.print(f"  {front.message}")
    if not front.points:
        return
    console.print(_table(front))
    if front.error is not None:
        console.print("known within: for every move on this mesh one of these, or a blend of neighbours, is at most so")
        console.print("much worse in every objective, in shares of the ranges between the anchors")
    console.print(f"hypervolume {front.hypervolume:.6g} of the box between the anchors")


def _table(front: Front) -> Table:
    table = Table(box=None, pad_edge=False)
    for name, unit in zip(front.names, front.units, strict=True):
        table.add_column(f"{name} [{unit}]" if unit != "1" else name, justify="right")
    for name, unit in zip(front.names[1:], front.units[1:], strict=True):
        saved = f"{name} [{unit}]" if unit != "1" else name
        table.add_column(f"one more unit saves {saved}", justify="right")
    table.add_column("gap", justify="right")
    table.add_column("")
    marks = front.frame["mark"]
    step = max(1, -(-len(front.points) // _ROWS))
    for k, point in enumerate(front.points):
        if k % step and not marks[k] and k != len(front.points) - 1:
            continue
        prices = ["" if price is None else f"{price:.4g}" for price in point.prices]
        gap = point.certificate.get("gap")
        shown = "" if gap is None else f"{100 * gap:.2g} %"
        table.add_row(*(f"{x:.7g}" for x in point.values), *prices, shown, marks[k])
    return table
