"""The problem of a linear plant: which plant, how far its input reaches, where it must come to rest. Frozen.

Numbers are plain: time in seconds, input and output in units of the user's own. Complex poles and zeros are pairs
[re, im], in code also complex numbers; their conjugates may be left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import isfinite, pi
from typing import Annotated, Any, Final, Literal, Self

import numpy as np
from pydantic import BeforeValidator, PlainSerializer, ValidationError, ValidationInfo, model_validator

from trajopt.errors import BadInput
from trajopt.fields import Section, Whole, sequence, si
from trajopt.plant.minimum_time import added_poles, band, ends
from trajopt.plant.plant import Plant
from trajopt.problem import OneLine
from trajopt.problem_file import explain
from trajopt.units import LARGEST, shown

MOST: Final = 20  # states, and samples of a band
_FORMS: Final = (("numerator", "denominator"), ("poles", "zeros", "gain"), ("A", "B", "C", "D"))
_NEEDED: Final = (("numerator", "denominator"), ("poles",), ("A", "B", "C"))
_DESCRIBE: Final = "give numerator and denominator, or poles, zeros and gain, or A, B, C and D"
_NAMES: Final = {"u_ss": "final_input", "y_f": "final_value", "input limits:": "input:", "umin < umax": "min < max"}


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
        raise ValueError(f"must be a plain number (time is in s, the rest in your own units), got {shown(value)}")
    size: Any = abs(value)
    if not size <= LARGEST or 0 < size < 1 / LARGEST:
        raise ValueError(f"must be finite and zero or 1e-30 to 1e30 in size, got {shown(value)}")
    return float(value)


def _optional(value: Any) -> float | None:
    return None if value is None else _number(value)


def _listed(value: Any, what: str) -> list[Any]:
    found = sequence(value, what)
    if len(found) > MOST + 1:
        raise ValueError(f"takes a plant of at most {MOST} states, got a list of {len(found)}")
    return found


def _row(value: Any) -> tuple[float, ...] | None:
    if value is None:
        return None
    values = _listed(value, "the value")
    if len(values) == 1 and isinstance(values[0], list | tuple | np.ndarray):  # a matrix of one row
        values = _listed(values[0], "its row")
    return tuple(_number(x[0] if isinstance(x, list | tuple | np.ndarray) and len(x) == 1 else x) for x in values)


def _matrix(value: Any) -> tuple[tuple[float, ...], ...] | None:
    if value is None:
        return None
    rows = [tuple(_number(x) for x in _listed(row, "a row")) for row in _listed(value, "the value")]
    if not rows or any(len(row) != len(rows) for row in rows):
        raise ValueError(f"must be square, as many rows as columns, got rows of {[len(row) for row in rows]}")
    return tuple(rows)


def _roots(value: Any) -> tuple[complex, ...] | None:
    """Complex numbers from numbers and pairs [re, im], with the conjugates that were left out."""
    if value is None:
        return None
    found = [_root(x) for x in _listed(value, "the value")]
    missing = []
    for x in dict.fromkeys(found):
        missing += [x.conjugate()] * (found.count(x) - found.count(x.conjugate()))
    if len(found) + len(missing) > MOST:
        raise ValueError(f"takes at most {MOST}, got {len(found) + len(missing)} with conjugates")
    return (*found, *missing)


def _root(value: Any) -> complex:
    if isinstance(value, complex | np.complexfloating):
        return complex(_number(value.real), _number(value.imag))
    if isinstance(value, list | tuple | np.ndarray):
        if len(value) != 2:
            raise ValueError(f"{shown(value)} is neither a number nor a pair [re, im]")
        return complex(_number(value[0]), _number(value[1]))
    return complex(_number(value), 0.0)


def _plain_roots(roots: tuple[complex, ...] | None) -> list[Any] | None:
    return roots if roots is None else [[p.real, p.imag] if p.imag else p.real for p in roots]


def _input(value: Any) -> tuple[float, float]:
    if isinstance(value, list | tuple | np.ndarray):
        if len(value) != 2:
            raise ValueError(f"needs one number (plus-minus) or a pair [min, max], got {len(value)} values")
        low, high = _number(value[0]), _number(value[1])
        if not low < high:
            raise ValueError(f"min must be below max, got {shown(value)}; swap or widen them")
        return low, high
    if not (high := _number(value)) > 0:
        raise ValueError(f"must be > 0 (one number means plus-minus), got {shown(value)}")
    return -high, high


def _band(value: Any, info: ValidationInfo) -> tuple[float, float] | None:
    if value is None:
        return None
    found = [si(x, "frequency", info) for x in sequence(value, "the value")]
    if len(found) != 2 or not 0 < found[0] <= found[1]:
        raise ValueError(f'needs a pair of frequencies such as ["7 Hz", "9 Hz"], 0 < min <= max, got {shown(value)}')
    return found[0], found[1]


def _damping(value: Any) -> float:
    if not 0 <= (damping := _number(value)) < 1:
        raise ValueError(f"must be 0 or more and below 1 (a ratio, not per cent), got {shown(value)}")
    return damping


def _count(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 1 <= value <= MOST // 2:
        raise ValueError(f"must be a whole number, 1 to {MOST // 2}, such as 3, got {shown(value)}")
    return int(value)


Number = Annotated[float | None, BeforeValidator(_optional)]
Row = Annotated[tuple[float, ...] | None, BeforeValidator(_row)]
Roots = Annotated[tuple[complex, ...] | None, BeforeValidator(_roots), PlainSerializer(_plain_roots)]


class Robust(Section):
    """Poles whose residual vibration must vanish besides the plant's: ``count`` frequencies (Hz) spread over a
    ``band``, of a ``damping`` ratio; or ``poles`` (1/s)."""

    band: Annotated[tuple[float, float] | None, BeforeValidator(_band)] = None
    damping: Annotated[float, BeforeValidator(_damping)] = 0.0
    count: Annotated[int, BeforeValidator(_count)] = 3
    poles: Roots = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.band is None) == (not self.poles):
            raise ValueError('give either band = ["7 Hz", "9 Hz"] or poles = [[-0.1, 50.0]]')
        if self.poles and (self.damping, self.count) != (0.0, 3):
            raise ValueError("damping and count belong to a band; leave them out beside poles")
        return self

    @property
    def added(self) -> tuple[complex, ...]:
        """The poles, 1/s."""
        if self.band is None:
            return self.poles or ()
        return band(2 * pi * self.band[0], 2 * pi * self.band[1], self.damping, self.count)


def _robust(value: Any, info: ValidationInfo) -> Any:
    if value is None or value == "zvd" or isinstance(value, Robust):
        return value
    if not isinstance(value, Mapping):
        raise ValueError(f'must be "zvd", {{ band = ["7 Hz", "9 Hz"] }} or {{ poles = [...] }}, got {shown(value)}')
    try:
        return Robust.model_validate(value, context=info.context)
    except ValidationError as error:
        raise ValueError(explain(error, Robust)) from None


class PlantSection(Section):
    """A proper plant with one input and one output, by one of three descriptions, and its move from rest at zero.

    ``input`` (min, max); ``final_value`` the output at rest; ``final_input`` holds it there, and follows from it unless
    the plant has a zero at the origin. ``robust``: "zvd" doubles every oscillatory pole, or `Robust`.
    """

    numerator: Row = None
    denominator: Row = None
    poles: Roots = None
    zeros: Roots = None
    gain: Number = None
    A: Annotated[tuple[tuple[float, ...], ...] | None, BeforeValidator(_matrix)] = None
    B: Row = None
    C: Row = None
    D: Number = None
    input: Annotated[tuple[float, float], BeforeValidator(_input)]
    final_value: Annotated[float, BeforeValidator(_number)]
    final_input: Number = None
    robust: Annotated[Literal["zvd"] | Robust | None, BeforeValidator(_robust)] = None

    @model_validator(mode="after")
    def _possible(self) -> Self:
        given = [form for form in _FORMS if any(getattr(self, key) is not None for key in form)]
        if len(given) != 1:
            stated = " and ".join(next(key for key in form if getattr(self, key) is not None) for form in given)
            raise ValueError(f"{f'{stated} are different descriptions' if given else 'is not described'}; {_DESCRIBE}")
        for key in _NEEDED[_FORMS.index(given[0])]:
            if getattr(self, key) is None:
                raise ValueError(f"{key}: is missing; {_DESCRIBE}")
        with translated():
            plant = self.model
            ends(plant, *self.input, self.final_input, self.final_value)
            added_poles(plant, self.added)
        return self

    @property
    def added(self) -> str | tuple[complex, ...]:
        """What robustness adds, as `time_optimal` takes it."""
        return "zvd" if self.robust == "zvd" else () if self.robust is None else self.robust.added

    @property
    def model(self) -> Plant:
        """The plant. Raises BadInput."""
        with translated():
            if self.poles is not None:
                plant = Plant.from_poles(self.poles, self.zeros or (), 1.0 if self.gain is None else self.gain)
            elif self.numerator is not None and self.denominator is not None:
                plant = Plant.from_polynomials(self.numerator, self.denominator)
            else:
                a, b, c = (np.array(x, float) for x in (self.A, self.B, self.C))
                plant = Plant.from_state_space(a, b, c, self.D or 0.0)
            if not (isfinite(plant.limit) and all(np.all(np.isfinite(x)) for x in plant.matrices)):
                raise np.linalg.LinAlgError
        return plant


@contextmanager
def translated(section: str = "") -> Iterator[None]:
    """Around calls of the plant's mathematics: what it refuses becomes BadInput in the words of a problem file."""
    try:
        with np.errstate(all="ignore"):
            yield
    except BadInput:
        raise
    except np.linalg.LinAlgError:
        raise BadInput(f"{section}: its numbers span too many powers of ten; choose other units".lstrip(": ")) from None
    except ValueError as error:
        message = str(error).removeprefix("plant: ")
        for name, written in _NAMES.items():
            message = message.replace(name, written)
        field = message.partition(":")[0] in PlantSection.model_fields
        raise BadInput(message if not section else f"{section}{'.' if field else ': '}{message}") from None


class PlantProblem(Whole):
    """A minimum-time command to find for a linear plant. Frozen; ``problem.replace(...)`` gives a changed copy."""

    plant: PlantSection
    title: OneLine = ""
    source: OneLine = ""
    moral: OneLine = ""
