"""Prices: what the objective would change by if a limit, or the time, gave way a little. From the multipliers.

The price of a limit is the sum of the multipliers of its rows. That of the time follows from those where stretching a
move in time does nothing but lower limits and terms; else it is the slope of the Lagrangian in the duration, at the
same primal and dual vector (the envelope theorem).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from time import perf_counter
from typing import Any, Final

import numpy as np

from trajopt import units
from trajopt.attempt import Attempt, Clock, Goal, lagrangian, to
from trajopt.objective import Measured
from trajopt.problem import Problem
from trajopt.stretching import FALLS, is_plain, stretched_cost
from trajopt.trajectory import Trajectory
from trajopt.transcribe import Setting

_STEP: Final = 1e-6  # of the duration, for the difference of the Lagrangian, which is smooth


def priced(setting: Setting, attempt: Attempt, clock: Clock) -> Attempt:
    """The attempt with a note of the prices of the limits and of the time, the most effective first; those of no effect
    last, at zero.

    Each price: ``name`` (``jerk`` for a symmetric limit, ``velocity.max`` for a side, ``time``), ``per_unit`` (SI
    objective per SI unit of the limit), ``unit``, ``per_percent`` (relative change of the objective when it is widened
    by 1 %; None for a limit that is zero).
    """
    problem, trajectory = setting.problem, attempt.trajectory
    if trajectory is None:
        return attempt
    since, duration = perf_counter(), trajectory.duration
    found, per_second = _limits(problem, attempt), None
    if problem.move.fixed_time is not None:
        per_second = _by_stretching(problem, trajectory, found)
        if per_second is None:
            per_second = _time(setting, attempt, to(problem.objective), duration)
    if per_second is not None:
        found["time"] = (per_second, per_second * duration)
    rows = ranked(problem, found, attempt.value)
    clock.charge("prices", since)
    return replace(attempt, notes=attempt.notes | {"prices": rows})


def time_prices(setting: Setting, attempt: Attempt, goal: Goal, duration: float) -> list[dict[str, Any]]:
    """The prices of the limits for a least time: by how much each moves the farthest reach, over what time moves it."""
    per_second = _time(setting, attempt, goal, duration)
    if not per_second:
        return []
    found = {
        name: (-unit / per_second, -own / per_second) for name, (unit, own) in _limits(setting.problem, attempt).items()
    }
    return ranked(setting.problem, found, duration)


def _limits(problem: Problem, attempt: Attempt) -> dict[str, tuple[float, float]]:
    """name -> (objective per SI unit of the limit, objective per unit of its own value)."""
    found: dict[str, tuple[float, float]] = {}
    for key, rows in attempt.outcome.prices.items():
        quantity, _, side = key.partition(".")
        symmetric = side != "at_most" and problem.limits.given[quantity].symmetric
        name, outwards = (quantity, 1.0) if symmetric else (key, -1.0 if side == "min" else 1.0)
        unit, own = found.get(name, (0.0, 0.0))
        change = -rows.per_unit * attempt.slope
        found[name] = (unit + outwards * float(np.sum(change)), own + float(change @ rows.own))
    return found


def _by_stretching(problem: Problem, trajectory: Trajectory, found: Mapping[str, tuple[float, float]]) -> float | None:
    """The objective per second of duration, where a longer move is one within wider limits that has been stretched:
    Σ k (limit)(its price) - Σ k (term), over the duration, with k as `trajopt.stretching` has it. None elsewhere."""
    terms, limits = problem.objective.terms, problem.limits.given
    scales = trajectory.scheme.terms > 1 and trajectory.mesh.is_uniform and not problem.objective.ceilings
    named = {*limits, *(term.minimize for term in terms)}
    if not (scales and named <= FALLS.keys() and is_plain(problem, terms)):
        return None
    total = 0.0
    for name, (per_unit, _) in found.items():
        quantity, _, side = name.partition(".")
        limit = limits[quantity]
        total += FALLS[quantity] * per_unit * (limit.lowest if side == "min" else limit.highest)
    for term in terms:
        total -= stretched_cost(term) * Measured.of(trajectory.transcript, term).value
    return total / trajectory.duration


def _time(setting: Setting, attempt: Attempt, goal: Goal, duration: float) -> float | None:
    """The objective per second of duration; None where the mesh itself hangs on times in seconds."""
    problem = setting.problem
    if problem.move.via or not setting.mesh.is_uniform or attempt.outcome.pair is None:
        return None
    if any(limit.varies for limit in problem.limits.given.values()):
        return None
    later, now = (lagrangian(setting, at, goal, attempt) for at in (duration * (1 + _STEP), duration))
    return attempt.slope * (later - now) / (_STEP * duration)


def ranked(problem: Problem, found: dict[str, tuple[float, float]], value: float) -> list[dict[str, Any]]:
    """Rows as `priced` notes them, from name -> (objective per SI unit of the limit, per unit of its own value)."""
    rows: list[dict[str, Any]] = []
    for name in dict.fromkeys([*found, *_names(problem)]):
        unit, own = found.get(name, (0.0, 0.0))
        acts = bool(value) and abs(own) > 1e-6 * abs(value)
        relative = 0.0 if not acts else None if _is_zero(problem, name) else own / 100 / value
        row = {"name": name, "per_unit": unit if acts else 0.0, "unit": _unit(problem, name), "per_percent": relative}
        rows.append(row)
    return sorted(rows, key=lambda row: (not row["per_unit"], -abs(row["per_percent"] or 0.0)))


def _unit(problem: Problem, name: str) -> str:
    quantity, _, side = name.partition(".")
    if side == "at_most":
        (kind,) = {c.term.kind for c in problem.objective.ceilings or () if c.term.label == quantity}
        return "1" if kind is None else units.kinds(problem.rotary)[kind].unit
    return units.kinds(problem.rotary)[quantity].unit


def _names(problem: Problem) -> list[str]:
    """Every limit by the name of its price: as a whole where it is symmetric, else by its sides."""
    names: list[str] = []
    for quantity, limit in problem.limits.given.items():
        sides = [f"{quantity}.{side}" for side in ("min", "max") if getattr(limit, side) is not None]
        names += [quantity] if limit.symmetric else sides
    return names + [f"{ceiling.term.label}.at_most" for ceiling in problem.objective.ceilings or ()]


def _is_zero(problem: Problem, name: str) -> bool:
    """Whether a limit is zero, so that a percentage of it means nothing."""
    quantity, _, side = name.partition(".")
    return side in ("min", "max") and getattr(problem.limits.given[quantity], side) == 0.0


def sentence(row: Mapping[str, Any], name: str, label: str) -> str:
    """``+1 % jerk: -0.42 % peak power``."""
    if row["per_percent"] is None:
        return f"{name}: {row['per_unit']:+.3g} {label} per {row['unit']}"
    return f"+1 % {name}: {100 * row['per_percent']:+.3g} % {label}"
