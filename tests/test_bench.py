"""Benchmarks run, and both sides of each give the same optimum; their times are nobody's business here."""

from __future__ import annotations

import pytest

from bench import run, study
from bench.run import SMOKE, Row


@pytest.mark.parametrize("group", run.GROUPS)
def test_both_sides_agree(group: str) -> None:
    rows = list(run.GROUPS[group](SMOKE))
    assert rows and all(row.group == group.replace("-", " ") or row.group == group for row in rows)
    assert not [row for row in rows if "void" in row.note]
    assert all(row.ours_ms is None or row.ours_ms > 0 for row in rows)
    assert all(row.ratio is None or row.ratio > 0 for row in rows)


def test_a_comparison_of_different_optima_is_void() -> None:
    def failing() -> float:
        raise RuntimeError("Ipopt\nfailed")

    row = Row("convex", "a", 20, "peer")
    assert run.compared(row, lambda: 1.0, lambda: 1.0 + 2e-5, 1).note.startswith("void: 1.0 against")
    assert run.compared(row, lambda: 1.0, failing, 1) == Row("convex", "a", 20, "peer", note="void: failed")
    fair = run.compared(row, lambda: 1.0, lambda: 1.0 + 5e-6, 1)
    assert fair.note == "" and fair.runs == 1 and fair.ratio is not None and fair.low == fair.ratio


def test_the_table_has_a_row_a_case() -> None:
    rows = [Row("power", "a", 200, "b", 2.0, 4.0, 0.5, 0.4, 0.6, 9), Row("growth", "c", 0, "-", note="1.02")]
    assert run.table(rows).splitlines()[2:] == [
        "| power: a | 200 | 2 | b | 4 | 0.5 (0.4 to 0.6) |  |",
        "| growth: c |  |  | - |  |  | 1.02 |",
    ]


def test_a_study_solves_what_the_bare_loop_does() -> None:
    row = study.measured(4)
    assert row["cases"] == 4 and min(row["bare"], row["workers_1"], row["workers_2"]) > 0
