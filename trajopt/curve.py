"""Curves over position: the inertia and the load torque of a mechanism, through the rows of a table from CAD.

A curve is the quintic spline through its rows (not-a-knot ends). It has four continuous derivatives, so that an
inertia and the J' in the torque are one function and its exact slope, and Newton's method sees no corners.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationInfo, model_validator

from trajopt import units
from trajopt.fields import LONGEST_TABLE, Section, refuse_unknown, sequence, si
from trajopt.units import shown

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

Floats = NDArray[np.float64]

DEGREE: Final = 5
LEAST: Final = DEGREE + 1  # rows
ROUNDING: Final = 1e-9  # of its span
_GAP: Final = 10.0  # times the usual step between rows


def _numbers(value: Any) -> Any:
    return tuple(float(x) for x in value) if isinstance(value, np.ndarray) else value


class Curve(Section):
    """``value`` (n,) at ``position`` (n,), m or rad, increasing; known between the first and the last row only."""

    position: tuple[float, ...]
    value: tuple[float, ...]

    def __init__(self, **values: Any) -> None:
        super().__init__(**{name: _numbers(value) for name, value in values.items()})

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @model_validator(mode="after")
    def _sound(self) -> Self:
        _refuse(self.position, self.value)
        return self

    @classmethod
    def of(cls, function: Callable[[Floats], Any], low: float, high: float, count: int = 361) -> Curve:
        """A function of position, sampled at ``count`` places from ``low`` to ``high``."""
        at = np.linspace(low, high, count)
        return cls(position=at, value=np.broadcast_to(np.asarray(function(at), dtype=float), at.shape))

    @cached_property
    def spline(self) -> BSpline:
        """The curve as scipy has it."""
        from scipy.interpolate import make_interp_spline

        return make_interp_spline(np.array(self.position), np.array(self.value), k=DEGREE)

    def at(self, position: Any, derivative: int = 0) -> Floats:
        """The curve, or its derivative of that order, at positions; beyond the table its last piece goes on."""
        return np.asarray(self.spline(position, derivative))

    @property
    def span(self) -> tuple[float, float]:
        """The first and the last position."""
        return self.position[0], self.position[-1]

    def around(self, places: list[float]) -> tuple[float, float]:
        """The span, with places that are outside it by a rounding."""
        low, high = self.span
        near = [x for x in places if low - self.room <= x <= high + self.room]
        return min([low, *near]), max([high, *near])

    @property
    def room(self) -> float:
        """By how much a place may be outside the table and count as on its end."""
        return ROUNDING * (self.span[1] - self.span[0])

    @property
    def lowest(self) -> float:
        """The least value anywhere between the first and the last row."""
        from scipy.interpolate import PPoly

        slope: Any = self.spline.derivative()
        corners = PPoly.from_spline(slope).roots(discontinuity=False, extrapolate=False)
        return float(np.min(self.at(np.concatenate([self.position, corners[np.isfinite(corners)]]))))


def _refuse(position: tuple[float, ...], value: tuple[float, ...]) -> None:
    if len(position) != len(value):
        raise ValueError(f"needs as many values as positions, got {len(value)} and {len(position)}")
    if len(position) < LEAST:
        raise ValueError(f"needs {LEAST} rows or more for a smooth curve, got {len(position)}; export a finer table")
    for k, (x, y) in enumerate(zip(position, value, strict=True)):
        if not (abs(x) <= units.LARGEST and abs(y) <= units.LARGEST):
            raise ValueError(f"row {k + 1} is not finite, got {x!r} and {y!r}; give every row two numbers")
    steps = np.diff(position)
    if np.any(steps <= 0):
        k = int(np.argmax(steps <= 0))
        raise ValueError(
            f"position: must increase, got {position[k]:.9g} and then {position[k + 1]:.9g} in row {k + 2};"
            " sort the table, and leave out what comes twice"
        )
    usual = float(np.median(steps))
    if np.max(steps) > _GAP * usual:
        k = int(np.argmax(steps))
        raise ValueError(
            f"has a gap from {position[k]:.9g} to {position[k + 1]:.9g}, where other rows are {usual:.3g} apart;"
            " fill it"
        )


def read_curve(value: Any, kind: str, info: ValidationInfo) -> Curve:
    """A Curve from ``{ position = [...], value = [...] }`` or ``{ csv = "file" }``, beside the problem file."""
    refuse_unknown(value, ("position", "value", "csv", "column"))
    if "csv" in value:
        return _from_file(value, kind, info.context or {})
    for key in ("position", "value"):
        if key not in value:
            raise ValueError(f'{key}: is missing; write position = ["0 deg", "1 deg", ...] and value = [...]')
    position = [si(x, "position", info) for x in sequence(value["position"], "position")]
    return Curve(position=tuple(position), value=tuple(si(x, kind, info) for x in sequence(value["value"], "value")))


def written_out(value: Mapping[str, Any], kind: str, context: Mapping[str, Any]) -> dict[str, list[str]]:
    """``{ csv = "file" }`` as ``{ position = [...], value = [...] }``. Raises ValueError."""
    refuse_unknown(value, ("position", "value", "csv", "column"))
    curve, known = _from_file(value, kind, context), units.kinds(bool(context.get("rotary")))
    columns = {"position": (curve.position, "position"), "value": (curve.value, kind)}
    return {key: [f"{x!r} {known[of].unit}" for x in numbers] for key, (numbers, of) in columns.items()}


def _from_file(value: Mapping[str, Any], kind: str, context: Mapping[str, Any]) -> Curve:
    from trajopt.columns import Columns

    name, column = value["csv"], value.get("column")
    if "position" in value or "value" in value:
        raise ValueError("give either csv, or position and value, not both")
    if not isinstance(name, str) or not isinstance(column, str | None):
        raise ValueError(f'csv and column must be texts such as csv = "inertia.csv", got {shown(name)}')
    table = Columns.read(Path(context.get("folder", ".")) / name, LONGEST_TABLE)
    rotary = bool(context.get("rotary"))
    position, values = (table.get(k, rotary, c) for k, c in (("position", None), (kind, column)))
    return Curve(position=position, value=values)
