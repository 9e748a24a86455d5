"""Values of plain data, read without trust: whatever is not as a result file has it is Malformed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np

from trajopt.checker.case import Array

WITH_SOLUTION: Final = ("SOLVED", "SOLVED_LOCAL")
WITHOUT_SOLUTION: Final = (
    "IMPOSSIBLE", "IMPOSSIBLE_ON_GRID", "UNDECIDED", "LIMIT", "BAD_INPUT", "CRASHED", "INTERRUPTED",
)  # fmt: skip
LARGEST_NUMBER: Final = 1e60


class Malformed(ValueError):
    """The data is not what a result file holds."""


def is_solved(result: Mapping[str, Any], required: Iterable[str], numbers: Iterable[str]) -> bool:
    """Whether a result has a solution, by its status. Raises Malformed for a required key that is missing, and for
    numbers where there is none."""
    for key in required:
        if key not in result:
            raise Malformed(f"{key} is missing")
    status = result["status"]
    if status in WITHOUT_SOLUTION:
        for key in numbers:
            if result[key] is not None:
                raise Malformed(f"{status} must carry no numbers, but {key} is not null")
    elif status not in WITH_SOLUTION:
        raise Malformed(f"unknown status {shown(status)}")
    return status in WITH_SOLUTION


def shown(value: Any) -> str:
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # more digits, or nesting, than Python prints
        text = f"a {type(value).__name__} beyond printing"
    return text if len(text) <= 60 else text[:57] + "..."


def mapping(value: Any, where: str, known: Iterable[str] | None = None) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise Malformed(f"{where} is missing or not an object")
    for key in value if known is not None else ():
        if key not in (known or ()):
            raise Malformed(f"{where} has {shown(key)}, which this checker does not know")
    return value


def number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise Malformed(f"{where} is {shown(value)}, not a number")
    if not abs(value) <= LARGEST_NUMBER:
        raise Malformed(f"{where} is {shown(value)}, not finite or absurdly large")
    return float(value)


def nonnegative(value: Any, where: str) -> float:
    if (found := number(value, where)) < 0:
        raise Malformed(f"{where} is {found!r}, negative")
    return found


def whole(value: Any, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise Malformed(f"{where} is {shown(value)}, not a whole number")
    return value


def all_finite(value: Any, where: str) -> None:
    """Every number anywhere in the problem is finite."""
    if value is None or isinstance(value, str | bool):
        return
    if isinstance(value, int | float):
        number(value, where)
    elif isinstance(value, Mapping):
        for key, item in value.items():
            all_finite(item, f"{where}.{key}")
    elif isinstance(value, list | tuple):
        for item in value:
            all_finite(item, where)


def vector(values: Any, where: str) -> Array:
    if not isinstance(values, list | tuple):
        raise Malformed(f"{where} is missing or not a list")
    if not set(map(type, values)) <= {float, int}:
        wrong = next(x for x in values if type(x) not in (float, int))
        raise Malformed(f"{where} holds {shown(wrong)}, not a number")
    try:
        found = np.array(values, dtype=np.float64)
    except OverflowError:
        raise Malformed(f"{where} holds an absurdly large number") from None
    if not np.all(np.abs(found) <= LARGEST_NUMBER):
        raise Malformed(f"{where} holds a number that is not finite or absurdly large")
    return found
