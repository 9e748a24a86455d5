"""How the values of a problem are read: numbers with units, tables over time, limits; refused in engineer's words."""

from __future__ import annotations

import difflib
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError, ValidationInfo

from trajopt import units
from trajopt.errors import BadInput
from trajopt.units import shown

LONGEST_TABLE: Final = 10_000


class Section(BaseModel):
    """A frozen part of a problem. Made in code from what cannot be meant, it raises BadInput in one line."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            from trajopt.problem_file import explain

            raise BadInput(explain(error, type(self))) from None

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A changed copy, not validated; without the cached properties of the original, which it need not share."""
        copied = super().model_copy(update=update, deep=deep)
        for name in copied.__dict__.keys() - type(self).model_fields.keys():
            del copied.__dict__[name]
        return copied

    # Else pydantic takes it for one that validation must go through, and loses the context (units) on the way.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]


def digest(canonical: Mapping[str, Any]) -> str:
    """The hash of a problem, from its canonical form."""
    text = json.dumps(canonical, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


class Whole(Section):
    """A problem: sections that can be replaced, and the data and hash that it is known by."""

    def replace(self, **sections: Any) -> Self:
        """A copy with sections replaced, validated again."""
        return type(self)(**{name: getattr(self, name) for name in type(self).model_fields} | sections)

    @property
    def hash(self) -> str:
        """SHA-256 of the canonical form: two problems with the same one are the same problem."""
        return digest(self.canonical())

    def canonical(self) -> dict[str, Any]:
        """Plain SI data that says everything about the problem, for result files and hashes."""
        return self.model_dump(mode="json", exclude_none=True)


def si(value: Any, kind: str, info: ValidationInfo, rotary: bool | None = None) -> float:
    """One SI number from a float (code) or a text with a unit (file); of the axis at hand unless ``rotary`` says."""
    context = info.context or {}
    rotary = bool(context.get("rotary")) if rotary is None else rotary
    wanted = units.kinds(rotary)[kind]
    if isinstance(value, str):
        return units.to_si(value, kind, rotary)
    if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
        raise ValueError(f"{shown(value)} is not {units.article(wanted.name)}; write for example {wanted.example!r}")
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"must be finite, got {value!r}; leave the key out where there is no limit")
    if context.get("texts_only"):
        raise ValueError(f"{shown(value)} has no unit; write for example {wanted.example!r}")
    size: Any = abs(value)
    if not size <= units.LARGEST:
        raise ValueError(f"must be finite and at most 1e30 in size, got {shown(value)}")
    return float(value)


def sequence(value: Any, what: str) -> list[Any]:
    if isinstance(value, str | Mapping) or not hasattr(value, "__iter__"):
        raise ValueError(f"{what} must be a list, got {shown(value)}")
    values = list(value)
    if len(values) > LONGEST_TABLE:
        raise ValueError(f"{what} must be a list of at most {LONGEST_TABLE} values, got {len(values)}")
    return values


def nearest(name: str, known: Sequence[str]) -> str:
    """``; did you mean 'limits'?`` or the list of what is known."""
    close = difflib.get_close_matches(name[:80].lower(), known, n=1, cutoff=0.5)
    if close:
        return f"; did you mean {close[0]!r}?"
    return f"; known: {', '.join(known)}" if known else ""


def refuse_unknown(given: Mapping[Any, Any], known: Sequence[str]) -> None:
    for key in given:
        if key not in known:
            raise ValueError(f"unknown key {shown(key)}{nearest(str(key), known)}")


def positive(kind: str) -> BeforeValidator:
    def read(value: Any, info: ValidationInfo) -> float:
        number = si(value, kind, info)
        if number <= 0:
            raise ValueError(f"must be > 0, got {shown(value)}")
        return number

    return BeforeValidator(read)


def nonnegative(kind: str) -> BeforeValidator:
    def read(value: Any, info: ValidationInfo) -> float:
        number = si(value, kind, info)
        if number < 0:
            raise ValueError(f"must be 0 or more, got {shown(value)}")
        return number

    return BeforeValidator(read)


def plain(*, most: float, example: str, least: float = -math.inf, above: float = -math.inf) -> BeforeValidator:
    """A number without a unit, ``least`` to ``most``, or ``above`` one and up to ``most``."""
    wanted = f"{least:g} to {most:g}" if math.isfinite(least) else f"above {above:g} and at most {most:g}"

    def read(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
            raise ValueError(f"must be a plain number such as {example}, no text and no unit, got {shown(value)}")
        if not (least <= value <= most and value > above):
            raise ValueError(f"must be {wanted}, got {shown(value)}")
        return float(value)

    return BeforeValidator(read)


class Table(Section):
    """A value that varies over the move: piecewise linear in time, constant outside the table."""

    time: tuple[float, ...]
    value: tuple[float, ...]

    def at(self, t: NDArray[np.float64]) -> NDArray[np.float64]:
        """The values at times ``t`` in s."""
        return np.interp(t, self.time, self.value)


def read_table(value: Any, kind: str, column: str, info: ValidationInfo) -> Table:
    """A Table from ``{time = [...], <column> = [...]}``."""
    example = units.kinds(bool((info.context or {}).get("rotary")))[kind].example
    for key, text in (("time", "0.5 s"), (column, example)):
        if value.get(key) is None:
            raise ValueError(f'{key}: is missing; write time = ["0 s", "1 s"] and {column} = ["{example}", ...]')
        if not isinstance(value[key], list | tuple | np.ndarray):
            raise ValueError(f'{key}: must be a list such as ["{text}", ...], got {shown(value[key])}')
    times = [si(t, "time", info) for t in sequence(value["time"], "time")]
    values = [si(x, kind, info) for x in sequence(value[column], column)]
    if len(times) != len(values) or len(times) < 2:
        raise ValueError(f"needs as many values as times, at least two; got {len(times)} times, {len(values)} values")
    for i, (earlier, later) in enumerate(zip(times, times[1:], strict=False), 1):
        if later <= earlier:
            raise ValueError(f"time: must increase, got {value['time'][i - 1]!r} and then {value['time'][i]!r}")
    return Table(time=tuple(times), value=tuple(values))


class Limit(Section):
    """What a signal must stay within, at every instant: ``min`` and ``max``, each a number, a Table or no limit."""

    min: float | Table | None = None
    max: float | Table | None = None

    def at(self, t: NDArray[np.float64]) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
        """Lower and upper limit at times ``t`` in s; None where there is none."""

        def side(limit: float | Table | None) -> NDArray[np.float64] | None:
            if limit is None:
                return None
            return limit.at(t) if isinstance(limit, Table) else np.full(np.shape(t), float(limit))

        return side(self.min), side(self.max)

    @property
    def lowest(self) -> float:
        """The smallest value allowed at any time (-inf without a lower limit)."""
        return -math.inf if self.min is None else min(self.min.value) if isinstance(self.min, Table) else self.min

    @property
    def highest(self) -> float:
        """The largest value allowed at any time (inf without an upper limit)."""
        return math.inf if self.max is None else max(self.max.value) if isinstance(self.max, Table) else self.max

    @property
    def varies(self) -> bool:
        """Whether the limit depends on time."""
        return isinstance(self.min, Table) or isinstance(self.max, Table)

    @property
    def symmetric(self) -> bool:
        """Whether the limit is plus-minus one value (or one table)."""
        if isinstance(self.min, Table) and isinstance(self.max, Table):
            mirrored = tuple(-x for x in self.max.value)
            return self.min.time == self.max.time and self.min.value == mirrored
        return isinstance(self.min, float) and isinstance(self.max, float) and self.min == -self.max

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Times at which the limit has a corner, in s."""
        return tuple(t for side in (self.min, self.max) if isinstance(side, Table) for t in side.time)


def read_limit(kind: str) -> BeforeValidator:
    def read(value: Any, info: ValidationInfo) -> Limit | None:
        if value is None or isinstance(value, Limit):
            return value if value is None else _checked(value, value)
        if isinstance(value, Mapping):
            return _limit_table(dict(value), kind, info)
        if isinstance(value, str | int | float):
            bound = si(value, kind, info)
            if bound <= 0:
                raise ValueError(
                    f"must be > 0 (one value means plus-minus), got {shown(value)}; leave the key out for no limit"
                )
            return Limit(min=-bound, max=bound)
        pair = sequence(value, "a limit with more than one value")
        if len(pair) != 2:
            raise ValueError(f"needs one value (plus-minus) or a pair [min, max], got {len(pair)} values")
        return _checked(Limit(min=si(pair[0], kind, info), max=si(pair[1], kind, info)), value)

    return BeforeValidator(read)


def read_ceiling(kind: str) -> BeforeValidator:
    """A limit from above on what is never negative: one number."""

    def read(value: Any, info: ValidationInfo) -> Limit | None:
        if value is None:
            return None
        highest = value
        if isinstance(value, Limit) and value.min is None:
            highest = value.max
        elif isinstance(value, Mapping) and set(value) == {"max"}:
            highest = value["max"]
        bound = si(highest, kind, info)
        if bound <= 0:
            raise ValueError(f"must be > 0, got {shown(highest)}; leave the key out for no limit")
        return Limit(max=bound)

    return BeforeValidator(read)


def _limit_table(value: dict[str, Any], kind: str, info: ValidationInfo) -> Limit:
    refuse_unknown(value, ("time", "value", "min", "max"))
    if "value" in value:
        if "min" in value or "max" in value:
            raise ValueError("give either value (plus-minus), or min and max, not both")
        upper = read_table(value, kind, "value", info)
        lower = Table(time=upper.time, value=tuple(-x for x in upper.value))
        return _checked(Limit(min=lower, max=upper), value)
    if value.get("time") is None:
        sides = {side: _side(value[side], kind, info) for side in ("min", "max") if value.get(side) is not None}
    else:
        sides = {side: read_table(value, kind, side, info) for side in ("min", "max") if value.get(side) is not None}
    if not sides:
        raise ValueError("is empty; give min, max or both, or leave the key out for no limit")
    return _checked(Limit(**sides), value)


def _side(value: Any, kind: str, info: ValidationInfo) -> float | Table:
    if isinstance(value, Table):
        return value
    if isinstance(value, Mapping):
        refuse_unknown(value, ("time", "value"))
        return read_table(dict(value), kind, "value", info)
    return si(value, kind, info)


def _checked(limit: Limit, value: Any) -> Limit:
    times = np.array(limit.breakpoints or (0.0,))
    lower, upper = limit.at(times)
    if not all(np.all(np.isfinite(side)) for side in (lower, upper) if side is not None):
        raise ValueError("must be finite; leave a side out where there is no limit")
    if lower is not None and upper is not None and np.any(lower >= upper):
        pair = f"min {value[0]!r} and max {value[1]!r}" if isinstance(value, list | tuple) else shown(value)
        raise ValueError(f"min must be below max at all times, got {pair}; swap or widen them")
    return limit
