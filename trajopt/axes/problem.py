"""The problem of several axes: their moves, what they share, what couples them. Frozen; every axis is a `Problem`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, ClassVar, Final, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationError, ValidationInfo, model_validator

import norms
from trajopt.axes.arm import Arm, Tip, dynamics_of
from trajopt.axes.dynamics import Reaching
from trajopt.errors import BadInput
from trajopt.fields import Section, Whole, nonnegative, sequence
from trajopt.problem import (
    DERIVATIVES,
    FREE,
    Limits,
    Load,
    Move,
    Objective,
    OneLine,
    Problem,
    State,
    Term,
    Transcription,
    Via,
    read_time,
)
from trajopt.problem_file import explain
from trajopt.units import shown

MOST_AXES: Final = 12
OF_THE_MOTION: Final = ("time",)  # terms that no axis has for itself
IN_ARMS: Final = (*DERIVATIVES, "force", "power", "energy", "rms_force", "time")


def _state(value: Any) -> Any:
    return {name: FREE for name in DERIVATIVES[:3]} if value == FREE else value


class AxisMove(Section):
    """From where to where one axis moves; ``end = "free"`` leaves all of its end free."""

    start: Annotated[State, BeforeValidator(_state)] = State(position=0.0)
    end: Annotated[State, BeforeValidator(_state)]
    via: tuple[Via, ...] = ()


class Axis(Section):
    """One axis: its own move, limits and load, as in a problem of one axis. On an arm the load is the arm."""

    name: OneLine = ""
    move: AxisMove
    limits: Limits = Limits()
    load: Load = Load()
    rotary: Annotated[bool, Field(strict=True)] = False


def _axes(value: Any, info: ValidationInfo) -> tuple[Axis, ...]:
    found = []
    for k, axis in enumerate(sequence(value, "the axes")):
        if isinstance(axis, Axis):
            found.append(axis)
            continue
        rotary = isinstance(axis, Mapping) and axis.get("rotary") is True
        try:
            found.append(Axis.model_validate(axis, context={**(info.context or {}), "rotary": rotary}))
        except ValidationError as error:
            raise ValueError(f"[{k}].{explain(error, Axis)}") from None
    if not 1 <= len(found) <= MOST_AXES:
        raise ValueError(f"needs 1 to {MOST_AXES} axes, got {len(found)}")
    names = [axis.name or f"axis{k}" for k, axis in enumerate(found, 1)]
    if len(set(names)) < len(names):
        raise ValueError(f"two have one name: {', '.join(names)}; give each its own")
    return tuple(axis.model_copy(update={"name": name}) for axis, name in zip(found, names, strict=True))


class Together(Section):
    """The time of the motion: fixed (s), within a pair, or free; ``shared = false`` gives every axis its own."""

    time: Annotated[float | tuple[float, float] | Literal["free"], BeforeValidator(read_time)]
    shared: Annotated[bool, Field(strict=True)] = True
    dwell: Annotated[float, nonnegative("time")] = 0.0


def _weights(value: Any) -> tuple[float, ...] | None:
    if value is None:
        return None
    found = sequence(value, "the value")
    for x in found:
        if isinstance(x, bool) or not isinstance(x, int | float | np.floating | np.integer) or not 0 <= x <= 1e30:
            raise ValueError(f"must be plain numbers, 0 or more, one an axis such as [0.5, 0.5], got {shown(value)}")
    if not any(found):
        raise ValueError(f"must weigh one axis at least, got {shown(value)}")
    return tuple(float(x) for x in found)


class AxesTerm(Term):
    """A term of every axis, with a weight an axis (``axes``, all 1 by default), summed, or the largest of them."""

    axes: Annotated[tuple[float, ...] | None, BeforeValidator(_weights)] = None
    combine: Literal["sum", "max"] = "sum"

    def shares(self, count: int) -> tuple[float, ...]:
        """Its weight on every axis."""
        return tuple(self.weight * x for x in self.axes or (1.0,) * count)


class AxesObjective(Objective):
    """A sum of terms, each over all axes."""

    TERM: ClassVar[type[Term]] = AxesTerm

    terms: tuple[AxesTerm, ...]


def _count(least: int, most: int, example: int) -> BeforeValidator:
    def read(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value <= most:
            raise ValueError(f"must be a whole number, {least} to {most}, such as {example}, got {shown(value)}")
        return int(value)

    return BeforeValidator(read)


class Search(Section):
    """How coupled axes are started: ``starts`` guesses, drawn with ``seed``, on a mesh of ``intervals``; the best is
    refined."""

    starts: Annotated[int, _count(1, 1000, 10)] = 10
    seed: Annotated[int, _count(0, 2**31, 1)] = 0
    intervals: Annotated[int, _count(4, 1000, 24)] = 24


class AxesProblem(Whole):
    """A motion of several axes to optimise. Frozen; ``problem.replace(...)`` gives a changed copy.

    ``arm``: an `ArmSection`, or in code any `trajopt.axes.dynamics.Dynamics`; ``moves`` are the axes as problems of
    their own.
    """

    move: Together
    axes: Annotated[tuple[Axis, ...], BeforeValidator(_axes)]
    arm: Arm = None
    tip: Tip | None = None
    objective: AxesObjective
    transcription: Transcription = Transcription()
    search: Search = Search()
    title: OneLine = ""
    source: OneLine = ""
    moral: OneLine = ""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        from trajopt.axes.preflight import refuse_contradictions

        refuse_contradictions(self)
        return self

    @cached_property
    def dynamics(self) -> Any:
        """The arm, or None."""
        return dynamics_of(self.arm)

    @property
    def coupled(self) -> bool:
        """Whether the axes cannot be solved one by one: an arm, or a time that is weighed against other terms."""
        timed = {term.minimize == "time" for term in self.objective.terms}
        return self.arm is not None or (self.move.shared and self.move.time != FREE and self.fixed_time is None) or (
            len(timed) > 1
        )

    @property
    def fixed_time(self) -> float | None:
        """The duration in s, or None when it is part of the answer."""
        return self.move.time if isinstance(self.move.time, float) else None

    @property
    def release(self) -> float | str | None:
        """When the tip must have its velocity: a time (s), "end", "free", or None where nothing is asked of it."""
        return None if self.tip is None or self.tip.velocity is None else self.tip.release

    @cached_property
    def moves(self) -> tuple[Problem, ...]:
        """Every axis as a problem of its own. Raises BadInput naming the axis."""
        return tuple(self._move(k) for k in range(len(self.axes)))

    def _move(self, k: int) -> Problem:
        axis, move = self.axes[k], self.move
        terms = tuple(
            Term(minimize=term.minimize, norm=term.norm, weight=share)
            for term in self.objective.terms
            if (share := term.shares(len(self.axes))[k])
        )
        try:
            start, end = self._ends(k)
            return Problem(
                move=Move(time=move.time, start=start, end=end, via=axis.move.via, dwell=move.dwell),
                objective=Objective(terms=terms or (Term(minimize="velocity", norm=norms.L2()),)),
                limits=axis.limits,
                load=axis.load if self.arm is None else axis.load.model_copy(update={"inertia": self.felt[k]}),
                transcription=self.transcription,
                title=axis.name,
                rotary=axis.rotary,
            )
        except BadInput as error:
            shared = str(error).startswith(("move.time", "objective", "transcription"))
            raise BadInput(str(error) if shared else f"axes[{k}].{error}") from None

    def _ends(self, k: int) -> tuple[State, State]:
        """The boundary states of an axis; those of a path follow from its ends."""
        move = self.axes[k].move
        if self.tip is None or self.tip.path is None:
            return move.start, move.end
        start, end = ({"position": float(pose[k])} for pose in self.along(np.linspace(0.0, 1.0, 201))[[0, -1]])
        return move.start.model_copy(update=start), move.end.model_copy(update=end)

    def along(self, s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(len(s), joints) angles that put the tip on the path at path parameters, without jumps. Raises BadInput."""
        assert self.tip is not None and (path := self.tip.path) is not None
        points = zip(*(np.broadcast_to(x, s.shape) for x in path.point(s)), strict=True)
        poses = [self.dynamics.inverse(float(x), float(y), path.elbow) for x, y in points]
        return np.unwrap(np.array(poses), axis=0)

    @cached_property
    def felt(self) -> tuple[float, ...]:
        """The inertia (kg m²) at every joint of the arm stretched out: the size of its torques."""
        count, still = len(self.axes), [np.zeros(1)] * len(self.axes)
        unit = [[np.ones(1) if i == k else np.zeros(1) for i in range(count)] for k in range(count)]
        found = (float(np.abs(self.dynamics.torque(still, still, a)[k])[0]) for k, a in enumerate(unit))
        return tuple(x if np.isfinite(x) and x > 0 else 1.0 for x in found)

    @property
    def reaches(self) -> bool:
        """Whether the arm knows where its tip is."""
        return isinstance(self.dynamics, Reaching)
