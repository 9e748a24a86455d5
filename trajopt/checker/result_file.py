"""Result files: reading JSON safely, and comparing a trajectory.csv with the result beside it."""

from __future__ import annotations

import csv
import io
import json
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from trajopt.checker.case import DERIVATIVES, LOADED, Array, Case
from trajopt.checker.float_twin import FloatTwin, Instants, friction_signs
from trajopt.checker.values import shown

LARGEST_FILE: Final = 512 * 2**20
_COLUMNS: Final = {
    "time": "t", "position": "q", "velocity": "v", "acceleration": "a", "jerk": "j", "snap": "s",
    "force": "F", "power": "P",
}  # fmt: skip
_PRINTED: Final = 1e-15
_COMPUTED: Final = 1e-12  # of the largest, for what the result does not hold and rounding moves
_ALONG: Final = 1e-9  # the same where it hangs on the slope of a spline


class CheckerInputError(ValueError):
    """The file is no result at all: unreadable, truncated, not JSON. One line says which."""


def read_json(path: Path) -> dict[str, Any]:
    """The data of a JSON file; CheckerInputError when there is none to be had."""
    try:
        data = json.loads(_text(path), object_pairs_hook=_without_duplicates, parse_constant=_no_constant)
    except json.JSONDecodeError as error:
        raise CheckerInputError(f"{path} is truncated or no JSON: {error.msg} at line {error.lineno}") from None
    except CheckerInputError:
        raise
    except (ValueError, RecursionError) as error:
        reason = str(error) if isinstance(error, ValueError) else "nested too deeply"
        raise CheckerInputError(f"{path} is no result: {reason}") from None
    if not isinstance(data, dict):
        raise CheckerInputError(f"{path} is no result: it holds {shown(data)}")
    return data


def _text(path: Path) -> str:
    """The text of a regular file of a sane size; a pipe must not hang us, nor /dev/zero fill the memory."""
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    except (OSError, ValueError) as error:
        raise CheckerInputError(f"{path} cannot be read: {getattr(error, 'strerror', error)}") from None
    try:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            raise CheckerInputError(f"{path} is not a regular file")
        if status.st_size > LARGEST_FILE:
            raise CheckerInputError(f"{path} has {status.st_size} bytes; at most {LARGEST_FILE} are read")
        with os.fdopen(os.dup(handle), "rb") as file:
            return file.read(LARGEST_FILE + 1).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CheckerInputError(f"{path} cannot be read as UTF-8 text: {error}") from None
    finally:
        os.close(handle)


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"key {shown(next(name for name in names if names.count(name) > 1))} appears twice")
    return found


def _no_constant(name: str) -> Any:
    raise ValueError(f"it holds {name}, which is no number")


def table_fault(path: Path, case: Case | None, notes: list[str]) -> str:
    """What trajectory.csv says otherwise than the result; empty when it says the same."""
    if case is None:
        return "carries numbers although the result is no solution"
    try:
        rows = list(csv.reader(io.StringIO(_text(path)), strict=True))
    except (CheckerInputError, csv.Error) as error:
        return str(error)
    rows = [row for row in rows if row and not row[0].startswith("#")]
    header = [cell.strip() for cell in rows[0]] if rows else []
    if len(rows) != case.count + 2:
        return f"has {max(len(rows) - 1, 0)} rows where {case.count + 1} belong"
    expected = dict(zip(("time", *DERIVATIVES), ([case.time], *([x] for x in _columns(case))), strict=False))
    if case.inertia is not None:
        expected |= {name: _loaded(case, name) for name in LOADED}
    letters = {_COLUMNS[name]: name for name in expected}
    found = [letters.get(cell.partition(" ")[0]) for cell in header]
    notes += [f"trajectory.csv {shown(cell)}" for cell, name in zip(header, found, strict=True) if name is None]
    length = "rad" if case.rotary else "m"
    for cell, name in zip(header, found, strict=True):
        if name is not None and cell != f"{_COLUMNS[name]} [{(unit := _unit(name, length))}]":
            return f"header {shown(cell)}: {name} is in {unit}"
    named, needed = sorted(filter(None, found)), sorted(name for name in expected if name not in LOADED)
    if len(set(named)) != len(named) or not set(needed) <= set(named):
        columns = ", ".join(_COLUMNS[name] for name in expected if name not in LOADED)
        return f"needs one column each of {columns}; its header is {shown(','.join(header))}"
    if any(len(row) != len(header) for row in rows):
        return "is truncated: a row has more or fewer cells than the header"
    return _column_faults(rows, found, expected, along=bool(case.splines))


def _unit(name: str, length: str) -> str:
    if name in ("force", "power"):
        return "W" if name == "power" else "N" if length == "m" else "N m"
    order = ("time", *DERIVATIVES).index(name) - 1
    return "s" if order < 0 else length + ("", "/s", "/s^2", "/s^3", "/s^4")[order]


def _loaded(case: Case, name: str) -> list[Array]:
    """Force or power at the nodes, for each convention of friction at rest."""
    twin, count = FloatTwin(case), case.count
    nodes = np.arange(count + 1)
    instants = Instants(nodes, np.minimum(nodes, count - 1), np.ones(count + 1))
    velocity = case.signal[1]
    return [twin.loaded(name, instants, velocity, case.coulomb * s) for s in friction_signs(velocity, case.rest)]


def _columns(case: Case) -> tuple[Array, ...]:
    """The derivatives as columns of N+1 rows: the last row of the top one repeats (exact) or is zero (Euler)."""
    top = case.signal[-1]
    return (*case.signal[:-1], np.append(top, 0.0 if case.scheme == "euler" else top[-1]))


def _column_faults(
    rows: list[list[str]], names: list[str | None], expected: Mapping[str, list[Array]], along: bool
) -> str:
    for column, name in enumerate(names):
        if name is None:
            continue
        try:
            given = np.array([float(row[column]) for row in rows[1:]])
        except ValueError as error:
            return f"column {name}: {error}"
        off = np.min([np.abs(given - wanted) for wanted in expected[name]], axis=0)
        largest = max(float(np.max(np.abs(wanted))) for wanted in expected[name])
        computed = (_ALONG if along else _COMPUTED) * largest if name in LOADED else 0.0
        differs = ~(off <= _PRINTED * np.abs(expected[name][0]) + computed)
        if np.any(differs):
            k = int(np.argmax(differs))
            return f"row {k + 1}: {name} is {float(given[k])!r}, the result says {float(expected[name][0][k])!r}"
    return ""
