"""What both twins are asked, with which tolerance, and which of them decides."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from operator import methodcaller
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from trajopt.checker.case import DERIVATIVES, EPS, TOTALS, VALUE, Case
from trajopt.checker.float_twin import FloatTwin
from trajopt.checker.rational_twin import RationalTwin
from trajopt.checker.report import Check, Found, Number, to_float

USUAL: Final = 1e-6
STRICT: Final = 1e-9
_STATE: Final = 1e-6
_DEFECT: Final = 1e-9
_DRIFT: Final = 1e-6
_COORDINATE: Final = 1e-12
_CANCELLED: Final = 1e-12  # of the energy that goes to and fro: a small difference of it is rounding
_NORMS: Final = ("l1", "l2", "linf")

Twin: TypeAlias = FloatTwin | RationalTwin


class _Task(NamedTuple):
    name: str
    tolerance: float
    ask: Callable[[Twin], Found]


def decide(case: Case, strict: bool, notes: list[str]) -> tuple[list[Check], bool]:
    """Every numeric check, and whether the rational twin had a say."""
    checks, rational = [], False
    with np.errstate(all="ignore"):  # what overflows is not finite, and therefore in doubt
        quick, exact = FloatTwin(case), RationalTwin(case)
        for task in tasks_of(case, quick, STRICT if strict else USUAL, notes):
            found = task.ask(quick)
            if strict or _doubtful(found, task.tolerance):
                found, rational = task.ask(exact), True
            passed = bool(found.violation <= task.tolerance)
            violation = to_float(found.violation)
            checks.append(Check(task.name, violation, task.tolerance, found.time, passed, found.note))
    return checks, rational


def _doubtful(found: Found, tolerance: float) -> bool:
    off = float(found.violation)
    if not (math.isfinite(off) and math.isfinite(found.rounding) and found.rounding <= tolerance / 100):
        return True
    return tolerance / 10 < off < tolerance * 10 or (off > 0 and tolerance == 0)


def tasks_of(case: Case, quick: FloatTwin, relative: float, notes: list[str]) -> list[_Task]:
    tasks = []
    for i in range(case.order):
        coordinate = 4 * EPS * case.largest_position if i == 0 else 0.0
        name, size = DERIVATIVES[i], case.size[i]
        tasks.append(_Task(f"dynamics {name}", _DEFECT * size + coordinate, methodcaller("defect", i)))
        tasks.append(_Task(f"drift {name}", _DRIFT * size + coordinate, methodcaller("drift", i)))
    tasks += _state_tasks(case)
    for name in case.limits:
        if name in TOTALS:
            tolerance = _limit_tolerance(case, name, to_float(quick.total(name)), relative)
            tasks.append(_Task(f"limit {name}", tolerance, methodcaller("excess_in_total", name)))
            continue
        tolerance = _limit_tolerance(case, name, quick.peak(name), relative)
        tasks.append(_Task(f"limit {name}", tolerance, methodcaller("excess", name, tolerance)))
    for name, norm, most in case.ceilings:
        if norm is not None and norm not in _NORMS:
            notes.append(f"ceiling on {name} (norm {norm} is not the checker's)")
            continue
        tasks.append(_Task(f"ceiling {name}", relative * most, methodcaller("excess_of_term", name, norm, most)))
    return tasks + _value_tasks(case, quick, notes)


def _state_tasks(case: Case) -> list[_Task]:
    states = [("start", 0, case.start), ("end", case.count, case.end)]
    states += [(f"via {k}", case.nearest(via.time), via.fixed) for k, via in enumerate(case.via, start=1)]
    return [
        _Task(
            f"{where} {DERIVATIVES[i]}",
            _STATE * case.size[i] if i else _position_tolerance(case),
            methodcaller("state", i, node, target),
        )
        for where, node, fixed in states for i, target in fixed.items()
    ]  # fmt: skip


def _position_tolerance(case: Case) -> float:
    """1e-6 of the displacement, or 1e-12 of the coordinate where floats resolve no better, but never a displacement."""
    moved = abs(case.end[0] - case.start[0]) if 0 in case.end and 0 in case.start else 0.0
    moved = moved or case.size[0]
    return max(_STATE * moved, min(_COORDINATE * case.largest_position, 1e-2 * moved))


def _limit_tolerance(case: Case, name: str, peak: float, relative: float) -> float:
    """Relative to the limit, but not more than to the signal itself: a far limit must not excuse the near one."""
    origin = float(case.signal[0][0]) if name == "position" else 0.0
    instants = [0.0, *case.corners, case.end_time]
    sides = [side.among(instants) for side in case.limits[name] if side is not None]
    largest = max((abs(value - origin) for side in sides for value in side), default=0.0)
    coordinate = 4 * EPS * case.largest_position if name == "position" else 0.0
    return relative * min(largest or peak, peak) + coordinate


def _value_tasks(case: Case, quick: FloatTwin, notes: list[str]) -> list[_Task]:
    """Objective and metrics: claimed against recomputed."""
    foreign = sorted({norm for _, norm, _ in case.terms if norm is not None and norm not in _NORMS})
    notes += [f"objective (norm {norm} is not the checker's)" for norm in foreign]
    tasks = [_value_task("objective", case.objective, methodcaller("objective"), bool(foreign))]
    computable = metric_names(case)
    known = {*computable, *(f"residual_vibration_{k + 1}" for k in range(len(case.vibration)))}  # those have own checks
    notes += [f"metrics.{name}" for name in case.metrics if name not in known]
    for name, claimed in case.metrics.items():
        if name in computable:
            floor = _CANCELLED * quick.exchanged if name in ("electrical_energy", "brake_energy") else 0.0
            tasks.append(_value_task(f"metric {name}", claimed, methodcaller("metric", name), floor=floor))
    return tasks


def _value_task(
    name: str, claimed: float, values: Callable[[Twin], list[Number]], at_least: bool = False, floor: float = 0.0
) -> _Task:
    tolerance = VALUE * abs(claimed) + floor
    return _Task(name, tolerance, lambda twin: _nearest_value(claimed, values(twin), at_least))


def _nearest_value(claimed: float, found: list[Number], at_least: bool) -> Found:
    """How far a claim is from the nearest of the values found (see `Case.conventions`); the last is their rounding.

    With ``at_least`` the values lack the terms we cannot compute, none of them negative: the claim may be larger.
    """
    values, rounding = found[:-1], to_float(found[-1])
    offs = [_difference(value, claimed) for value in values]
    best = min(range(len(offs)), key=lambda k: abs(to_float(offs[k])))
    off: Number = max(offs[best], -offs[best]) if offs[best] > 0 or not at_least else 0.0
    note = f"says {claimed!r}, recomputed {to_float(values[best])!r}" if off else ""
    return Found(off, None, rounding, note)


def _difference(value: Number, claimed: float) -> Number:
    return value - Fraction(claimed) if isinstance(value, Fraction) else value - claimed


def metric_names(case: Case) -> tuple[str, ...]:
    names = [f"{kind}_{name}" for name in DERIVATIVES[1 : case.order + 1] for kind in ("peak", "rms")]
    if case.inertia is not None:
        names += ["energy", "peak_power", "rms_power", "peak_force", "rms_force"]
    if case.inertia is not None and case.motor is not None:
        names += ["peak_current", "rms_current", "peak_voltage", "copper_loss", "electrical_energy", "brake_energy"]
    return (*names, "distance")
