"""Benchmarks run, and both sides of each give the same optimum; their times are nobody's business here."""

from __future__ import annotations

import pytest

from bench import least_time, study


@pytest.mark.parametrize("name", least_time.CASES)
def test_both_sides_agree(name: str) -> None:
    row = least_time.measured(name, runs=1)
    assert row["case"] == name and row["ours_ms"] > 0
    assert ("ratio" in row) == name.startswith("third")


def test_the_table_has_a_row_a_case() -> None:
    rows = [{"case": "a", "ours_ms": 2.0, "peer_ms": 0.01, "ratio": 200.0}, {"case": "b", "ours_ms": 3.0}]
    assert least_time.table(rows).splitlines()[2:] == ["| a | 2.0 | 0.0100 | 200 |", "| b | 3.0 | - | - |"]


def test_a_study_solves_what_the_bare_loop_does() -> None:
    row = study.measured(4)
    assert row["cases"] == 4 and min(row["bare"], row["workers_1"], row["workers_2"]) > 0
    assert len(study.table(row).splitlines()) == 3
