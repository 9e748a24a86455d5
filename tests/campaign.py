"""Random problems and a judge who knows nothing of the optimiser: what `tests.soak` runs by the thousand.

A `Spec` is a problem in units of its own (a length, a time and a mass, all near one), made from an integer alone;
`Spec.problem` builds it in SI units, which may be nanometres or thousands of kilometres. `judge` solves it and holds
the answer against the checker, closed forms, the `ruckig` package, a linear program of its own (HiGHS, through scipy),
and what must hold of any two related problems: other units, mirrored, run backwards, looser limits, more time.

It solves in its own process: what runs it by the thousand ends a worker that dies or hangs. Explaining an impossible
move takes several times as long as finding it so: `judge` may be told to leave that out, and with it the two solves
that try a cure and a little less of it. A verdict needs no explanation, and the other guises of a spec get none.
"""

from __future__ import annotations

import json
import math
import random
import traceback
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from math import comb, factorial
from time import perf_counter
from typing import Any, Final
from unittest.mock import patch

import numpy as np
from scipy.optimize import linprog

import trajopt
from trajopt import checker, conclude, solving
from trajopt.attempt import Clock
from trajopt.outer import is_impossible
from trajopt.transcribe import Setting

DERIVATIVES: Final = ("position", "velocity", "acceleration", "jerk", "snap")
FREE: Final = "free"
EDGE: Final = 1e-6  # relative: closer to the edge of the possible than this, no verdict is owed
SECONDS: Final = 120.0  # a case may take
_NORMS: Final = ("l1", "l2", "linf")
_SAME: Final = 1e-9  # relative: how far objectives of one problem in two guises may differ


# The specification ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Spec:
    """A problem in its own units. ``start`` and ``end`` hold numbers or "free" by derivative; ``limits`` a pair by
    quantity (None: no limit), or a table over time; ``terms`` lists (quantity, norm, weight); ``ulps`` moves a boundary
    value by so many units in the last place, e.g. ``{"start.velocity": 1}``. ``length``, ``time`` and ``mass`` are the
    units in m, s and kg."""

    seed: int = 0
    duration: Any = 1.0
    start: dict[str, Any] = field(default_factory=dict)
    end: dict[str, Any] = field(default_factory=lambda: {"position": 1.0})
    limits: dict[str, Any] = field(default_factory=dict)
    load: dict[str, float] = field(default_factory=dict)
    terms: list[Any] = field(default_factory=lambda: [["jerk", "l2", 1.0]])
    intervals: int = 40
    scheme: str = "exact"
    ulps: dict[str, int] = field(default_factory=dict)
    via: list[dict[str, Any]] = field(default_factory=list)
    length: float = 1.0
    time: float = 1.0
    mass: float = 1.0

    def unit(self, quantity: str) -> float:
        """The unit of a quantity in SI."""
        if quantity in DERIVATIVES:
            return self.length / self.time ** DERIVATIVES.index(quantity)
        force = self.mass * self.length / self.time**2
        return {
            "time": self.time, "inertia": self.mass, "force": force, "coulomb": force, "viscous": self.mass / self.time,
            "power": force * self.length / self.time, "energy": force * self.length,
        }[quantity]  # fmt: skip

    def objective_unit(self) -> float:
        """The unit of the objective in SI: of its only term, or one (weights of several are scaled for it)."""
        return self._term_unit(self.terms[0]) if len(self.terms) == 1 else 1.0

    def _term_unit(self, term: Any) -> float:
        integral = term[1] == "l1" and self.scheme == "exact"
        return self.unit(term[0]) * (self.time if integral else 1.0)

    @property
    def order(self) -> int:
        """The top derivative, as the documentation of trajopt has it."""
        mentioned = {*self.limits, *(term[0] for term in self.terms)}
        states = (self.start, self.end, *self.via)
        if "snap" in mentioned or any("jerk" in state for state in states):
            return 4
        if "jerk" in mentioned or self.scheme == "euler" or any("acceleration" in state for state in states):
            return 3
        return 2

    def state(self, which: str) -> dict[int, float]:
        """The prescribed derivatives of ``start`` or ``end``."""
        given = {"position": 0.0, **self.start} if which == "start" else self.end
        values = [(i, given.get(DERIVATIVES[i], 0.0)) for i in range(self.order)]
        return {i: float(x) for i, x in values if x != FREE}

    def limit(self, quantity: str) -> tuple[float, float]:
        """(min, max), infinite where there is none. Not for tables."""
        low, high = self.limits.get(quantity, (None, None))
        return (-math.inf if low is None else low), (math.inf if high is None else high)

    @property
    def tables(self) -> bool:
        """Whether a limit depends on time."""
        return any(isinstance(limit, dict) for limit in self.limits.values())

    @property
    def distance(self) -> float | None:
        """From start to end, None when one of them is free."""
        start, end = self.state("start").get(0), self.state("end").get(0)
        return None if start is None or end is None else end - start

    @property
    def rests(self) -> bool:
        """Whether both ends are at rest."""
        states = (self.state("start"), self.state("end"))
        return all(state.get(i) == 0.0 for state in states for i in range(1, self.order))

    @property
    def one_way(self) -> int:
        """+1 or -1 when the velocity limits allow one direction only."""
        if self.tables:
            return 0
        low, high = self.limit("velocity")
        return 1 if low >= 0 else -1 if high <= 0 else 0

    def changed(self, **changes: Any) -> Spec:
        """A copy with some fields replaced."""
        return replace(self, **changes)

    def to_dict(self) -> dict[str, Any]:
        """What differs from the default, plain data."""
        plain = Spec()
        return {k: v for k, v in asdict(self).items() if v != getattr(plain, k)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Spec:
        """The inverse of `to_dict`; None may be spelt "none"."""
        known = {f.name for f in fields(cls)}
        return cls(**{k: _nones(v) for k, v in data.items() if k in known})

    def sections(self) -> dict[str, Any]:
        """The sections of the problem in SI units, as `trajopt.Problem` takes them."""
        sides = {name: self._si_limit(name, limit) for name, limit in self.limits.items()}
        move: dict[str, Any] = {
            "time": self._si_duration(),
            "start": self._si_state("start", {"position": 0.0, **self.start}),
            "end": self._si_state("end", self.end),
        }
        if self.via:
            move["via"] = [{"time": v["time"] * self.time, **self._si_state("via", v)} for v in self.via]
        scaled = len(self.terms) > 1
        terms = [
            {"minimize": x, "norm": norm, "weight": weight / self._term_unit((x, norm)) if scaled else weight}
            for x, norm, weight in self.terms
        ]
        return {
            "move": move,
            "limits": sides,
            "load": {name: value * self.unit(name) for name, value in self.load.items()},
            "objective": {"terms": terms},
            "transcription": {"intervals": self.intervals, "scheme": self.scheme},
        }

    def problem(self) -> trajopt.Problem:
        """The problem. Raises ValueError when trajopt refuses it."""
        return trajopt.Problem(**self.sections())

    def _si_duration(self) -> Any:
        if self.duration == FREE:
            return FREE
        if isinstance(self.duration, list | tuple):
            return [t * self.time for t in self.duration]
        return self.duration * self.time

    def _si_limit(self, name: str, limit: Any) -> Any:
        unit = self.unit(name)
        if isinstance(limit, dict):
            return {key: [x * (self.time if key == "time" else unit) for x in values] for key, values in limit.items()}
        low, high = limit
        return {side: x * unit for side, x in (("min", low), ("max", high)) if x is not None}

    def _si_state(self, which: str, state: Mapping[str, Any]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for name in (name for name in DERIVATIVES if name in state):
            value = state[name]
            if value != FREE:
                value = value * self.unit(name)
                ulps = self.ulps.get(f"{which}.{name}", 0)
                for _ in range(abs(ulps)):
                    value = math.nextafter(value, math.copysign(math.inf, ulps))
            found[name] = value
        return found

    # Guises of the same problem

    def in_units(self, length: float, time: float, mass: float = 1.0) -> Spec:
        """The same move told in other units."""
        return self.changed(length=self.length * length, time=self.time * time, mass=self.mass * mass)

    def mirrored(self) -> Spec:
        """The move in the other direction."""

        def flipped(limit: Any) -> Any:
            if not isinstance(limit, dict):
                return [None if x is None else -x for x in reversed(limit)]
            swapped = {"time": "time", "min": "max", "max": "min"}
            return {swapped[key]: list(x) if key == "time" else [-y for y in x] for key, x in limit.items()}

        negate = lambda state: {k: v if v == FREE or k == "time" else -v for k, v in state.items()}  # noqa: E731
        return self.changed(
            start=negate(self.start), end=negate(self.end), via=[negate(v) for v in self.via],
            limits={name: flipped(limit) for name, limit in self.limits.items()},
            ulps={k: -v for k, v in self.ulps.items()},
        )  # fmt: skip

    def backwards(self) -> Spec:
        """The move run backwards in time: odd derivatives change sign. Only without friction, and fixed duration."""
        odd = ("velocity", "jerk", "power")
        turned = lambda state: {k: -v if k in odd and v != FREE else v for k, v in state.items()}  # noqa: E731

        def limit(name: str, limit: Any) -> Any:
            if isinstance(limit, dict):
                limit = {k: [self.duration - t for t in reversed(x)] if k == "time" else list(reversed(x))
                         for k, x in limit.items()}  # fmt: skip
                return Spec(limits={name: limit}).mirrored().limits[name] if name in odd else limit
            return [None if x is None else -x for x in reversed(limit)] if name in odd else limit

        ends = {"start": "end", "end": "start"}
        ulps = {}
        for key, n in self.ulps.items():
            which, name = key.split(".")
            ulps[f"{ends[which]}.{name}"] = -n if name in odd else n
        return self.changed(
            start=turned(self.end), end=turned({"position": 0.0, **self.start}), ulps=ulps,
            via=[turned(v) | {"time": self.duration - v["time"]} for v in reversed(self.via)],
            limits={name: limit(name, x) for name, x in self.limits.items()},
        )  # fmt: skip

    def looser(self, factor: float) -> Spec:
        """All limits widened by a factor on their own size."""

        def wider(limit: Any) -> Any:
            if isinstance(limit, dict):
                return limit
            low, high = limit
            size = max(abs(x) for x in limit if x is not None)
            return [
                None if low is None else low - (factor - 1) * size,
                None if high is None else high + (factor - 1) * size,
            ]

        return self.changed(limits={name: wider(limit) for name, limit in self.limits.items()})


def _nones(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _nones(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_nones(v) for v in value]
    return None if value == "none" else value


# The generator --------------------------------------------------------------------------------------------------------


def draw(seed: int) -> Spec:
    """The spec of a seed."""
    return _Draw(seed).spec()


class _Draw:
    def __init__(self, seed: int) -> None:
        self.seed, self.rng = seed, random.Random(seed)

    def chance(self, share: float) -> bool:
        return self.rng.random() < share

    def log(self, low: float, high: float) -> float:
        """A number between, all decades alike."""
        return math.exp(self.rng.uniform(math.log(low), math.log(high)))

    def spec(self) -> Spec:
        rng = self.rng
        scheme = "euler" if self.chance(0.2) else "exact"
        nonconvex = self.chance(0.01)
        free_time = not nonconvex and self.chance(0.1)
        order = rng.choices((2, 3, 4), (0.3, 0.62, 0.08))[0]
        load = self.load(nonconvex)
        limits = self.limits(order, load)
        terms = [["time", None, 1.0]] if free_time else self.terms(order, load, nonconvex)
        distance = self.distance()
        limits = _one_way_if_friction(limits, load, terms, distance, rng)
        start, end = self.ends(order, limits, distance, free_time)
        intervals = self.intervals(nonconvex)
        spec = Spec(
            seed=self.seed, start=start, end=end, limits=limits, load=load, terms=terms, intervals=intervals,
            scheme=scheme, duration=FREE if free_time else 1.0, **self.units(),
        )  # fmt: skip
        spec = spec.changed(ulps=self.ulps(spec))
        if not free_time:
            spec = spec.changed(duration=self.duration(spec))
            spec = self.by_time(spec)
        if self.chance(0.3):
            spec = spec.mirrored()
        return spec

    def units(self) -> dict[str, float]:
        if self.chance(0.3):
            return {}
        return {
            "length": 10 ** self.rng.uniform(-9, 6),
            "time": 10 ** self.rng.uniform(-3, 3),
            "mass": self.log(1e-6, 1e4),
        }

    def distance(self) -> float:
        kind = self.rng.random()
        if kind < 0.05:
            return 0.0
        if kind < 0.15:
            return self.log(1e-6, 1e-3)
        return self.log(100, 1e5) if kind < 0.22 else self.log(1e-2, 30)

    def load(self, nonconvex: bool) -> dict[str, float]:
        if not nonconvex and not self.chance(0.2):
            return {}
        load = {"inertia": self.log(0.1, 10)}
        if self.chance(0.4):
            load["viscous"] = self.log(0.01, 2)
        if self.chance(0.3):
            load["coulomb"] = self.log(0.01, 0.5) * load["inertia"]
        return load

    def pair(self, size: float) -> list[float | None]:
        kind = self.rng.random()
        if kind < 0.6:
            return [-size, size]
        low, high = -size * self.log(0.3, 1.0), size
        if kind < 0.75:
            low, high = -size, size * self.log(0.3, 1.0)
        return [low, high] if kind < 0.92 else [None, high] if kind < 0.96 else [low, None]

    def limits(self, order: int, load: Mapping[str, float]) -> dict[str, Any]:
        shares = {"velocity": 0.75, "acceleration": 0.75, "jerk": 0.85 if order >= 3 else 0.0,
                  "snap": 0.8 if order == 4 else 0.0, "force": 0.5 if load else 0.0}  # fmt: skip
        found: dict[str, Any] = {}
        for name, share in shares.items():
            if self.chance(share):
                size = self.log(0.3, 3) * {"jerk": 3.0, "snap": 20.0, "force": load.get("inertia", 1.0)}.get(name, 1.0)
                found[name] = self.pair(size)
        if "velocity" in found and self.chance(0.15) and found["velocity"][1] is not None:
            found["velocity"][0] = 0.0
        if "jerk" in found and self.chance(0.7):
            found["jerk"] = [
                -max(x for x in map(abs, filter(None, found["jerk"]))),
                max(x for x in map(abs, filter(None, found["jerk"]))),
            ]
        return found

    def terms(self, order: int, load: Mapping[str, float], nonconvex: bool) -> list[Any]:
        rng = self.rng
        if nonconvex:
            return [rng.choice([["power", rng.choice(_NORMS), 1.0], ["energy", None, 1.0]])]
        quantities = list(DERIVATIVES[1 : order + 1]) + (["force"] if load else [])
        several = rng.choices((1, 2, 3), (0.75, 0.2, 0.05))[0]
        if self.chance(0.05):
            quantities.append("position")
        return [
            [rng.choice(quantities), rng.choice(_NORMS), self.log(0.01, 10) if several > 1 else 1.0]
            for _ in range(several)
        ]

    def inside(self, limit: Any, size: float) -> float:
        """A value within a limit; now and then on it."""
        low, high = (None, None) if limit is None else limit
        low = -size if low is None else low
        high = size if high is None else high
        if low >= high:
            low, high = min(low, high) - 1e-3, max(low, high)
        if self.chance(0.15):
            return self.rng.choice((low, high))
        return self.rng.uniform(low, high) * self.rng.choice((1.0, 0.5, 0.1))

    def ends(self, order: int, limits: Mapping[str, Any], distance: float, free_time: bool) -> tuple[dict, dict]:
        origin = 0.0 if self.chance(0.7) else self.rng.uniform(-3, 3)
        start: dict[str, Any] = {"position": origin} if origin or self.chance(0.5) else {}
        end: dict[str, Any] = {"position": origin + distance}
        moving = self.rng.random()
        which = [start, end] if moving < 0.25 else [start] if moving < 0.33 else [end] if moving < 0.4 else []
        for state in which:
            state["velocity"] = self.inside(limits.get("velocity"), 1.0)
            if order >= 3 and self.chance(0.6):
                state["acceleration"] = self.inside(limits.get("acceleration"), 1.0)
            if order == 4 and self.chance(0.5):
                state["jerk"] = self.inside(limits.get("jerk"), 1.0)
        if self.chance(0.1) and not free_time:
            state = self.rng.choice((start, end))
            name = self.rng.choice(DERIVATIVES[:order])
            state[name] = FREE
        if self.chance(0.06):
            reach = max(distance, 0.1)
            low, high = origin - reach * self.log(0.01, 2), origin + distance + reach * self.log(0.01, 2)
            if self.chance(0.3):
                high = origin + distance  # the end lies at the limit
            limits["position"] = [low, high]  # type: ignore[index]
        return start, end

    def ulps(self, spec: Spec) -> dict[str, int]:
        found = {}
        for which in ("start", "end"):
            for name, value in getattr(spec, which).items():
                if value != FREE and value and value in spec.limits.get(name, ()) and self.chance(0.7):
                    found[f"{which}.{name}"] = self.rng.choice((-1, 1))
        return found

    def intervals(self, nonconvex: bool) -> int:
        if nonconvex:
            return self.rng.randint(10, 30)
        kind = self.rng.random()
        if kind < 0.03:
            return self.rng.randint(4, 9)
        return self.rng.randint(81, 400) if kind > 0.97 else self.rng.randint(10, 80)

    def duration(self, spec: Spec) -> float:
        least = least_time(spec)
        if least is None:
            return self.log(0.3, 10)
        kind = self.rng.random()
        if kind < 0.05:
            return least * (1 + self.rng.uniform(-1e-6, 1e-6))
        if kind < 0.12:
            return least * (1 + self.rng.uniform(-1e-3, 1e-3))
        return least * (self.rng.uniform(0.5, 1.0) if kind < 0.27 else self.log(1.02, 5.0))

    def by_time(self, spec: Spec) -> Spec:
        """Now and then a limit that varies over the move, or a via state."""
        if self.chance(0.02) and (low_high := spec.limits.get("velocity")) and None not in low_high and spec.rests:
            t = spec.duration
            cut = self.rng.uniform(0.4, 1.0)
            table = {"time": [0.3 * t, 0.45 * t, 0.6 * t], "min": [low_high[0]] * 3,
                     "max": [low_high[1], cut * low_high[1], low_high[1]]}  # fmt: skip
            return spec.changed(limits=spec.limits | {"velocity": table}, ulps={})
        if self.chance(0.02) and spec.distance and spec.rests:
            at = (
                self.rng.randint(1, spec.intervals - 1) / spec.intervals
                if spec.scheme == "euler"
                else self.rng.uniform(0.2, 0.8)
            )
            start = spec.state("start")[0]
            return spec.changed(via=[{"time": at * spec.duration, "position": start + at * spec.distance}])
        return spec


def _one_way_if_friction(
    limits: dict[str, Any], load: dict[str, float], terms: list[Any], distance: float, rng: Any
) -> dict[str, Any]:
    """Coulomb friction is convex only where the direction is known: mostly see to it."""
    loaded = "force" in limits or any(term[0] == "force" for term in terms)
    if load.get("coulomb") and loaded and (rng.random() < 0.97):
        high = limits.get("velocity", [None, None])[1]
        return limits | {"velocity": [0.0, high]}
    return limits


# What is known of a move without optimising it ------------------------------------------------------------------------


def least_time(spec: Spec) -> float | None:
    """The least duration in continuous time by `ruckig` or a closed form; None where neither applies."""
    if not _kinematic(spec) or spec.distance is None or not _all_fixed(spec):
        return None
    if "jerk" in spec.limits:
        found = ruckig_move(spec)
        return None if found is None or found <= 0 else found
    if spec.order == 4:
        return None
    return _least_second_order(spec)


def _kinematic(spec: Spec) -> bool:
    """Whether velocity, acceleration and jerk are all that is limited, by constants, without via states."""
    return not spec.tables and not spec.via and not set(spec.limits) - {"velocity", "acceleration", "jerk"}


def _all_fixed(spec: Spec) -> bool:
    return len(spec.state("start")) == len(spec.state("end")) == spec.order


def ruckig_move(spec: Spec, duration: float | None = None) -> float | None:
    """The duration of ruckig's move, the least or at least ``duration``; None where ruckig cannot do it, or where its
    move, re-integrated here, breaks a limit or misses the end by more than 1e-9."""
    from ruckig import InputParameter, Result, Ruckig, Trajectory

    if spec.order != 3 or not _kinematic(spec) or "jerk" not in spec.limits or not _all_fixed(spec):
        return None
    start, end = spec.state("start"), spec.state("end")
    low_j, high_j = spec.limit("jerk")
    if low_j != -high_j or not math.isfinite(high_j) or spec.distance is None:
        return None
    sides = [spec.limit(name) for name in ("velocity", "acceleration")]
    if any(not low <= 0 <= high for low, high in sides):
        return None
    # A move never needs more than this: without limits, from any state to any other
    far = 10 * (abs(spec.distance) + 1) + 100 * max(*(abs(x) for s in (start, end) for x in s.values()), 1e-3)
    sides = [(max(low, -far * 100), min(high, far * 100)) for low, high in sides]
    given = InputParameter(1)
    given.current_position, given.target_position = [0.0], [spec.distance]
    given.current_velocity, given.target_velocity = [start[1]], [end[1]]
    given.current_acceleration, given.target_acceleration = [start[2]], [end[2]]
    given.min_velocity, given.max_velocity = [sides[0][0]], [sides[0][1]]
    given.min_acceleration, given.max_acceleration = [sides[1][0]], [sides[1][1]]
    given.max_jerk = [high_j]
    if duration is not None:
        given.minimum_duration = duration
    move = Trajectory(1)
    try:
        result = Ruckig(1).calculate(given, move)
    except Exception:
        return None
    if result not in (Result.Working, Result.Finished):
        return None
    profile = move.profiles[0][0]
    pieces = [*zip(profile.brake.t, profile.brake.j, strict=False), *zip(profile.t, profile.j, strict=False)]
    return float(move.duration) if _holds(spec, pieces, move.duration) else None


def _holds(spec: Spec, pieces: list[tuple[float, float]], duration: float) -> bool:
    """Whether constant jerks, one after the other, make the move within its limits."""
    start, end = spec.state("start"), spec.state("end")
    q, v, a = 0.0, start[1], start[2]
    peaks: list[tuple[str, float]] = []
    total = 0.0
    for t, j in pieces:
        if t <= 0:
            continue
        inner = [t] + ([-a / j] if j and 0 < -a / j < t else [])
        peaks += [("velocity", v + a * s + j * s**2 / 2) for s in inner] + [("acceleration", a + j * t), ("jerk", j)]
        q, v, a = q + v * t + a * t**2 / 2 + j * t**3 / 6, v + a * t + j * t**2 / 2, a + j * t
        total += t
    size = {name: max([abs(x) for x in spec.limit(name) if math.isfinite(x)], default=1.0) for name in DERIVATIVES[1:4]}
    for name, value in peaks:
        low, high = spec.limit(name)
        if not low - 1e-10 * size[name] <= value <= high + 1e-10 * size[name]:
            return False
    reach = max(abs(spec.distance or 0.0), abs(v) * total, 1e-12)
    close = abs(q - (spec.distance or 0.0)) <= 1e-9 * reach
    return (
        close
        and abs(v - end[1]) <= 1e-9 * max(size["velocity"], abs(v))
        and abs(a - end[2]) <= 1e-9 * max(size["acceleration"], abs(a))
        and abs(total - duration) <= 1e-9 * max(total, 1e-9)
    )


def reach_second_order(spec: Spec, duration: float) -> tuple[float, float] | None:
    """The nearest and farthest displacement within velocity and acceleration limits alone, exactly; None: none.

    The fastest move has the velocity min(v0 + amax t, vmax, vf - amin (T - t))."""
    v0, vf = spec.state("start").get(1), spec.state("end").get(1)
    (vl, vh), (al, ah) = spec.limit("velocity"), spec.limit("acceleration")
    if v0 is None or vf is None or al > 0 or ah < 0:
        return None
    if vf - v0 > ah * duration * (1 + 1e-12) or vf - v0 < al * duration * (1 + 1e-12):
        return None
    high = _area([(v0, ah), (vh, 0.0), (vf - al * duration if math.isfinite(al) else math.inf, al)], duration)
    low = -_area([(-v0, -al), (-vl, 0.0), (-vf + ah * duration if math.isfinite(ah) else math.inf, -ah)], duration)
    return low, high


def _area(lines: list[tuple[float, float]], duration: float) -> float:
    """∫ of the least of lines (value at 0, slope) over the duration; lines with an infinite number do not bind."""
    lines = [(c, s) for c, s in lines if math.isfinite(c) and math.isfinite(s)]
    if not lines:
        return math.inf
    times = {0.0, duration}
    for i, (c, s) in enumerate(lines):
        for d, r in lines[:i]:
            if s != r and 0 < (t := (d - c) / (s - r)) < duration:
                times.add(t)
    nodes = sorted(times)
    least = [min(c + s * t for c, s in lines) for t in nodes]
    return sum((b - a) * (x + y) / 2 for a, b, x, y in zip(nodes, nodes[1:], least, least[1:], strict=False))


def _least_second_order(spec: Spec) -> float | None:
    """The least time within velocity and acceleration limits alone (not attained when the jerk is finite)."""
    distance = spec.distance
    assert distance is not None

    def possible(t: float) -> bool:
        found = reach_second_order(spec, t)
        return found is not None and found[0] <= distance <= found[1]

    speed = max(abs(x) for x in spec.state("start").values()) + abs(distance) + 1e-3
    t = 1e-4 * min(1.0, abs(distance) or 1.0)
    while not possible(t):
        t *= 1.05
        if t > 1e8 * speed:
            return None
    if possible(t / 1.05):
        return None
    low, high = t / 1.05, t
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if possible(middle) else (middle, high)
    return high


class Program:
    """The discretised problem as a linear program of our own, in the top derivative: an independent opinion.

    ``rows`` hold every limit on Bernstein coefficients (exact) or nodes (euler); see `possible` and `least`.
    Not for limits over time, via states, Coulomb friction in both directions, or free durations.
    """

    def __init__(self, spec: Spec, intervals: int | None = None) -> None:
        self.spec, self.n = spec, intervals or spec.intervals
        self.m, self.h = spec.order, spec.duration / self.n
        self.start = spec.state("start")
        self.free = [i for i in range(self.m) if i not in self.start]
        self.width = self.n + len(self.free)
        t, reach = spec.duration, self._reach()
        self.size = []
        for i in range(self.m + 1):
            limit = max((abs(x) for x in spec.limit(DERIVATIVES[i]) if math.isfinite(x) and x), default=math.inf)
            given = [abs(state.get(i, 0.0)) for state in (self.start, spec.state("end"))]
            self.size.append(max(min(limit, (1, 4, 16, 128, 1024)[i] * reach / t**i), *given, 1e-12))
        self.size[0] = reach

    def _reach(self) -> float:
        spec, t = self.spec, self.spec.duration
        states = (self.start, spec.state("end"))
        by_states = [abs(s.get(i, 0.0)) * t**i for s in states for i in (1, 2, 3)]
        found = max([abs(spec.distance or 0.0), *by_states])
        if found:
            return found
        limits = [abs(x) * t**i for i in (1, 2, 3, 4) for x in spec.limit(DERIVATIVES[i]) if math.isfinite(x)]
        return min(limits, default=1.0) or 1.0

    @cached_property
    def chain(self) -> list[np.ndarray]:
        """``chain[i]``: (N+1, width + 1) the node values (for the top (N, …)) as affine functions of the variables,
        the last column constant. Position is a displacement from the start."""
        columns = self.width + 1
        top = np.zeros((self.n, columns))
        top[:, : self.n] = np.eye(self.n) * self.size[self.m]
        chain = [np.zeros((self.n + 1, columns)) for _ in range(self.m)] + [top]
        for i in range(self.m):
            if i in self.start:
                chain[i][0, -1] = self.start[i] if i else 0.0
            elif i:
                chain[i][0, self.n + self.free.index(i)] = self.size[i]
        terms = 1 if self.spec.scheme == "euler" else 4
        for k in range(self.n):
            for i in range(self.m):
                chain[i][k + 1] = chain[i][k]
                for r in range(1, min(terms, self.m - i) + 1):
                    chain[i][k + 1] += self.h**r / factorial(r) * chain[i + r][k]
        return chain

    def bernstein(self, name: str) -> list[np.ndarray]:
        """The Bernstein coefficients on the intervals, lowest first, as affine functions."""
        powers = self._powers(name)
        n = len(powers) - 1
        return [sum(comb(j, r) / comb(n, r) * powers[r] for r in range(j + 1)) for j in range(n + 1)]

    def _powers(self, name: str) -> list[np.ndarray]:
        if name in DERIVATIVES:
            i = DERIVATIVES.index(name)
            return [self.h**r / factorial(r) * self.chain[i + r][: self.n] for r in range(self.m - i + 1)]
        load, spec = self.spec.load, self.spec
        a, v = self._powers("acceleration"), self._powers("velocity")
        n = len(v) if load.get("viscous") else len(a)
        rows = [np.zeros((self.n, self.width + 1)) for _ in range(n)]
        for r in range(n):
            rows[r] = (
                rows[r]
                + (load["inertia"] * a[r] if r < len(a) else 0.0)
                + (load.get("viscous", 0.0) * v[r] if r < len(v) else 0.0)
            )
        rows[0][:, -1] += load.get("coulomb", 0.0) * spec.one_way
        return rows

    def at_nodes(self, name: str) -> np.ndarray:
        """The values at nodes; the top derivative, or a force that jumps, on intervals or at both ends of each."""
        if name in DERIVATIVES:
            return self.chain[DERIVATIVES.index(name)]
        load = self.spec.load
        a, v = self.chain[2], self.chain[1]
        if self.m == 2:
            pieces = self.bernstein("force")
            return np.concatenate([pieces[0], pieces[-1]]) if load.get("viscous") else pieces[0]
        rows = load["inertia"] * a + load.get("viscous", 0.0) * v
        rows[:, -1] += load.get("coulomb", 0.0) * self.spec.one_way
        return rows

    @cached_property
    def equalities(self) -> np.ndarray:
        """Rows of what the end state prescribes, over the size of each."""
        rows = []
        for i, value in self.spec.state("end").items():
            row = self.chain[i][-1].copy()
            row[-1] -= value - (self.start.get(0, None) or 0.0) if i == 0 else value
            if i == 0 and 0 not in self.start:
                continue  # the displacement is free
            rows.append(row / self.size[i])
        return np.array(rows).reshape(-1, self.width + 1)

    @cached_property
    def limited(self) -> tuple[np.ndarray, np.ndarray]:
        """(rows, unit): row(z) <= 0 for every limit, scaled by its size; ``unit``: the limit's own size, scaled."""
        rows: list[np.ndarray] = []
        units: list[np.ndarray] = []
        for name in self.spec.limits:
            low, high = self.spec.limit(name)
            i = DERIVATIVES.index(name) if name in DERIVATIVES else -1
            size = self.size[i] if i >= 0 else max(abs(x) for x in (low, high) if math.isfinite(x))
            shift = self.start.get(0, 0.0) if i == 0 else 0.0
            for part in self._parts(name, i):
                for bound, sign in ((low, -1.0), (high, 1.0)):
                    if math.isfinite(bound):
                        row = sign * part / size
                        row[:, -1] -= sign * (bound - shift) / size
                        rows.append(row)
                        units.append(np.full(len(row), (abs(bound) or size) / size))
        if not rows:
            return np.zeros((0, self.width + 1)), np.zeros(0)
        stacked, unit = np.concatenate(rows), np.concatenate(units)
        decided = ~np.any(np.abs(stacked[:, :-1]) > 1e-13 * np.max(np.abs(stacked[:, :-1]), initial=1e-300), axis=1)
        if np.any(stacked[decided, -1] > 1e-9):
            self.doomed = True
        return stacked[~decided], unit[~decided]

    doomed = False

    def _parts(self, name: str, i: int) -> Iterator[np.ndarray]:
        if i == self.m:
            yield self.chain[i]
        elif self.spec.scheme == "euler":
            nodes = self.at_nodes(name)
            yield nodes[1:-1] if i >= 0 else nodes
            for k, which in ((0, "start"), (-1, "end")):
                if i > 0 and i not in self.spec.state(which):
                    yield nodes[[k]]
        else:
            pieces = self.bernstein(name)
            yield pieces[0][1:] if i in self.start or i == 0 else pieces[0]
            yield from (p for p in pieces[1:-1])
            yield pieces[-1][:-1] if i in self.spec.state("end") else pieces[-1]

    def _solve(self, cost: np.ndarray, rows: np.ndarray, equal: np.ndarray, low: Any = None) -> Any:
        bounds = [(None, None)] * len(cost) if low is None else low
        options = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10, "time_limit": 20.0}
        return linprog(
            cost, A_ub=rows[:, :-1] if len(rows) else None, b_ub=-rows[:, -1] if len(rows) else None,
            A_eq=equal[:, :-1] if len(equal) else None, b_eq=-equal[:, -1] if len(equal) else None,
            bounds=bounds, method="highs", options=options,
        )  # fmt: skip

    def margin(self) -> float:
        """How clearly the move is possible on this grid: the better of two margins, relative. Positive: possible.

        The limits can all be tightened by so much of their own size; or the end lies so far inside the reachable.
        Nan where the program was not solved."""
        rows, unit = self.limited
        if self.doomed:
            return -math.inf
        # tightening t: row + t unit <= 0, maximise t
        wide = np.concatenate([rows[:, :-1], unit[:, None], rows[:, -1:]], axis=1)
        equal = np.insert(self.equalities, self.width, 0.0, axis=1)
        cost = np.zeros(self.width + 1)
        cost[-1] = -1.0
        found = self._solve(cost, wide, equal, [(None, None)] * self.width + [(-1e3, 0.5)])
        by_limits = float(found.x[-1]) if found.status == 0 else math.nan
        if not by_limits <= 1e-6 or self.spec.distance is None:
            return by_limits
        ends = []
        position = self.chain[0][-1] / self.size[0]
        others = np.delete(self.equalities, 0, axis=0)
        for sign in (1.0, -1.0):
            found = self._solve(sign * position[:-1], rows, others)
            if found.status == 3:
                ends.append(-sign * math.inf)
            elif found.status != 0:
                return by_limits
            else:
                ends.append(sign * found.fun + position[-1])
        target = self.spec.distance / self.size[0]
        inside = min(target - ends[0], ends[1] - target)
        return max(by_limits, inside) if min(by_limits, inside) > -1e-9 else min(by_limits, inside)

    def least(self) -> float:
        """The least value of an objective of l1 and linf norms, or nan."""
        rows, _ = self.limited
        columns, equal = self.width, self.equalities
        cost: list[float] = [0.0] * self.width
        extra: list[tuple[np.ndarray, str]] = []
        for name, norm, weight in self.spec.terms:
            samples = self.at_nodes(name)
            size = (
                self.size[DERIVATIVES.index(name)]
                if name in DERIVATIVES
                else np.max(np.abs(samples[:, -1])) + self.spec.load["inertia"] * self.size[2]
            )
            exact = self.spec.scheme == "exact"
            if norm == "linf":
                cost.append(weight * size)
                extra.append((samples / size, "linf"))
            else:
                share = self._shares(name, len(samples)) * self.spec.duration if exact else np.ones(len(samples))
                cost += list(weight * size * share)
                extra.append((samples / size, "l1"))
        total = sum(1 if kind == "linf" else len(x) for x, kind in extra)
        blocks = [np.insert(rows, [columns] * total, 0.0, axis=1)] if total else [rows]
        at = columns
        for samples, kind in extra:
            count = 1 if kind == "linf" else len(samples)
            for sign in (1.0, -1.0):
                block = np.zeros((len(samples), columns + total + 1))
                block[:, :columns], block[:, -1] = sign * samples[:, :-1], sign * samples[:, -1]
                block[
                    np.arange(len(samples)), at + (np.zeros(len(samples), int) if count == 1 else np.arange(count))
                ] = -1.0
                blocks.append(block)
            at += count
        scale = max(cost)
        found = self._solve(
            np.array(cost) / scale, np.concatenate(blocks), np.insert(equal, [columns] * total, 0.0, axis=1)
        )
        return float(found.fun) * scale if found.status == 0 else math.nan

    def _shares(self, name: str, count: int) -> np.ndarray:
        if count == self.n:
            return np.full(count, 1 / self.n)
        if count == 2 * self.n:
            return np.full(count, 0.5 / self.n)
        shares = np.full(count, 1 / self.n)
        shares[[0, -1]] /= 2
        return shares


def program(spec: Spec, intervals: int | None = None) -> Program | None:
    """Our own program, where it applies."""
    friction = spec.load.get("coulomb") and not spec.one_way and "force" in spec.limits
    if "position" in spec.limits and 0 not in spec.state("start"):  # positions are displacements here
        return None
    if spec.tables or spec.via or friction or "power" in spec.limits or not isinstance(spec.duration, float):
        return None
    if (intervals or spec.intervals) > 130:
        return None
    return Program(spec, intervals)


# The judge ------------------------------------------------------------------------------------------------------------


@dataclass
class Record:
    """What came of one spec: its verdict, what is fatal, what is only worth counting, and the time it took."""

    seed: int
    status: str = ""
    convex: bool = True
    message: str = ""
    failures: list[str] = field(default_factory=list)
    counts: list[str] = field(default_factory=list)
    seconds: float = 0.0
    solves: int = 0

    def fail(self, kind: str, text: str) -> None:
        """Note a fatal failure."""
        self.failures.append(f"{kind}: {text}")


def judge(spec: Spec, thorough: bool = False, explained: bool = True) -> Record:
    """Solve a spec and hold the answer against all that is known; ``thorough``: every comparison, not a share;
    ``explained``: where it is impossible, with an explanation, and one of its cures tried."""
    return _Judge(spec, thorough, explained or thorough).run()


def _unexplained(setting: Setting, clock: Clock) -> dict[str, Any]:
    """What `trajopt.explain.explain` says of the verdict, and nothing else."""
    duration = setting.problem.move.fixed_time
    assert duration is not None
    return {"continuous": is_impossible(setting, duration, clock), "text": ["impossible, and not explained"]}


def _solved(problem: trajopt.Problem, explained: bool) -> trajopt.Solution:
    if explained:
        return solving.solve(problem, SECONDS)
    with patch.object(conclude, "explain", _unexplained):
        return solving.solve(problem, SECONDS)


@dataclass(frozen=True)
class _Answer:
    """One answer, in the units of its spec."""

    status: str
    objective: float
    bound: float
    duration: float
    data: dict[str, Any]

    @property
    def solved(self) -> bool:
        return self.status in ("SOLVED", "SOLVED_LOCAL")

    @property
    def possible(self) -> bool | None:
        return (
            True if self.solved else False if self.status in ("IMPOSSIBLE", "IMPOSSIBLE_ON_GRID", "REFUSED") else None
        )


class _Judge:
    def __init__(self, spec: Spec, thorough: bool, explained: bool) -> None:
        self.spec, self.record = spec, Record(spec.seed)
        self.rng, self.thorough, self.explained = random.Random(spec.seed + 1_000_003), thorough, explained

    def chance(self, share: float) -> bool:
        return self.rng.random() < share or self.thorough

    def run(self) -> Record:
        since = perf_counter()
        try:
            answer = self.answer(self.spec)
            if answer is not None:
                self.record.status = answer.status
                self._judge(answer)
        except Exception:
            self.record.fail("judge", traceback.format_exc(limit=-4))
        self.record.seconds = perf_counter() - since
        return self.record

    def answer(self, spec: Spec, guise: str = "") -> _Answer | None:
        """What trajopt says of a spec; every answer is checked, and None is a failure noted."""
        record = self.record
        try:
            problem = spec.problem()
        except ValueError as error:
            text = next((line.strip() for line in str(error).splitlines() if "Value error" in line), str(error))
            record.message = record.message or text
            return _Answer("REFUSED", math.nan, -math.inf, math.nan, {"message": text})
        except Exception:
            record.fail("exception", f"{guise} Problem(...): {traceback.format_exc(limit=-3)}")
            return None
        record.solves += 1
        try:
            solution = _solved(problem, self.explained and not guise)
        except trajopt.BadInput as error:
            return _Answer("REFUSED", math.nan, -math.inf, math.nan, {"message": str(error)})
        except Exception:
            record.fail("exception", f"{guise} solve: {traceback.format_exc(limit=-3)}")
            return None
        try:
            data = json.loads(json.dumps(solution.to_dict(), allow_nan=False))
        except ValueError as error:
            record.fail("json", f"{guise} {error}")
            return None
        if not guise:
            record.convex, record.message = solution.route.model == "cvxpy", solution.message
        self._check(data, guise)
        unit = spec.objective_unit()
        number = lambda x, unit: math.nan if x is None else x / unit  # noqa: E731
        bound = number((data["certificate"] or {}).get("lower_bound"), unit)
        return _Answer(
            solution.status.value, number(data["objective"], unit), -math.inf if math.isnan(bound) else bound,
            number(data["duration"], spec.time), data,
        )  # fmt: skip

    def _check(self, data: dict[str, Any], guise: str) -> None:
        report = checker.check(data)
        if not report.passed:
            self.record.fail("checker", f"{guise} {data['status']}: {'; '.join(map(str, report.failed))[:300]}")
        elif data["trajectory"] and not checker.check(data, strict=True).passed:
            self.record.counts.append("not strict")
        if data["status"] == "SOLVED" and not (data["certificate"] or {}).get("gap", math.inf) <= 1e-6:
            self.record.fail("gap", f"{guise} certificate {data['certificate']}")

    # The answer by itself

    def _judge(self, answer: _Answer) -> None:
        spec = self.spec
        if answer.possible is False:
            self._impossible(answer)
        elif answer.solved:
            self._durations(answer)
            self._values(answer)
        if answer.status in ("UNDECIDED", "LIMIT"):
            self._undecided(answer)
        if answer.status in ("CRASHED", "BAD_INPUT", "INTERRUPTED"):
            self.record.fail("status", answer.status)
        if spec.duration != FREE and answer.possible is not None and self.record.convex:
            self._guises(answer)
        if answer.status == "SOLVED":
            self._dearer(answer)
        if answer.status.startswith("IMPOSSIBLE") and self.explained:
            self._cures(answer)

    def _impossible(self, answer: _Answer) -> None:
        """No move that provably exists may be called impossible."""
        spec, record = self.spec, self.record
        grid = answer.status == "IMPOSSIBLE_ON_GRID"
        doomed = "must leave" in record.message or "come from" in record.message
        if answer.status == "REFUSED" and not doomed:
            return
        if spec.duration == FREE:
            if (possible := self._some_duration()) is not None:
                record.fail("false impossible", f"{answer.status} ({record.message[:120]}), possible in {possible}")
            return
        if spec.scheme == "exact" and not grid and (proof := self._possible()) is not None:
            record.fail("false impossible", f"{answer.status} ({record.message[:120]}), but {proof}")
            return
        if grid and spec.rests and (least := least_time(spec)) and spec.duration > least * (1 + 5 / spec.intervals):
            record.counts.append("grid impossible far from the least time")
        own = program(spec) if answer.status != "REFUSED" else program(spec, max(spec.intervals, 40))
        if own is not None and (margin := own.margin()) > EDGE / 10:
            record.fail("false impossible", f"{answer.status}, but a program of our own has a margin of {margin:.2g}")

    def _some_duration(self) -> float | None:
        """A duration in which a program of our own is possible, or None."""
        spec = self.spec
        typical = least_time(spec) or max(abs(spec.distance or 0.0), 1.0)
        for factor in (1.3, 3.0, 10.0, 0.3):
            own = program(spec.changed(duration=factor * typical))
            if own is not None and own.margin() > EDGE:
                return factor * typical
        return None

    def _possible(self) -> str | None:
        """A proof that the move is possible in continuous time, or None."""
        spec = self.spec
        if not _kinematic(spec) or not _all_fixed(spec) or spec.distance is None:
            return None
        if "jerk" in spec.limits:
            found = ruckig_move(spec, spec.duration)
            if found is not None and abs(found - spec.duration) <= 1e-12 * found:
                return f"ruckig moves in {found!r}"
            if found is not None and spec.rests and spec.duration >= found * (1 + 1e-9):
                return f"ruckig's least time is {found!r}"
        elif spec.order <= 3 and (reach := reach_second_order(spec, spec.duration)) is not None:
            room = 1e-9 * max(abs(spec.distance), *map(abs, (x for x in reach if math.isfinite(x))), 1e-9)
            v0, vf, t = spec.state("start")[1], spec.state("end")[1], spec.duration
            low, high = spec.limit("acceleration")
            possible = low * (1 - 1e-9) <= (vf - v0) / t <= high * (1 - 1e-9)
            starts = all(spec.limit("velocity")[0] < v < spec.limit("velocity")[1] for v in (v0, vf)) or spec.order == 2
            inner = spec.order == 2 or all(low < s.get(2, 0.0) < high for s in (spec.state("start"), spec.state("end")))
            if possible and starts and inner and reach[0] + room < spec.distance < reach[1] - room:
                return f"the reach in closed form is {reach}"
        return None

    def _just_reaches(self, duration: float) -> bool:
        """Whether the closed form of the reach, within rounding, holds the end in this time."""
        spec, distance = self.spec, self.spec.distance
        if spec.order != 2 or not _kinematic(spec) or distance is None or not _all_fixed(spec):
            return False
        found = reach_second_order(spec, duration)
        slack = 1e-9 * (abs(distance) + duration * abs(spec.state("start").get(1, 0.0)))
        return found is not None and found[0] - slack <= distance <= found[1] + slack

    def _durations(self, answer: _Answer) -> None:
        """No move is faster than the fastest."""
        spec, record = self.spec, self.record
        if spec.scheme != "exact":
            return
        least = least_time(spec)
        if least is None or self._just_reaches(answer.duration):  # in a sliver of times that no scan meets
            return
        if answer.duration < least * (1 - EDGE):
            record.fail("too fast", f"{answer.status} in {answer.duration!r}, but the least time is {least!r}")
        if spec.duration == FREE and self.record.convex:
            if answer.duration < least * (1 - 1e-9):
                record.fail("too fast", f"least time {answer.duration!r}, ruckig or closed form {least!r}")
            excess = answer.duration / least - 1
            if spec.intervals >= 10 and excess > 100 / spec.intervals**2 and "jerk" in spec.limits:
                record.counts.append("slow least time")
            if spec.intervals >= 10 and excess > 5 / spec.intervals:
                record.fail(
                    "slow", f"least time {answer.duration!r} at N = {spec.intervals}, ruckig or closed form {least!r}"
                )

    def _values(self, answer: _Answer) -> None:
        """Objectives in closed form, or by a program of our own."""
        spec = self.spec
        if answer.status != "SOLVED" or spec.duration == FREE:
            return
        values = dict(_bounds(spec))
        for what, bound in values.items():
            if answer.objective < bound * (1 - 1e-6):
                self.record.fail("too good", f"{answer.objective!r}, but {what} is {bound!r}")
        if (
            spec.rests
            and not spec.limits
            and not spec.via
            and len(spec.terms) == 1
            and spec.scheme == "exact"
            and spec.distance
        ):
            self._closed_form(answer)
        linear = all(term[0] in (*DERIVATIVES, "force") and term[1] in ("l1", "linf") for term in spec.terms)
        if linear and self.chance(0.2) and (own := program(spec)) is not None:
            best = own.least()
            size = max(abs(best), 1e-9)
            rubs = spec.load.get("coulomb") and any(term[0] == "force" for term in spec.terms)  # less at rest
            above = answer.objective if not rubs else math.inf
            if not math.isfinite(best):
                self.record.counts.append("own program failed")
            elif best < answer.bound - 2e-6 * size or above < best - 2e-6 * size:
                near = own.margin()
                if near > EDGE:
                    self.record.fail(
                        "value",
                        f"{answer.objective!r} (bound {answer.bound!r}), own program {best!r}, margin {near:.2g}",
                    )

    def _closed_form(self, answer: _Answer) -> None:
        spec = self.spec
        quantity, norm, _ = spec.terms[0]
        n, m, d, t = spec.intervals, spec.order, abs(spec.distance or 0.0), spec.duration
        if quantity == DERIVATIVES[m] and norm == "l2" and n > m:
            least = {2: 12.0, 3: 720.0, 4: 100800.0}[m] * math.prod(n**2 / (n**2 - i**2) for i in range(1, m))
            exact = math.sqrt(least) * d / t**m
            if abs(answer.objective - exact) > 1e-8 * exact:
                self.record.fail("closed form", f"{answer.objective!r}, not {exact!r}")
        if quantity == DERIVATIVES[m] and norm == "linf" and m == 2 and n % 2 == 0:
            exact = 4 * d / t**2
            if abs(answer.objective - exact) > 1e-6 * exact:
                self.record.fail("closed form", f"{answer.objective!r}, not {exact!r}")

    def _undecided(self, answer: _Answer) -> None:
        """Within EDGE of the possible no verdict is owed; elsewhere it counts against the target."""
        record, spec = self.record, self.spec
        if not record.convex:
            record.counts.append(f"{answer.status} nonconvex")
            return
        least = least_time(spec)
        if spec.duration == FREE and self._some_duration() is None:
            record.counts.append(f"{answer.status} where no duration is known to do")
            return
        near = bool(least) and spec.duration != FREE and abs(spec.duration / least - 1) <= EDGE  # type: ignore[operator]
        if not near and spec.duration != FREE and (own := program(spec)) is not None:
            margin = own.margin()
            near = abs(margin) <= EDGE
            record.message += f" [own margin {margin:.2g}]"
        record.counts.append(f"{answer.status} {'at the edge' if near else 'well-posed'}")

    # The answer beside others

    def _guises(self, answer: _Answer) -> None:
        """The same move in other units, mirrored, and backwards."""
        spec = self.spec
        guises: dict[str, Spec] = {}
        if self.chance(0.08):
            length, time = 10 ** self.rng.uniform(-9, 6), 10 ** self.rng.uniform(-3, 3)
            guises[f"units {length!r} {time!r}"] = spec.changed(length=length, time=time, mass=1.0)
        if self.chance(0.05):
            guises["mirrored"] = spec.mirrored()
        friction = spec.load.get("coulomb") or spec.load.get("viscous")
        position = any(term[0] == "position" for term in spec.terms)
        if self.chance(0.05) and spec.scheme == "exact" and not friction and not position:
            guises["backwards"] = spec.backwards()
        for name, other in guises.items():
            again = self.answer(other, name)
            if again is None:
                continue
            if again.status != answer.status:
                grids = {"IMPOSSIBLE", "IMPOSSIBLE_ON_GRID"}
                close = self._close_to_edge()
                kind = "guise" if not close else "guise at the edge"
                text = f"{name}: {answer.status} became {again.status} ({str(again.data.get('message'))[:160]})"
                if close or {again.status, answer.status} == grids:
                    self.record.counts.append(f"{kind}: {answer.status} {again.status}")
                else:
                    self.record.fail("guise", text)
            elif answer.solved:
                off = abs(again.objective - answer.objective) / max(abs(answer.objective), 1e-12)
                if off > 1e-6:
                    self.record.fail("guise", f"{name}: objective {answer.objective!r} became {again.objective!r}")
                elif off > _SAME:
                    self.record.counts.append(f"objective in another guise off by 1e{math.ceil(math.log10(off))}")

    def _close_to_edge(self) -> bool:
        own = program(self.spec)
        if own is None:
            return False
        margin = own.margin()
        return not abs(margin) > EDGE

    def _dearer(self, answer: _Answer) -> None:
        """Looser limits never cost more; nor does more time, from rest to rest."""
        spec = self.spec
        others: dict[str, Spec] = {}
        if spec.limits and self.chance(0.05) and spec.scheme == "exact":
            others["looser"] = spec.looser(self.rng.choice((1.001, 1.05, 2.0))).changed(ulps={})
        fixed = spec.duration != FREE and not spec.tables and not spec.via
        whole = all(
            term[0] in DERIVATIVES[1:] or (term[0] == "force" and not {"viscous", "coulomb"} & set(spec.load))
            for term in spec.terms
        )
        signs = (
            all(spec.limit(name)[0] <= 0 <= spec.limit(name)[1] for name in spec.limits if name != "position")
            if fixed
            else False
        )
        force = "force" not in spec.limits or not {"viscous", "coulomb"} & set(spec.load)
        if fixed and spec.rests and whole and signs and force and self.chance(0.08):
            others["slower"] = spec.changed(duration=spec.duration * self.rng.choice((1.001, 1.1, 3.0)))
        for name, other in others.items():
            again = self.answer(other, name)
            if again is None:
                continue
            if not again.solved:
                if again.status == "UNDECIDED":
                    self.record.counts.append(f"{name}: UNDECIDED")
                else:
                    self.record.fail("dearer", f"{name} {other.duration!r}: SOLVED became {again.status}")
                continue
            value = again.objective if spec.duration != FREE else again.duration
            size = max(abs(answer.objective), 1e-12)
            worse = again.status == "SOLVED" and value > answer.objective + 1e-6 * size  # a local optimum may be
            if worse or again.bound > answer.objective + 1e-7 * size:
                self.record.fail("dearer", f"{name}: {answer.objective!r} became {value!r} (bound {again.bound!r})")

    def _cures(self, answer: _Answer) -> None:
        """Every cure offered works, and 0.1 % less does not."""
        explanation, spec = answer.data["explanation"], self.spec
        if not explanation:
            return
        cures: dict[str, tuple[Spec, Spec]] = {}
        if least := explanation.get("least_time"):
            least /= spec.time
            cures["least time"] = (spec.changed(duration=least), spec.changed(duration=least * 0.999))
        for name, cure in explanation.get("limits", {}).items():
            if cure["value"] is None or cure["varies"]:
                continue
            quantity, _, side = name.partition(".")
            value = cure["value"] / spec.unit(quantity)
            less = value - 1e-3 * abs(value) if side != "min" else value + 1e-3 * abs(value)
            now = spec.limits[quantity]

            def given(x: float, side: str = side, now: Any = now) -> list[Any]:
                return [x, now[1]] if side == "min" else [now[0], x] if side == "max" else [-x, x]

            cures[name] = (
                spec.changed(limits=spec.limits | {quantity: given(value)}),
                spec.changed(limits=spec.limits | {quantity: given(less)}),
            )
        if not cures:
            return
        name = self.rng.choice(sorted(cures))
        works, fails = (self.answer(s, f"cure {name}") for s in cures[name])
        if works is not None and not works.solved:
            self.record.counts.append(f"cure does not work: {works.status}")
            self.record.message += f" [cure {name} gives {works.status}: {works.data.get('message')}]"
        if fails is not None and fails.solved:
            self.record.counts.append("less than the cure works, too")
            self.record.message += f" [less than cure {name} works]"


def _bounds(spec: Spec) -> Iterator[tuple[str, float]]:
    """Lower bounds on single-term objectives that hold for every move of the exact scheme."""
    if spec.scheme != "exact" or len(spec.terms) != 1 or spec.distance is None or spec.tables:
        return
    quantity, norm, _ = spec.terms[0]
    d, t = abs(spec.distance), spec.duration
    if quantity == "velocity" and norm in ("linf",):
        yield "D/T", d / t * (1 - 2 / spec.intervals) if spec.order > 2 else 0.0
    if not spec.rests:
        return
    if quantity == "acceleration" and norm == "linf":
        yield "4D/T²", 4 * d / t**2
    if quantity == "jerk" and norm == "linf":
        yield "32D/T³", 32 * d / t**3 if spec.order == 3 else 0.0
    if quantity == DERIVATIVES[spec.order] and norm == "l2":
        yield "the L2 bound", math.sqrt({2: 12.0, 3: 720.0, 4: 100800.0}[spec.order]) * d / t**spec.order


# Shrinking ------------------------------------------------------------------------------------------------------------


def remarks(record: Record) -> set[str]:
    """The kinds of what is wrong with a record: of failures, and of missing verdicts."""
    return {failure.partition(":")[0] for failure in record.failures} | {
        count for count in record.counts if count.endswith("well-posed") or count.startswith("cure")
    }


def shrunk(spec: Spec, most: int = 200) -> Spec:
    """A simpler spec that goes wrong in one of the same ways."""
    wrong, tries, again = remarks(judge(spec, thorough=True)), 0, True
    while again and tries < most:
        again = False
        for simpler in _simpler(spec):
            tries += 1
            if tries >= most:
                break
            try:
                same = remarks(judge(simpler, thorough=True)) & wrong
            except Exception:
                continue
            if same:
                spec, again = simpler, True
                break
    return spec


def _simpler(spec: Spec) -> Iterator[Spec]:
    if (spec.length, spec.time, spec.mass) != (1.0, 1.0, 1.0):
        yield spec.changed(length=1.0, time=1.0, mass=1.0)
    if spec.ulps:
        yield spec.changed(ulps={})
    for name in spec.limits:
        yield spec.changed(limits={k: v for k, v in spec.limits.items() if k != name})
    for name in spec.load:
        yield spec.changed(load={k: v for k, v in spec.load.items() if k != name})
    for name in spec.start:
        yield spec.changed(start={k: v for k, v in spec.start.items() if k != name})
    for name in set(spec.end) - {"position"}:
        yield spec.changed(end={k: v for k, v in spec.end.items() if k != name})
    if len(spec.terms) > 1:
        for i in range(len(spec.terms)):
            yield spec.changed(terms=spec.terms[:i] + spec.terms[i + 1 :])
    for count in (4, 6, 10, 20, 40):
        if count < spec.intervals:
            yield spec.changed(intervals=count)
    for digits in (1, 2, 3, 6):
        rounded = Spec.from_dict(_rounded(spec.to_dict(), digits))
        if rounded != spec:
            yield rounded


def _rounded(value: Any, digits: int) -> Any:
    if isinstance(value, dict):
        return {
            k: v if k in ("seed", "length", "time", "mass") and not isinstance(v, list) else _rounded(v, digits)
            for k, v in value.items()
        }
    if isinstance(value, list | tuple):
        return [_rounded(v, digits) for v in value]
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value
