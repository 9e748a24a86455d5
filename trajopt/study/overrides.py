"""Overrides as a study states them, in its own list or in a CSV table: where, dotted keys and values, a name."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from trajopt import problem_file, units
from trajopt.errors import BadInput

Override = tuple[str, Any]  # dotted key, value

MOST: Final = 1_000_000  # rows, and cases
LARGEST_TABLE: Final = 10_000_000  # bytes


@dataclass(frozen=True)
class Row:
    """A line of the table, or an entry of the list; ``fault`` says why it is none."""

    where: str
    overrides: tuple[Override, ...] = ()
    name: str = ""
    fault: str = ""


def listed(where: str, entry: Mapping[str, Any], name: str) -> Row:
    """The row of an entry of the list in the study file ``name``. Raises BadInput."""
    overrides = dict(flat("", entry))
    label = overrides.pop("name", "")
    if not isinstance(label, str) or not label.isprintable():
        raise problem_file.refused(name, f"{where}: name must be one line of text in quotes, got {units.shown(label)}")
    return Row(where, tuple(overrides.items()), label)


def flat(prefix: str, section: Mapping[str, Any]) -> Iterator[Override]:
    """Dotted keys and their values. A key in quotes with dots in it stands for itself: its value is not opened."""
    for key, value in section.items():
        if isinstance(value, Mapping) and "." not in key:
            yield from flat(f"{prefix}{key}.", value)
        else:
            yield prefix + key, value


def read_table(path: Path) -> list[Row]:
    """The rows of a CSV file of overrides: dotted keys in the header, ``name`` for a label; an empty cell overrides
    nothing. A malformed row has a ``fault``. Raises BadInput."""
    name = str(path)
    text = problem_file.read_text(path, LARGEST_TABLE)
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    rows: list[Row] = []
    try:
        header = [cell.strip() for cell in next(reader, [])]
        _refuse_header(header, name)
        for cells in reader:
            if cells:
                rows.append(_row(f"{name}, line {reader.line_num}", header, cells))
            if len(rows) > MOST:
                raise problem_file.refused(name, f"more than {MOST:,} rows; split it")
    except csv.Error as error:
        raise problem_file.refused(name, f"line {reader.line_num}: {error}; quote cells as in CSV") from None
    if not rows:
        raise problem_file.refused(name, "has no rows; write dotted keys in the first line and a case a line below")
    return rows


def _refuse_header(header: Sequence[str], name: str) -> None:
    for cell in header:
        if ";" in cell:
            raise problem_file.refused(name, f"line 1: {units.shown(cell)} has a semicolon; write commas between cells")
        if not cell:
            raise problem_file.refused(name, "line 1: an empty heading; write a dotted key such as move.time, or name")
        if header.count(cell) > 1:
            raise problem_file.refused(name, f"line 1: the heading {units.shown(cell)} is there twice; leave one out")


def _row(where: str, header: Sequence[str], cells: Sequence[str]) -> Row:
    if len(cells) != len(header):
        return Row(where, fault=f"{where}: has {len(cells)} cells, the header {len(header)}; write one a heading")
    given = {key: cell for key, cell in zip(header, cells, strict=True) if cell.strip()}
    label = given.pop("name", "")
    try:
        if not label.isprintable():
            raise problem_file.refused(where, f"name must be one line of printable text, got {units.shown(label)}")
        overrides = tuple((key, problem_file.read_value(cell, f"{where}, {key}")) for key, cell in given.items())
    except BadInput as error:
        return Row(where, fault=str(error))
    return Row(where, overrides, label)
