"""A result with a solution, as both twins see it, and the checks of it that need no arithmetic worth two twins."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from trajopt.checker.report import Check, question, to_float

if TYPE_CHECKING:
    from trajopt.checker.splines import Spline

DERIVATIVES: Final = ("position", "velocity", "acceleration", "jerk", "snap")
LOADED: Final = ("force", "power")
ELECTRICAL: Final = ("current", "voltage")
POWERS: Final = {"energy": "power", "copper_loss": "copper power", "electrical_energy": "electrical power"}
TOTALS: Final = ("rms_force", "brake_energy")  # limited over the whole move
SPLITS: Final = 40  # halvings of one interval in search of a change of sign
VALUE: Final = 1e-6  # of an objective, a metric or a gap
BAND: Final = 41  # frequencies at which a band of them is looked at
EPS: Final = float(np.finfo(float).eps)

_TIME: Final = 1e-12
_BOUND: Final = 1e-9
_TINY: Final = 1e-300
_AT_REST: Final = 1e-9  # of the peak velocity; below it the sign of a velocity, hence of friction, is rounding

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """A number, or a table that is linear between its times (s) and constant outside."""

    time: tuple[float, ...]
    value: tuple[float, ...]

    def at(self, t: Array) -> Array:
        return np.interp(t, self.time, self.value)

    def among(self, instants: list[float]) -> list[float]:
        """The values it has at some instants (s); of a number one."""
        found: list[float] = self.at(np.array(instants)).tolist() if len(self.value) > 1 else [self.value[0]]
        return found

    def exactly(self, t: Fraction) -> Fraction:
        k = bisect_right(self.time, t)
        if k == 0 or k == len(self.time):
            return Fraction(self.value[min(k, len(self.value) - 1)])
        left, right = Fraction(self.time[k - 1]), Fraction(self.time[k])
        low, high = Fraction(self.value[k - 1]), Fraction(self.value[k])
        return _dyadic(low + (high - low) * (t - left) / (right - left))


@dataclass(frozen=True)
class Via:
    time: float
    fixed: dict[int, float]


@dataclass(frozen=True)
class Mode:
    """``frequency`` Hz: one, or both ends of a band; ``damping`` ratio; ``residual`` amplitude allowed, m or rad."""

    frequency: tuple[float, ...]
    damping: float
    residual: float
    robust: bool

    @property
    def points(self) -> list[float]:
        """The frequencies to look at."""
        found: list[float] = np.linspace(self.frequency[0], self.frequency[-1], BAND).tolist()
        return found if len(self.frequency) > 1 else list(self.frequency)


@dataclass(frozen=True)
class Motor:
    """What turns force into current (``constant``), losses, and which share of what it feeds back counts."""

    constant: float
    resistance: float
    switching: float
    eddy: float
    hysteresis: float
    exponent: float
    recovery: float


@dataclass(frozen=True)
class Case:
    """A result with a solution. ``signal[i]`` is the i-th derivative: (N+1,) at nodes, the top one (N,)."""

    scheme: str
    order: int
    time: Array
    signal: tuple[Array, ...]
    start: dict[int, float]
    end: dict[int, float]
    via: tuple[Via, ...]
    limits: dict[str, tuple[Curve | None, Curve | None]]
    inertia: Curve | Spline | None  # over time, or over position
    force: Spline | None  # of the load itself, over position
    coulomb: float
    viscous: float
    motor: Motor | None
    mixes: dict[str, tuple[Fraction, Fraction]]  # what is a·force + b·velocity: (a, b)
    dwell: float
    terms: tuple[tuple[str, str | None, float], ...]
    move_time: float | tuple[float, float] | None
    intervals: int
    objective: float
    duration: float
    metrics: dict[str, float]
    lower_bound: float | None
    gap: float | None
    has_certificate: bool
    vibration: tuple[Mode, ...] = ()
    rotary: bool = False
    ceilings: tuple[tuple[str, str | None, float], ...] = ()

    @property
    def count(self) -> int:
        """N, the number of intervals."""
        return len(self.time) - 1

    @property
    def end_time(self) -> float:
        return float(self.time[-1])

    @property
    def largest_position(self) -> float:
        return float(np.max(np.abs(self.signal[0])))

    @cached_property
    def size(self) -> tuple[float, ...]:
        """How large each derivative below ``order`` is: its peak at the nodes; for position the largest excursion.

        A derivative that hardly matters for the one below it (coasting) counts as a thousandth of what would.
        """
        found = [float(np.max(np.abs(self.signal[0] - self.signal[0][0])))]
        for values in self.signal[1 : self.order]:
            found.append(max(float(np.max(np.abs(values))), 1e-3 * found[-1] / self.end_time))
        return tuple(found)

    @cached_property
    def rest(self) -> float:
        """The speed in m/s up to which the axis may count as standing still."""
        return _AT_REST * float(np.max(np.abs(self.signal[1])))

    @cached_property
    def corners(self) -> tuple[float, ...]:
        """Times inside the move at which a limit or the inertia has a corner."""
        curves = [side for limit in self.limits.values() for side in limit] + [self.inertia]
        times = {t for curve in curves if isinstance(curve, Curve) and len(curve.time) > 1 for t in curve.time}
        return tuple(sorted(t for t in times if 0 < t < self.end_time))

    def nearest(self, t: float) -> int:
        """The node nearest to ``t`` (s)."""
        return int(np.argmin(np.abs(self.time - t)))

    def conventions(self, *quantities: str) -> range:
        """By number, the conventions on friction at rest under which to recompute quantities at the nodes.

        At rest friction is not determined: its sign may be 0, +1, -1, or whatever rounding left of the velocity's. A
        claim that fits one of these is right.
        """
        return range(4 if self.coulomb and any(self.feels_friction_at_rest(name) for name in quantities) else 1)

    def feels_friction_at_rest(self, name: str) -> bool:
        """Whether a quantity is other than zero where the axis stands still and friction holds it."""
        return name in self.mixes or POWERS.get(name, name) in ("copper power", "electrical power")

    def is_loaded(self, name: str) -> bool:
        """Whether a quantity is made of force."""
        return name in self.mixes or name in POWERS.values()

    @property
    def splines(self) -> list[Spline]:
        """What the load has over position."""
        return [x for x in (self.inertia, self.force) if x is not None and not isinstance(x, Curve)]

    @property
    def turns(self) -> bool:
        """Whether anything has a corner where the velocity changes its sign."""
        return bool(self.coulomb or (self.motor is not None and self.motor.hysteresis))

    def depends_on_top(self, name: str) -> bool:
        return (2 if self.is_loaded(name) else DERIVATIVES.index(name)) == self.order


def time_checks(case: Case) -> list[Check]:
    end, wanted = case.end_time, case.move_time
    shortest, longest = wanted if isinstance(wanted, tuple) else (wanted, wanted)
    off = abs(case.duration - end)
    checks = [Check("duration", off, _TIME * end, end, off <= _TIME * end)]
    if shortest is not None and longest is not None:
        off = max(shortest - case.duration, case.duration - longest, 0.0)
        checks.append(Check("move time", off, _TIME * longest, end, off <= _TIME * longest))
    return [*checks, question("mesh", _mesh_fault(case))]


def _mesh_fault(case: Case) -> str:
    if case.scheme == "euler":
        if case.count != case.intervals:
            return f"{case.count} intervals where the problem asks for {case.intervals}"
        even = np.arange(case.count + 1) * (case.end_time / case.count)
        if np.max(np.abs(case.time - even)) > _TIME * case.end_time:
            return "the Euler scheme needs equal steps"
        needed = [via.time for via in case.via]
    else:
        needed = sorted({*case.corners, *(via.time for via in case.via)})
        if case.count < case.intervals:
            return f"{case.count} intervals where the problem asks for {case.intervals} or more"
    for t in needed:
        if abs(case.time[case.nearest(t)] - t) > (_TIME if case.scheme == "exact" else 1e3 * _TIME) * case.end_time:
            return f"no node at t = {t!r} s, where a via state or the corner of a table lies"
    return ""


def certificate_checks(case: Case, notes: list[str]) -> list[Check]:
    if not case.has_certificate:
        return []
    if case.lower_bound is None:
        notes.append("certificate (it has no lower bound)")
        return []
    value, bound = case.objective, case.lower_bound
    over, tolerance = max(bound - value, 0.0), _BOUND * abs(value) + _TINY
    note = "bound above the answer" if over > tolerance else ""
    checks = [Check("certificate bound", over, tolerance, None, over <= tolerance, note)]
    if case.gap is not None and abs(value) > _TINY:
        gap = (value - bound) / abs(value)
        off, tolerance = abs(case.gap - gap), VALUE * abs(gap) + _BOUND
        passed = off <= tolerance < math.inf
        checks.append(Check("certificate gap", to_float(off), to_float(tolerance), None, passed))
    return checks


def _dyadic(x: Fraction) -> Fraction:
    """``x`` to 300 digits of base two: keeps denominators of interpolated tables from multiplying up."""
    if x.denominator & (x.denominator - 1) == 0:
        return x
    shift = max(300 + x.denominator.bit_length() - x.numerator.bit_length(), 0)
    return Fraction((x.numerator << shift) // x.denominator, 1 << shift)
