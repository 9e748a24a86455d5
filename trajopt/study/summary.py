"""A finished study in words: how many cases ended how, and the failures by their reasons."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from rich.console import Console
from rich.table import Table

from trajopt.study.plan import Case
from trajopt.study.run import Report
from trajopt.verdict import Verdict

_REASONS: Final = 20  # that are printed; the table has them all
_CASES: Final = 20  # that are named of a reason


def to_dict(report: Report) -> dict[str, Any]:
    """Plain data for JSON."""
    failures = [
        {"status": status, "reason": reason, "cases": [case.number for case in cases]}
        for (status, reason), cases in report.failures().items()
    ]
    return {
        "status": report.status.value,
        "cases": len(report.plan.cases),
        "counts": dict(report.counts),
        "reused": report.reused,
        "stale": report.stale,
        "failures": failures,
        "written": [str(path) for path in report.written],
    }


def show(report: Report) -> None:
    """Print the counts, the failures by reason and what was written."""
    console = Console(highlight=False, soft_wrap=True, markup=False)
    console.print(report.plan.title or "Study", style="bold")
    table = Table(box=None, pad_edge=False, show_header=False)
    for status, count in report.counts.most_common():
        table.add_row(str(count), status, Verdict(status).advice)
    console.print(table)
    failures = list(report.failures().items())
    for (status, reason), cases in failures[:_REASONS]:
        console.print(f"{status} in {_named(cases)}:")
        console.print(f"  {reason}")
    if len(failures) > _REASONS:
        console.print(f"and {len(failures) - _REASONS} more reasons; the column message of the table has them all")
    if report.reused:
        console.print(f"{report.reused} cases needed no solving")
    if report.stale:
        console.print(f"{report.stale} answers in the store are of an earlier edition of the study: marked stale, kept")
    for path in report.written:
        console.print(f"wrote {path}")


def _named(cases: Sequence[Case]) -> str:
    named = [f"{case.number}" + (f" ({case.name})" if case.name else "") for case in cases[:_CASES]]
    more = f" and {len(cases) - _CASES} more" if len(cases) > _CASES else ""
    return f"{'cases' if len(cases) > 1 else 'case'} {', '.join(named)}{more}"
