"""The problem: a move in continuous time, frozen, in SI units. Its fields are the sections of a problem file.

Nothing here knows a mesh, a model or a solver. In code, numbers are SI floats (m or rad, kg or kg m², s, N or N m, W);
in files they are texts with a unit (see `trajopt.units` and `trajopt.problem_file`).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, ClassVar, Final, Literal, Self

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer, ValidationInfo, model_validator

import norms
from trajopt import units
from trajopt.curve import Curve, read_curve
from trajopt.envelope import Envelope, read_envelope
from trajopt.fields import (
    Limit,
    Section,
    Table,
    Whole,
    nearest,
    nonnegative,
    plain,
    positive,
    read_ceiling,
    read_limit,
    read_table,
    refuse_unknown,
    si,
)
from trajopt.units import shown

DERIVATIVES: Final = ("position", "velocity", "acceleration", "jerk", "snap")
FREE: Final = "free"
MOST_INTERVALS: Final = 200_000


def _or_free(value: Any, kind: str, info: ValidationInfo) -> float:
    try:
        return si(value, kind, info)
    except ValueError as error:
        raise ValueError(f'{error}, or "free"') from None


def _state_value(kind: str) -> BeforeValidator:
    def read(value: Any, info: ValidationInfo) -> float | str | None:
        return value if value is None or value == FREE else _or_free(value, kind, info)

    return BeforeValidator(read)


class State(Section):
    """A boundary or via state: each derivative a number, ``"free"``, or None for the default.

    The default is zero for velocity, acceleration and (with a snap limit) jerk of a boundary state, and free for
    those of a via state.
    """

    position: Annotated[float | Literal["free"] | None, _state_value("position")] = None
    velocity: Annotated[float | Literal["free"] | None, _state_value("velocity")] = None
    acceleration: Annotated[float | Literal["free"] | None, _state_value("acceleration")] = None
    jerk: Annotated[float | Literal["free"] | None, _state_value("jerk")] = None

    def fixed(self, order: int, default: float | None = 0.0) -> dict[int, float]:
        """The prescribed derivatives below ``order``: number of the derivative -> SI value."""
        given = (getattr(self, name) for name in DERIVATIVES[:order])
        values = (default if x is None else x for x in given)
        return {i: float(x) for i, x in enumerate(values) if x is not None and x != FREE}


class Via(State):
    """A state to pass through at ``time`` (s); what is not given is free.

    Raises ValueError when everything is free.
    """

    time: Annotated[float, positive("time")]

    @model_validator(mode="after")
    def _some(self) -> Self:
        if not self.fixed(len(DERIVATIVES) - 1, None):
            raise ValueError('gives no state to pass through; write for example position = "0.1 m"')
        return self


def read_time(value: Any, info: ValidationInfo) -> Any:
    """A duration: one time, a pair [min, max] or "free"."""
    if value == FREE:
        return FREE
    if isinstance(value, list | tuple):
        if len(value) != 2:
            raise ValueError(f'needs one time such as "1 s", a pair [min, max] or "free", got {len(value)} values')
        shortest, longest = (si(t, "time", info) for t in value)
        if not 0 < shortest < longest:
            raise ValueError(f"needs 0 < min < max, got min {shown(value[0])} and max {shown(value[1])}")
        return (shortest, longest)
    number = _or_free(value, "time", info)
    if number <= 0:
        raise ValueError(f'must be > 0, got {shown(value)}; write "free" to have it optimised')
    return number


class Move(Section):
    """From where to where, in which time: fixed (s), within a pair [min, max] (s), or free; and for how long the axis
    rests before the next cycle (``dwell``, s), which the RMS of the force takes into account."""

    time: Annotated[float | tuple[float, float] | Literal["free"], BeforeValidator(read_time)]
    start: State = State(position=0.0)
    end: State
    via: tuple[Via, ...] = ()
    dwell: Annotated[float, nonnegative("time")] = 0.0

    @model_validator(mode="after")
    def _positions(self) -> Self:
        if self.end.position is None:
            raise ValueError('end.position: is missing; write for example "0.25 m", or "free"')
        return self

    @property
    def fixed_time(self) -> float | None:
        """The duration in s, or None when it is part of the answer."""
        return self.time if isinstance(self.time, float) else None

    @property
    def start_position(self) -> float | None:
        """The start position in m or rad (0 by default), or None when free."""
        position = self.start.position
        return None if position == FREE else float(position or 0.0)


class Limits(Section):
    """Limits on the signals of the axis; a key left out is no limit. Force is N, or N m (torque) for a rotary axis.

    ``envelope``: the motor's force over speed; ``rms_force``: of the force over the cycle, sqrt(∫F²dt/(T + dwell));
    ``brake_energy``: fed back by the motor in a move, ∫max(0, -P)dt, J.
    """

    position: Annotated[Limit | None, read_limit("position")] = None
    velocity: Annotated[Limit | None, read_limit("velocity")] = None
    acceleration: Annotated[Limit | None, read_limit("acceleration")] = None
    jerk: Annotated[Limit | None, read_limit("jerk")] = None
    snap: Annotated[Limit | None, read_limit("snap")] = None
    force: Annotated[Limit | None, read_limit("force")] = None
    power: Annotated[Limit | None, read_limit("power")] = None
    current: Annotated[Limit | None, read_limit("current")] = None
    voltage: Annotated[Limit | None, read_limit("voltage")] = None
    envelope: Annotated[Envelope | None, BeforeValidator(read_envelope)] = None
    rms_force: Annotated[Limit | None, read_ceiling("rms_force")] = None
    brake_energy: Annotated[Limit | None, read_ceiling("brake_energy")] = None

    @cached_property
    def given(self) -> Mapping[str, Limit]:
        """The limits there are, by name; of the envelope what holds each of its lines."""
        found = {name: limit for name in type(self).model_fields if (limit := getattr(self, name)) is not None}
        return {name: limit.limit if isinstance(limit, Envelope) else limit for name, limit in found.items()}


def _inertia(value: Any, info: ValidationInfo) -> Any:
    if value is None:
        return value
    if isinstance(value, Mapping) and {"position", "csv"} & value.keys():
        value = read_curve(value, "inertia", info)
    elif isinstance(value, Mapping):
        refuse_unknown(value, ("time", "value"))
        value = read_table(dict(value), "inertia", "value", info)
    if isinstance(value, Curve):
        return _positive_everywhere(value)
    number = min(value.value) if isinstance(value, Table) else si(value, "inertia", info)
    if not number > 0:
        raise ValueError(f"must be > 0, got {shown(value)}")
    return value if isinstance(value, Table) else number


def _positive_everywhere(curve: Curve) -> Curve:
    if (least := min(curve.value)) <= 0:
        at = curve.position[curve.value.index(least)]
        raise ValueError(f"must be > 0 everywhere, got {least:.6g} at position {at:.6g}")
    if (least := curve.lowest) <= 0:
        raise ValueError(f"must be > 0 everywhere, but falls to {least:.3g} between its rows; export a finer table")
    return curve


def _load_force(value: Any, info: ValidationInfo) -> Any:
    if value is None or isinstance(value, Curve):
        return value
    if not isinstance(value, Mapping):
        raise ValueError(f'must be a table over position such as {{ csv = "load.csv" }}, got {shown(value)}')
    return read_curve(value, "force", info)


class Load(Section):
    """What is moved: force = inertia·a + viscous·v + coulomb·sign(v) (Clemen & Rupp eq. 13 to 15), and by which motor.

    ``inertia`` is a mass (kg) on a linear axis, a moment of inertia (kg m²) on a rotary one, a Table over time
    (Remark 1), or a Curve over position, which adds ½ J'(q) v² (Van Oosterwyck et al. eq. 1). ``force``: the load's own
    over position, N or N m, such as that of gravity. ``coulomb`` N or N m; ``viscous`` N s/m or N m s. For the motor
    see `trajopt.motor`: ``torque_constant`` N/A or N m/A, ``resistance`` Ω, ``switching`` W/A, ``eddy`` W per (A m/s)²
    or (A rad/s)², ``hysteresis`` W per m/s or rad/s at 1 A, and its exponent; ``recovery``: which share of the power it
    feeds back can be used.
    """

    inertia: Annotated[float | Table | Curve | None, BeforeValidator(_inertia)] = None
    force: Annotated[Curve | None, BeforeValidator(_load_force)] = None
    coulomb: Annotated[float, nonnegative("force")] = 0.0
    viscous: Annotated[float, nonnegative("viscous")] = 0.0
    torque_constant: Annotated[float | None, positive("torque_constant")] = None
    resistance: Annotated[float | None, positive("resistance")] = None
    switching: Annotated[float, nonnegative("switching")] = 0.0
    eddy: Annotated[float, nonnegative("eddy")] = 0.0
    hysteresis: Annotated[float, nonnegative("hysteresis")] = 0.0
    hysteresis_exponent: Annotated[float, plain(above=1.0, most=2.0, example="1.6")] = 2.0
    recovery: Annotated[float, plain(least=0.0, most=1.0, example="0.7")] = 0.0

    @property
    def motor(self) -> tuple[float, float] | None:
        """Torque constant and resistance, or None where there is no motor."""
        if self.torque_constant is None or self.resistance is None:
            return None
        return self.torque_constant, self.resistance

    @property
    def curves(self) -> dict[str, Curve]:
        """What is a curve over position, by name."""
        return {name: x for name in ("inertia", "force") if isinstance(x := getattr(self, name), Curve)}


MOTOR: Final = (
    "torque_constant", "resistance", "switching", "eddy", "hysteresis", "hysteresis_exponent", "recovery",
)  # fmt: skip
MINIMIZABLE: Final = (
    "position", "velocity", "acceleration", "jerk", "snap", "force", "power", "current", "voltage", "energy",
    "copper_loss", "electrical_energy", "time",
)  # fmt: skip
WITHOUT_NORM: Final = ("energy", "copper_loss", "electrical_energy", "time")
LOADED: Final = ("force", "power", "energy", "envelope", "rms_force")  # what needs an inertia ...
TOTALS: Final = ("rms_force", "brake_energy")  # of the whole move, not of an instant
ELECTRICAL: Final = ("current", "voltage", "copper_loss", "electrical_energy", "brake_energy")  # ... and a motor, too


def _norm(value: Any) -> norms.Norm | None:
    if value is None or isinstance(value, norms.Norm):
        return value
    if not isinstance(value, str) or value not in norms.names():
        raise ValueError(f"unknown norm {shown(value)}; one of {', '.join(norms.names())}")
    return norms.get(value)


def _weight(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
        raise ValueError(f"must be a plain number > 0 such as 0.5, no text and no unit, got {shown(value)}")
    if not 1 / units.LARGEST <= value <= units.LARGEST:
        raise ValueError(f"must be > 0 and finite (1e-30 to 1e30), got {shown(value)}; leave a zero term out")
    return float(value)


def _intervals(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise ValueError(f"must be a whole number, 4 to {MOST_INTERVALS}, such as 200, got {shown(value)}")
    if value < 4:
        raise ValueError(f"must be 4 to {MOST_INTERVALS}, got {shown(value)}; 200 is usual")
    if value > MOST_INTERVALS:
        memory = f" (about {15e-6 * value:.2g} GB of memory)" if value < 1e9 else ""
        raise ValueError(f"must be 4 to {MOST_INTERVALS}, got {shown(value)}{memory}; 200 is usual")
    return int(value)


def _touches(value: Any) -> int | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 0 <= value <= 100:
        raise ValueError(f"must be a whole number, 0 to 100, such as 2, got {shown(value)}")
    return int(value)


def refuse_wrong_norm(key: str, name: str, norm: norms.Norm | None) -> None:
    """Raise ValueError for what cannot be measured, or not by this norm; ``key`` is what the field is called."""
    if name not in MINIMIZABLE:
        hint = nearest(name, MINIMIZABLE).partition("; known")[0]
        raise ValueError(f"{key}: unknown {shown(name)}; one of {', '.join(MINIMIZABLE)}{hint}")
    if name in WITHOUT_NORM and norm is not None:
        raise ValueError(f"norm: {name} takes no norm; leave it out")
    if name not in WITHOUT_NORM and norm is None:
        raise ValueError(f"norm: is missing; {name} needs one of {', '.join(norms.names())}")


NamedNorm = Annotated[norms.Norm | None, BeforeValidator(_norm), PlainSerializer(lambda n: n and n.name)]


class Term(Section):
    """One objective term: ``weight`` times a norm of a signal over the move, or energy ∫|P|dt, copper loss or
    electrical energy (J, see `trajopt.motor`), or time (s)."""

    minimize: Annotated[str, BeforeValidator(lambda name: "force" if name == "torque" else name)]
    norm: NamedNorm = None
    weight: Annotated[float, BeforeValidator(_weight)] = 1.0

    @model_validator(mode="after")
    def _norm_fits(self) -> Self:
        refuse_wrong_norm("minimize", self.minimize, self.norm)
        return self

    @property
    def label(self) -> str:
        """For people: ``jerk l2``, ``energy``."""
        return self.minimize if self.norm is None else f"{self.minimize} {self.norm.name}"

    @property
    def kind(self) -> str | None:
        """What its value measures, a key of `trajopt.units.kinds`; None where that has no name of its own."""
        if self.norm is None or self.norm.name in ("l2", "linf"):
            return self.minimize
        return _INTEGRALS.get(self.minimize) if self.norm.name == "l1" else None


_INTEGRALS: Final = {
    "velocity": "position", "acceleration": "velocity", "jerk": "acceleration", "snap": "jerk", "power": "energy",
}  # fmt: skip


def _ceiling(value: Any, info: ValidationInfo) -> float:
    of, norm = info.data.get("of"), info.data.get("norm")
    if of not in MINIMIZABLE or (norm is None) != (of in WITHOUT_NORM):
        return 1.0  # refused below, in better words
    kind = Term(minimize=of, norm=norm).kind
    if kind is None and isinstance(value, str):
        raise ValueError(f"the {getattr(norm, 'name', '')} norm of {of} has no unit in files; take linf or l2")
    bound = si(value, kind or of, info)
    if bound <= 0:
        raise ValueError(f"must be > 0, got {shown(value)}")
    return bound


class Ceiling(Section):
    """What another term may come to at most, SI: ``of`` and ``norm`` name it as in a Term (epsilon-constraint)."""

    of: str
    norm: NamedNorm = None
    at_most: Annotated[float, BeforeValidator(_ceiling)]

    @model_validator(mode="after")
    def _norm_fits(self) -> Self:
        refuse_wrong_norm("of", self.of, self.norm)
        if self.of == "time":
            raise ValueError('of: time is limited by a range, such as move.time = ["0.1 s", "1 s"]')
        return self

    @property
    def term(self) -> Term:
        """The term that is held."""
        return Term(minimize=self.of, norm=self.norm)


class Objective(Section):
    """A weighted sum of terms (Clemen & Rupp eq. 26); weights multiply SI values. ``ceilings`` hold further terms."""

    TERM: ClassVar[type[Term]] = Term

    terms: tuple[Term, ...]
    ceilings: tuple[Ceiling, ...] | None = None

    @property
    def all_terms(self) -> tuple[Term, ...]:
        """What is minimised and what is held."""
        return (*self.terms, *(ceiling.term for ceiling in self.ceilings or ()))

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, data: Any) -> Any:
        known = cls.TERM.model_fields
        if isinstance(data, Mapping) and any(key in data for key in known):
            if "terms" in data:
                raise ValueError("give either minimize, norm and weight, or terms, not both")
            return {
                "terms": ({k: v for k, v in data.items() if k in known},),
                **{k: v for k, v in data.items() if k not in known},
            }
        return data

    @model_validator(mode="after")
    def _some(self) -> Self:
        if not self.terms:
            raise ValueError('terms: is empty; write for example terms = [{ minimize = "jerk", norm = "l2" }]')
        return self


def _frequency(value: Any, info: ValidationInfo) -> Any:
    pair = value if isinstance(value, list | tuple) else [value]
    if len(pair) not in (1, 2):
        raise ValueError(f'needs one frequency such as "8 Hz" or a band [min, max], got {len(pair)} values')
    found = [si(x, "frequency", info) for x in pair]
    if found[0] <= 0 or found[-1] < found[0] or (len(found) == 2 and found[0] == found[1]):
        raise ValueError(f"must be > 0, and a band needs min < max, got {shown(value)}")
    return found[0] if len(found) == 1 else (found[0], found[1])


def _damping(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
        raise ValueError(f"must be a plain damping ratio such as 0.02, got {shown(value)}")
    if not 0 <= value < 1:
        raise ValueError(f"must be 0 or more and below 1 (a ratio, not per cent), got {shown(value)}")
    return float(value)


class Vibration(Section):
    """A mode that hangs on the axis and must be quiet after the move (see `trajopt.vibration`).

    ``frequency`` Hz, one or a band (min, max); ``damping`` ratio; ``residual``: the amplitude it may keep, m or rad,
    zero by default; ``robust``: the derivative of the residual by the frequency is held, too (ZVD).
    """

    frequency: Annotated[float | tuple[float, float], BeforeValidator(_frequency)]
    damping: Annotated[float, BeforeValidator(_damping)] = 0.0
    residual: Annotated[float, nonnegative("position")] = 0.0
    robust: Annotated[bool, Field(strict=True)] = False

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if isinstance(self.frequency, tuple) and not self.residual:
            raise ValueError('residual: no move leaves a whole band at zero; write for example residual = "1 um"')
        return self


class Transcription(Section):
    """How the problem is to be discretised and by whom solved.

    ``min_dwell`` (s) and ``touches`` cut off the chattering of a snap-limited minimum time: the least time between two
    switches, or how often the velocity limit is touched at each end. ``tighten``: spend more on the bound of power and
    energy (see `trajopt.tighten`).
    """

    intervals: Annotated[int, BeforeValidator(_intervals)] = 200
    scheme: Literal["exact", "euler"] = "exact"
    solver: Literal["auto", "piqp", "clarabel", "osqp", "ipopt"] = "auto"
    min_dwell: Annotated[float, nonnegative("time")] = 0.0
    touches: Annotated[int | None, BeforeValidator(_touches)] = None
    tighten: Annotated[bool, Field(strict=True)] = False


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError(f"must be one line of printable text, got {shown(text)}")
    return text


OneLine = Annotated[str, AfterValidator(_printable)]


def _within(limit: Limit | None, span: tuple[float, float]) -> Limit:
    """A position limit that also keeps within a span."""

    def side(bound: float | Table | None, otherwise: float) -> float | Table:
        if isinstance(bound, Table):
            return bound.model_copy(update={"value": tuple(np.clip(bound.value, *span).tolist())})
        return otherwise if bound is None else float(np.clip(bound, *span))

    limit = limit or Limit()
    return Limit(min=side(limit.min, span[0]), max=side(limit.max, span[1]))


class Problem(Whole):
    """A move to optimise. Frozen; ``problem.replace(...)`` gives a changed copy.

    A load over position keeps the position within its table, as a limit.
    """

    move: Move
    objective: Objective
    limits: Limits = Limits()
    load: Load = Load()
    vibration: tuple[Vibration, ...] = ()
    transcription: Transcription = Transcription()
    title: OneLine = ""
    source: OneLine = ""
    moral: OneLine = ""
    rotary: Annotated[bool, Field(strict=True)] = False

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        from trajopt.preflight import refuse_contradictions

        states = (self.move.start, self.move.end, *self.move.via)
        places = [self.move.start_position, *(state.position for state in states)]
        for curve in self.load.curves.values():  # beyond its table the load is unknown
            span = curve.around([x for x in places if isinstance(x, float)])
            limits = self.limits.model_copy(update={"position": _within(self.limits.position, span)})
            self.__dict__["limits"] = limits
        refuse_contradictions(self)
        return self

    @cached_property
    def order(self) -> int:
        """Which derivative is the top one, piecewise constant: 4 (snap) when snap or a boundary jerk is mentioned,
        3 (jerk) when jerk or a boundary acceleration is, else 2; the Euler scheme always carries jerk (eq. 4)."""
        mentioned = {*self.limits.given, *(term.minimize for term in self.objective.all_terms)}
        states = (self.move.start, self.move.end, *self.move.via)
        if "snap" in mentioned or any(state.jerk is not None for state in states):
            return 4
        if "jerk" in mentioned or self.transcription.scheme == "euler":
            return 3
        return 3 if any(state.acceleration is not None for state in states) else 2

    @cached_property
    def one_way(self) -> int:
        """+1 or -1 when the velocity limits allow one direction only, else 0."""
        velocity = self.limits.velocity
        if velocity is None:
            return 0
        return 1 if velocity.lowest >= 0 else -1 if velocity.highest <= 0 else 0

    @cached_property
    def prescribed(self) -> tuple[tuple[float, int, float], ...]:
        """(fraction of the duration, derivative, value) of every boundary and via condition; positions as displacement
        from the start, or absolute where the start is free."""
        from trajopt.preflight import at_time

        move, duration = self.move, self.move.fixed_time
        states: list[tuple[float, State, float | None]] = [(0.0, move.start, 0.0), (1.0, move.end, 0.0)]
        states += [(via.time / (duration or 1.0), via, None) for via in move.via]
        conditions = []
        for fraction, state, default in states:
            for i, value in state.fixed(self.order, default).items():
                shift = (move.start_position or 0.0) if i == 0 and state.position is not None else 0.0
                limit = getattr(self.limits, DERIVATIVES[i])
                if limit is not None:  # by a rounding outside: farther ones have been refused
                    low, high = at_time(limit, fraction * (duration or 0.0))
                    value = min(max(value, low), high)
                conditions.append((fraction, i, value - shift))
        if not any(i == 0 for _, i, _ in conditions) and self.limits.position is None:
            conditions.append((0.0, 0, 0.0))  # the move may be anywhere: let it start at zero
        return tuple(conditions)

    @property
    def can_wait(self) -> bool:
        """Whether the axis may stand still at one end, so that more time never hurts; both positions are given."""
        move, velocity = self.move, self.limits.velocity
        if FREE in (move.start.position, move.end.position):
            return False
        may_rest = velocity is None or velocity.lowest <= 0 <= velocity.highest
        states = [state.fixed(self.order) for state in (move.start, move.end)]
        return may_rest and any(all(state.get(i) == 0.0 for i in range(1, self.order)) for state in states)

    def shown(self, name: str) -> str:
        """The name of a quantity or limit as people of this axis say it: torque on a rotary one."""
        return name.replace("force", "torque") if self.rotary else name

    def with_limit(self, name: str, value: float) -> Problem:
        """A copy with one limit (``jerk``, plus-minus) or one side of it (``velocity.max``) set to a value, SI."""
        quantity, _, side = name.partition(".")
        limit: Limit | Envelope = getattr(self.limits, quantity)
        if isinstance(limit, Envelope):
            return self.replace(limits=self.limits.model_copy(update={quantity: limit.scaled(value / limit.force[0])}))
        sides = {"min": -value, "max": value} if not side else {"min": limit.min, "max": limit.max, side: value}
        return self.replace(limits=self.limits.model_copy(update={quantity: Limit(**sides)}))
