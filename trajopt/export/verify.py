"""Whether a written file keeps the limits on the machine: read back, interpolated as the target does, and measured.

The rule. An excess over a limit, relative to it: up to 1e-6 (the checker's own tolerance) passes; up to 1e-3 is warned
of; beyond that the file is refused. Where counts are what the drive differentiates (straight lines, held values), an
excess that comes from rounding to counts alone is warned of, for it moves the axis by less than a count; where
polynomials go through rounded points, it counts in full, for the controller does command it. The end may be off by half
a count, or by 1e-6 of the stroke.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from trajopt import units
from trajopt.export.points import Header, Points
from trajopt.export.reconstruct import SMOOTH, Reconstruction, Seen, reconstruct
from trajopt.fields import Limit
from trajopt.mesh import Floats
from trajopt.problem import DERIVATIVES, TOTALS, Problem
from trajopt.trajectory import Trajectory

PASSES: Final = 1e-6
REFUSED: Final = 1e-3
VERDICTS: Final = ("passed", "warned", "refused")
_INSIDE: Final = np.arange(5) / 5  # where the tracking error is looked at, in each segment
_SLOW: Final = 1e-9  # of the peak velocity: slower than this, friction may be less than in motion


@dataclass(frozen=True)
class Row:
    """What the drive sees of one quantity (SI): its ``peak`` where it is worst, at ``time`` (s), the ``limit`` there or
    None; ``excess`` over it, relative (negative: room); ``unrounded``: what that is without rounding to counts."""

    name: str
    unit: str
    peak: float
    time: float
    limit: float | None
    excess: float | None
    unrounded: float | None
    verdict: str


@dataclass(frozen=True)
class Report:
    """The verification of one file: ``verdict`` passed, warned or refused, with the reasons in ``messages``.

    ``duration`` s of the file; ``end_error`` and ``tracking_error`` (the largest distance to the optimum) m or rad;
    ``not_judged``: limits that it does not look at; ``written``: whether the file was left.
    """

    format: str
    path: str
    verdict: str
    interpolation: str
    points: int
    duration: float
    cycle: float | None
    resolution: float | None
    rows: tuple[Row, ...]
    end_error: float
    tracking_error: float
    messages: tuple[str, ...]
    not_judged: tuple[str, ...]
    written: bool = True

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON data."""
        return vars(self) | {"rows": [vars(row) for row in self.rows]}


def verify(
    format_name: str, path: str, exact: Points, written: Points, header: Header, trajectory: Trajectory, kind: str,
    drive: float | None, rounds: bool,
) -> Report:  # fmt: skip
    """The report on points as ``written`` and read back; ``exact`` are the same before any rounding.

    ``kind``: the target's interpolation; ``drive``: its own cycle (s), where it is finer than the points; ``rounds``:
    whether positions in the file are whole counts, else they are rounded after the interpolation.
    """
    velocities = trajectory.chain[1][[0, -1]]
    ends = (float(velocities[0]), float(velocities[1]))
    seen, ideal = (reconstruct(points, kind, drive, ends) for points in (written, exact))
    rows = tuple(_rows(trajectory.problem, seen, ideal, trajectory.duration, kind))
    end_error, tracking = _errors(trajectory, written, seen, header, rounds)
    messages = [_message(row, kind, header.cycle is not None) for row in rows if row.verdict != "passed"]
    verdicts = [row.verdict for row in rows]
    allowed = max(0.5 * (1 + 1e-6) * (header.count or 0.0), PASSES * _stroke(trajectory))
    if end_error > allowed:
        verdicts.append("refused")
        messages.append(f"the end is missed by {end_error:.3g} (SI), more than half a count or 1e-6 of the stroke")
    worst = max(verdicts, key=VERDICTS.index)
    return Report(
        format_name, path, worst, kind, len(written.time), float(written.time[-1]), header.cycle, header.count, rows,
        end_error, tracking, tuple(messages), _not_judged(trajectory.problem),
    )  # fmt: skip


def _rows(
    problem: Problem, seen: Reconstruction, ideal: Reconstruction, duration: float, kind: str
) -> Iterator[Row]:
    limits, kinds = problem.limits.given, units.kinds(problem.rotary)
    unrounded = _signals(problem, ideal, duration)
    for name, signal in _signals(problem, seen, duration).items():
        limit, unit = limits.get(name), kinds[name].unit
        if limit is None:
            k = int(np.argmax(np.abs(signal.value)))
            if name in DERIVATIVES[1:4]:
                yield Row(name, unit, float(signal.value[k]), float(signal.time[k]), None, None, None, "passed")
            continue
        excess, k, side = _excess(signal, limit, duration)
        alone = _excess(unrounded[name], limit, duration)[0]
        verdict = _verdict(excess, excess if kind in SMOOTH else min(alone, excess))
        yield Row(name, unit, float(signal.value[k]), float(signal.time[k]), side, excess, alone, verdict)


def _verdict(excess: float, refusable: float) -> str:
    return "refused" if refusable > REFUSED else "warned" if excess > PASSES else "passed"


def _excess(signal: Seen, limit: Limit, duration: float) -> tuple[float, int, float]:
    """The largest excess, relative to the limit's size, where it is, and the limit there."""
    sides = limit.at(np.clip(signal.time, 0.0, duration))
    size = max(float(np.max(np.abs(side))) for side in sides if side is not None) or 1.0
    low, high = sides
    over = [(signal.value - high) / size] if high is not None else []
    over += [(low - signal.value) / size] if low is not None else []
    worst = np.max(over, axis=0)
    k = int(np.argmax(worst))
    nearest = min((side[k] for side in sides if side is not None), key=lambda x: abs(x - signal.value[k]))
    return float(worst[k]), k, float(nearest)


def _signals(problem: Problem, seen: Reconstruction, duration: float) -> dict[str, Seen]:
    """What is seen by name: the derivatives and, with a load, what follows from velocity and acceleration."""
    found = {DERIVATIVES[i]: signal for i, signal in seen.derivatives.items()}
    places = seen.derivatives[1].time
    if problem.limits.position is not None:
        found["position"] = Seen(places, seen.position(places))
    load, motor = problem.load, problem.load.motor
    if load.inertia is None or 2 not in seen.derivatives:
        return found
    time, acceleration = seen.derivatives[2].time, seen.derivatives[2].value
    order = np.argsort(places, kind="stable")
    velocity = np.interp(time, places[order], seen.derivatives[1].value[order])
    force = _force(problem, np.clip(time, 0.0, duration), velocity, acceleration)
    given = {"force": force, "power": force * velocity}
    if motor is not None:
        given |= {"current": force / motor[0], "voltage": motor[1] * force / motor[0] + motor[0] * velocity}
    if problem.limits.envelope is not None:
        lines = problem.limits.envelope.lines
        given["envelope"] = np.max([a * np.abs(force) + b * np.abs(velocity) for a, b in lines], axis=0)
    return found | {name: Seen(time, values) for name, values in given.items()}


def _force(problem: Problem, time: Floats, velocity: Floats, acceleration: Floats) -> Floats:
    """inertia·a + viscous·v + coulomb·sign(v), N or N m."""
    load = problem.load
    assert load.inertia is not None
    inertia = load.inertia if isinstance(load.inertia, float) else load.inertia.at(time)
    way: Any = problem.one_way
    if not way:
        slow = _SLOW * float(np.max(np.abs(velocity), initial=0.0)) or 1.0
        way = np.clip(velocity / slow, -1.0, 1.0)
    return np.asarray(inertia * acceleration + load.viscous * velocity + load.coulomb * way)


def _errors(
    trajectory: Trajectory, written: Points, seen: Reconstruction, header: Header, rounds: bool
) -> tuple[float, float]:
    """End error and tracking error, m or rad; with the rounding of a drive that does it after the interpolation."""
    nodes = np.unique(np.concatenate([written.time, trajectory.time]))
    nodes = nodes[nodes <= written.time[-1]]
    time = np.append((nodes[:-1, None] + np.diff(nodes)[:, None] * _INSIDE).ravel(), nodes[-1])
    optimum = trajectory.at(np.minimum(time, trajectory.duration))["position"]
    tracking = float(np.max(np.abs(seen.position(time) - optimum)))
    end = trajectory.chain[0][-1] + trajectory.origin
    reached = float(seen.position(written.time[-1:])[0])
    if header.count is not None and not rounds:
        reached = round(reached / header.count) * header.count
        tracking += header.count / 2
    return abs(reached - float(end)), tracking


def _stroke(trajectory: Trajectory) -> float:
    return float(np.ptp(trajectory.chain[0]))


def _not_judged(problem: Problem) -> tuple[str, ...]:
    names = [problem.shown(name) for name in TOTALS if getattr(problem.limits, name) is not None]
    return (*names, *(["vibration"] if problem.vibration else []))


def _message(row: Row, kind: str, cyclic: bool) -> str:
    assert row.excess is not None and row.unrounded is not None and row.limit is not None
    text = f"{row.name} {row.peak:.6g} {row.unit} exceeds {row.limit:.6g} by {100 * row.excess:.3g} % on the machine"
    if row.unrounded <= PASSES:
        return f"{text}, all of it from rounding to counts: take a finer resolution or points further apart"
    smooth = "nodes (no cycle) or a shorter cycle" if cyclic else "a short cycle"
    better = smooth if kind in SMOOTH else "points at the drive's own cycle"
    return f"{text}: take {better}, or solve with that limit lower by as much"
