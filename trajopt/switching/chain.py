"""A chain of integrators, what a minimum-time answer for it looks like, and how it can fail."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate
from math import fsum, inf, isfinite
from typing import Final

from trajopt.errors import TrajoptError

NAMES: Final = ("position", "velocity", "acceleration", "jerk", "snap")

State = tuple[float, ...]
Limits = tuple[tuple[float, float], ...]


class Impossible(TrajoptError):
    """No move keeps the limits: the message says why."""


class Unresolved(TrajoptError):
    """No list of arcs could be verified; a move may exist all the same."""


@dataclass(frozen=True)
class Chain:
    """x_n = d^n x / dt^n is free within its limits; every lower derivative is continuous.

    ``limits``: order + 1 pairs (least, greatest) for derivatives 0 (position) to n, infinite where there is none; the
    top pair is finite and holds zero, inside unless the order is one. ``start``, ``end``: n values each, from the
    position up; any coherent unit. Raises ValueError for numbers that cannot be meant.
    """

    order: int
    limits: Limits
    start: State
    end: State

    def __post_init__(self) -> None:
        object.__setattr__(self, "limits", tuple((float(low), float(high)) for low, high in self.limits))
        for name in ("start", "end"):
            object.__setattr__(self, name, tuple(map(float, getattr(self, name))))
        if not 1 <= self.order <= 4:
            raise ValueError(f"order must be 1 to 4, not {self.order}")
        if len(self.limits) != self.order + 1 or len(self.start) != self.order or len(self.end) != self.order:
            raise ValueError(f"order {self.order} needs {self.order + 1} limits and {self.order} values at each end")
        if any(not low < high for low, high in self.limits):
            raise ValueError("every least value must lie below its greatest")
        low, high = self.limits[-1]
        if not (-inf < low <= 0 <= high < inf) or (self.order > 1 and not low < 0 < high):
            raise ValueError(f"the {NAMES[self.order]} limits must be finite and of both signs")
        if not all(map(isfinite, self.start + self.end)):
            raise ValueError("boundary values must be finite")

    @property
    def distance(self) -> float:
        return self.end[0] - self.start[0]

    @property
    def top(self) -> tuple[float, float]:
        return self.limits[-1]

    @property
    def at_rest(self) -> bool:
        """Whether every derivative is zero at both ends."""
        return not any(self.start[1:] + self.end[1:])

    def mirrored(self) -> Chain:
        """Every sign turned."""
        limits = tuple((0.0 - high, 0.0 - low) for low, high in self.limits)
        return Chain(self.order, limits, tuple(-x for x in self.start), tuple(-x for x in self.end))

    def reversed(self) -> Chain:
        """Time running backwards: odd derivatives turn sign, the ends change places."""
        limits = tuple((-high, -low) if i % 2 else (low, high) for i, (low, high) in enumerate(self.limits))
        back = [tuple(-x if i % 2 else x for i, x in enumerate(end)) for end in (self.end, self.start)]
        return Chain(self.order, limits, *back)

    def scaled(self, length: float, time: float) -> Chain:
        """In units of ``length`` and ``time``, with the position counted from the start."""
        units = [length / time**i for i in range(self.order + 1)]
        origin = self.start[0]
        low, high = self.limits[0]
        limits = ((low - origin, high - origin), *self.limits[1:])
        ends = [((end[0] - origin), *end[1:]) for end in (self.start, self.end)]
        return Chain(
            self.order,
            tuple((a / u, b / u) for (a, b), u in zip(limits, units, strict=True)),
            *(tuple(x / u for x, u in zip(end, units[:-1], strict=True)) for end in ends),
        )


@dataclass(frozen=True)
class Arcs:
    """A verified minimum-time answer.

    ``durations``, ``tops``: (K,) the arcs and the constant top derivative on each. ``active``: (K,) the limit on which
    each arc runs, such as ``jerk.max``. ``touches``: (time, limit) where a limit is met at an instant. ``lowest``: a
    lower bound on the least duration, or minus infinity. ``residual``, ``excess``: relative, as verified.
    ``ordinary``: for fourth-order moves between rests, the duration of the S-curve, the same ramps nested without
    chattering or asymmetric peaks; None elsewhere. ``chatters``: whether the least duration needs switches without end.
    ``gap``: where the structure was read from a coarse program, the duration by which the multipliers leave the end
    short of the farthest that any move of this duration reaches: zero proves that no move just shorter exists.
    """

    durations: tuple[float, ...]
    tops: tuple[float, ...]
    active: tuple[str, ...]
    touches: tuple[tuple[float, str], ...]
    lowest: float
    residual: float
    excess: float
    ordinary: float | None = None
    chatters: bool = False
    gap: float | None = None

    @property
    def duration(self) -> float:
        return fsum(self.durations)

    @property
    def bracket(self) -> tuple[float, float]:
        """(lowest, duration): between them lies the least duration."""
        return self.lowest, self.duration

    @property
    def loss(self) -> float:
        """Relative: how much longer than the lower bound."""
        return self.duration / self.lowest - 1 if self.lowest > 0 else (0.0 if not self.duration else inf)

    @property
    def switches(self) -> tuple[float, ...]:
        """(K-1,) borders between the arcs."""
        return tuple(accumulate(self.durations[:-1]))

    @property
    def least_dwell(self) -> float:
        """The shortest arc."""
        return min(self.durations, default=0.0)


def back_in_time(arcs: Arcs, units: tuple[float, ...], time: float) -> Arcs:
    """Scaled arcs in the chain's own units; ``units``: of every derivative."""
    durations = tuple(d * time for d in arcs.durations)
    return replace(
        arcs,
        durations=durations,
        tops=tuple(u * units[-1] for u in arcs.tops),
        touches=tuple((t * time, name) for t, name in arcs.touches),
        lowest=min(arcs.lowest * time, fsum(durations)),  # never above by rounding
        ordinary=None if arcs.ordinary is None else arcs.ordinary * time,
        gap=None if arcs.gap is None else arcs.gap * time,
    )
