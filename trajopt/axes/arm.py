"""The sections [arm] and [tip] of a problem of several axes: what moves, and where its tip must be, and how fast."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, Final, Literal, Self

from pydantic import BeforeValidator, PlainSerializer, ValidationError, ValidationInfo, model_validator

from trajopt.axes.dynamics import KINDS, Dynamics, known_arm
from trajopt.fields import Section, positive, sequence, si
from trajopt.problem_file import explain
from trajopt.units import shown

MOST_LINKS: Final = 12
MOST_POWERS: Final = 16


def _each(kind: str, rotary: bool = False, above: bool = True) -> BeforeValidator:
    """A number a link, all positive, or (not ``above``) zero or more."""

    def read(value: Any, info: ValidationInfo) -> tuple[float, ...] | None:
        if value is None:
            return None
        found = tuple(si(x, kind, info, rotary) for x in sequence(value, "the value"))
        if not 1 <= len(found) <= MOST_LINKS:
            raise ValueError(f"needs 1 to {MOST_LINKS} values, one a link, got {len(found)}")
        for k, x in enumerate(found, 1):
            if x < 0 or (above and x == 0):
                raise ValueError(f"link {k}: must be {'> 0' if above else '0 or more'}, got {shown(value[k - 1])}")
        return found

    return BeforeValidator(read)


def _payload(value: Any, info: ValidationInfo) -> float:
    if (mass := si(value, "inertia", info, rotary=False)) < 0:
        raise ValueError(f"must be 0 or more, got {shown(value)}")
    return mass


class ArmSection(Section):
    """A planar arm: ``kind`` scara (two links, Lagrange) or planar (any number, Newton and Euler); a value a link of
    ``lengths`` (m), ``masses`` (kg), ``centres`` (m, from the joint; half the length by default) and ``inertias`` about
    the centres of mass (kg m²); ``payload`` at the tip (kg)."""

    kind: Literal["scara", "planar"]
    lengths: Annotated[tuple[float, ...], _each("position")]
    masses: Annotated[tuple[float, ...], _each("inertia")]
    centres: Annotated[tuple[float, ...] | None, _each("position", above=False)] = None
    inertias: Annotated[tuple[float, ...], _each("inertia", rotary=True, above=False)]
    payload: Annotated[float, BeforeValidator(_payload)] = 0.0

    @model_validator(mode="after")
    def _whole(self) -> Self:
        self.dynamics  # noqa: B018 (it refuses unequal counts)
        return self

    @cached_property
    def dynamics(self) -> Any:
        """The arm. Raises BadInput."""
        centres = self.centres or tuple(x / 2 for x in self.lengths)
        return known_arm(
            self.kind, lengths=self.lengths, masses=self.masses, centres=centres, inertias=self.inertias,
            payload=self.payload,
        )  # fmt: skip


def _arm(value: Any, info: ValidationInfo) -> Any:
    if value is None or isinstance(value, ArmSection):
        return value
    if isinstance(value, Mapping):
        try:
            return ArmSection.model_validate(value, context=info.context)
        except ValidationError as error:
            raise ValueError(explain(error, ArmSection)) from None
    if not isinstance(value, Dynamics):
        raise ValueError(f"must be a section with kind = {' or '.join(KINDS)}, or an object with joints and torque,"
                         f" got {shown(value)}")  # fmt: skip
    return value


def _plain(arm: Any) -> Any:
    """The section for a file; of an arm of the user's own what it is called."""
    if arm is None or isinstance(arm, ArmSection):
        return arm and arm.model_dump(mode="json", exclude_none=True)
    return {"kind": "own", "name": type(arm).__qualname__, "joints": arm.joints}


Arm = Annotated[Any, BeforeValidator(_arm), PlainSerializer(_plain)]


def _pair(kind: str) -> BeforeValidator:
    def read(value: Any, info: ValidationInfo) -> tuple[float, float] | None:
        if value is None:
            return None
        found = [si(x, kind, info, rotary=False) for x in sequence(value, "the value")]
        if len(found) != 2:
            raise ValueError(f"needs x and y, got {len(found)} values")
        return found[0], found[1]

    return BeforeValidator(read)


def _powers() -> BeforeValidator:
    def read(value: Any, info: ValidationInfo) -> tuple[float, ...]:
        found = tuple(si(x, "position", info, rotary=False) for x in sequence(value, "the value"))
        if not 1 <= len(found) <= MOST_POWERS:
            raise ValueError(f"needs 1 to {MOST_POWERS} coefficients, lowest power first, got {len(found)}")
        return found

    return BeforeValidator(read)


class Path(Section):
    """What the tip follows from end to end, within ``width``/2 (m) on either side, with the ``elbow`` up (second joint
    negative) or down."""

    width: Annotated[float, positive("position")]
    elbow: Literal["up", "down"] = "up"

    def point(self, s: Any) -> tuple[Any, Any]:
        """x and y (m) at path parameters of 0 to 1, elementwise."""
        raise NotImplementedError

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Where it starts and where it ends, m."""
        return self.point(0.0), self.point(1.0)


class ParametricCurve(Path):
    """A curve of a path parameter s from 0 to 1: ``x`` and ``y`` (m) are polynomials in it, lowest power first."""

    x: Annotated[tuple[float, ...], _powers()]
    y: Annotated[tuple[float, ...], _powers()]

    @model_validator(mode="after")
    def _long(self) -> Self:
        if not any(self.x[1:] + self.y[1:]):
            raise ValueError('x and y do not depend on s; write for example x = ["0.5 m", "-0.2 m"]')
        return self

    def point(self, s: Any) -> tuple[Any, Any]:
        return _horner(self.x, s), _horner(self.y, s)


def _horner(powers: tuple[float, ...], s: Any) -> Any:
    value: Any = 0.0
    for power in reversed(powers):
        value = value * s + power
    return value


class Line(Path):
    """A straight line (x and y in m) from ``start`` to ``end``."""

    start: Annotated[tuple[float, float], _pair("position")]
    end: Annotated[tuple[float, float], _pair("position")]

    def point(self, s: Any) -> tuple[Any, Any]:
        (x0, y0), (x1, y1) = self.start, self.end
        return x0 + s * (x1 - x0), y0 + s * (y1 - y0)

    @model_validator(mode="after")
    def _long(self) -> Self:
        if self.start == self.end:
            raise ValueError("start and end are one point; a line needs two")
        return self


def _release(value: Any, info: ValidationInfo) -> Any:
    if value in ("end", "free"):
        return value
    try:
        time = si(value, "time", info)
    except ValueError as error:
        raise ValueError(f'{error}, or "end", or "free"') from None
    if time <= 0:
        raise ValueError(f'must be > 0, got {shown(value)}; or "end", or "free"')
    return time


class Tip(Section):
    """What is asked of the tip: its ``velocity`` (x and y, m/s) at the ``release``, which is at the end, at a time (s)
    or at a free one, and is then followed by what the axes' ends ask; or a ``line`` or a ``curve`` to follow."""

    velocity: Annotated[tuple[float, float] | None, _pair("velocity")] = None
    release: Annotated[float | Literal["end", "free"], BeforeValidator(_release)] = "end"
    line: Line | None = None
    curve: ParametricCurve | None = None

    @model_validator(mode="after")
    def _some(self) -> Self:
        if sum(x is not None for x in (self.velocity, self.line, self.curve)) != 1:
            raise ValueError('give either velocity = ["0 m/s", "12.5 m/s"] or line = { start = …, end = …, width = … }'
                             " or curve = { x = …, y = …, width = … }")  # fmt: skip
        if self.path is not None and self.release != "end":
            raise ValueError("release: belongs to a velocity; leave it out beside a line or curve")
        return self

    @property
    def path(self) -> Path | None:
        """The line or curve, or None."""
        return self.line or self.curve


def dynamics_of(arm: Any) -> Any:
    """The arm itself, of a section or of the user's own; None without any. Raises BadInput."""
    return arm.dynamics if isinstance(arm, ArmSection) else arm
