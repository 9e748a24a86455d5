"""CSV tables with units in their header, ``theta [deg],J [kg m^2],T [N m]``: columns are found by what they measure.

Nothing is guessed: a column without a unit is refused, for an angle in degrees taken for radians still looks like a
table.
"""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trajopt import units
from trajopt.fields import nearest
from trajopt.problem_file import read_text
from trajopt.units import shown

_HEADER = re.compile(r"\s*(?P<name>[^\[\]]*?)\s*\[(?P<unit>[^\[\]]+)\]\s*")
_LARGEST = 64_000_000  # bytes


@dataclass(frozen=True)
class Columns:
    """A table: by name, the unit as written and the values (n,) in it."""

    path: Path
    columns: dict[str, tuple[str, NDArray[np.float64]]]

    @classmethod
    def read(cls, path: Path, longest: int = 2_000_000) -> Columns:
        """The table in a file. Raises ValueError in one line: unreadable, no units, blank or not finite cells."""
        rows = list(csv.reader(io.StringIO(read_text(path, _LARGEST, "a CSV table"))))
        rows = [row for row in rows if any(cell.strip() for cell in row) and not row[0].startswith("#")]
        if len(rows) < 2:
            raise ValueError(f"{path}: holds no table; write a header such as theta [deg],J [kg m^2] and rows below it")
        if len(rows) > longest + 1:
            raise ValueError(f"{path}: has {len(rows) - 1} rows, at most {longest} are read; thin it out")
        header = [_heading(path, cell) for cell in rows[0]]
        names = [name for name, _ in header]
        if len(set(names)) != len(names):
            raise ValueError(f"{path}: two columns have the name {next(x for x in names if names.count(x) > 1)!r}")
        values = np.array([_row(path, k, row, names) for k, row in enumerate(rows[1:], start=2)])
        return cls(path, {name: (unit, values[:, k]) for k, (name, unit) in enumerate(header)})

    def get(self, kind: str, rotary: bool, column: str | None = None) -> NDArray[np.float64]:
        """The column that measures ``kind`` (see `trajopt.units`), or the one of that name, in SI.

        Raises ValueError where there is none, or more than one.
        """
        wanted = units.kinds(rotary)[kind]
        if column is not None:
            if column not in self.columns:
                raise ValueError(f"{self.path}: has no column {column!r}{nearest(column, list(self.columns))}")
            return self._scaled(column, kind, rotary)
        found = [name for name, (unit, _) in self.columns.items() if _measures(unit, kind, rotary)]
        if len(found) != 1:
            header = ", ".join(f"{name} [{unit}]" for name, (unit, _) in self.columns.items())
            many = f"{len(found)} columns measure {units.article(wanted.name)}: say which by column = \"{found[0]}\"" \
                if found else f"no column measures {units.article(wanted.name)}, for example in {wanted.unit}"
            raise ValueError(f"{self.path}: {many}; its header is {header}")
        return self._scaled(found[0], kind, rotary)

    def has(self, kind: str, rotary: bool) -> bool:
        """Whether any column measures ``kind``."""
        return any(_measures(unit, kind, rotary) for unit, _ in self.columns.values())

    def _scaled(self, name: str, kind: str, rotary: bool) -> NDArray[np.float64]:
        unit, values = self.columns[name]
        try:
            return values * units.to_si(f"1 {unit}", kind, rotary)
        except units.UnitError as error:
            raise ValueError(f"{self.path}: column {name}: {error}") from None


def _heading(path: Path, cell: str) -> tuple[str, str]:
    match = _HEADER.fullmatch(cell)
    if match is None:
        raise ValueError(
            f"{path}: column {shown(cell.strip())} does not say its unit; write it in brackets, such as theta [deg]"
        )
    try:
        units.parse(f"1 {match['unit']}")
    except units.UnitError as error:
        raise ValueError(f"{path}: column {shown(cell.strip())}: {error}") from None
    return match["name"], match["unit"].strip()


def _row(path: Path, line: int, row: list[str], names: list[str]) -> list[float]:
    if len(row) != len(names):
        raise ValueError(f"{path}: row {line} has {len(row)} cells where the header has {len(names)}")
    found = []
    for cell, name in zip(row, names, strict=True):
        try:
            number = float(cell)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            got = shown(cell.strip())
            raise ValueError(f"{path}: row {line}: {name} is {got}, no finite number; fill it, or drop the row")
        found.append(number)
    return found


def _measures(unit: str, kind: str, rotary: bool) -> bool:
    try:
        units.to_si(f"1 {unit}", kind, rotary)
    except units.UnitError:
        return False
    return True
