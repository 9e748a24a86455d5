"""The verification of an exported file as a short table."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from trajopt.export.verify import Report, Row


def print_report(report: Report) -> None:
    """What was written, what the drive sees against the limits, and the errors."""
    console = Console(highlight=False, soft_wrap=True, markup=False)
    console.print(report.verdict.upper(), style="bold", end="")
    between = f"{report.interpolation} between them"
    console.print(f"  {report.format}: {report.points} points in {report.duration:.9g} s, {between}")
    table = Table(box=None, pad_edge=False)
    table.add_column("on the machine")
    for heading in ("peak", "limit", "excess"):
        table.add_column(heading, justify="right")
    table.add_column("unit")
    table.add_column("")
    for row in report.rows:
        mark = "" if row.verdict == "passed" else row.verdict
        table.add_row(row.name, f"{row.peak:.6g}", *_against(row), row.unit, mark)
    console.print(table)
    console.print(f"end error {report.end_error:.3g}, largest distance to the optimum {report.tracking_error:.3g} (SI)")
    if report.not_judged:
        console.print(f"not judged: {', '.join(report.not_judged)}")
    console.print(f"{'wrote' if report.written else 'not written:'} {report.path}")


def _against(row: Row) -> tuple[str, str]:
    if row.limit is None or row.excess is None:
        return "", ""
    return f"{row.limit:.6g}", f"{100 * row.excess:.2g} %" if row.excess > 1e-9 else ""
