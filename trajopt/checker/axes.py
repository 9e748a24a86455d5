"""The checks of a motion of several axes: each axis as a move of its own, then what couples them.

The kinematics of every axis go to the two twins. Torque and power of an arm are recomputed by a formulation of the
checker's own (`trajopt.checker.arm`) and followed between the nodes by the polynomial through their values on every
interval. Tolerances, relative: as for moves; limits on torque and power, and the width of a path, which are held at the
nodes, 1e-6 there and 1e-5 between them; tip velocity 1e-6; energy against the work of the joints 1e-6.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from trajopt.checker.axes_reading import FORMAT, Moved, read_moved, terms_of
from trajopt.checker.case import DERIVATIVES, VALUE, Array, Case, certificate_checks, time_checks
from trajopt.checker.joint_twin import JointTwin, horner
from trajopt.checker.questions import STRICT, USUAL, decide, metric_names
from trajopt.checker.reading import certificate_of
from trajopt.checker.report import Check, question, to_float
from trajopt.checker.result_file import _text as read_text
from trajopt.checker.tip import on_the_path, path_of, thrown
from trajopt.checker.values import number

__all__ = ["FORMAT", "axes_checks", "motion_table_fault"]
_BETWEEN: Final = 1e-5  # of a limit on torque or power, which samples between the nodes hold
_SMOOTH: Final = 1e-7  # of the peak torque: what the polynomials may miss it by
_TIME: Final = 1e-12
_PRINTED: Final = 1e-15


def axes_checks(result: Mapping[str, Any], strict: bool, notes: list[str]) -> tuple[list[Check], bool]:
    """Everything that is checked of a motion, and whether rational numbers had a say. Never raises on the content."""
    try:
        with np.errstate(all="ignore"):
            moved = read_moved(result, notes)
            if moved is None:
                notes.append(f"the verdict {result['status']} (nothing in the file proves it)")
                return [question("structure")], strict
            checks, rational = [question("structure"), *_of_the_whole(moved)], False
            for k, name in enumerate(moved.names):
                own, decided = _of_the_axis(moved, k, strict, notes)
                rational |= decided
                checks += [replace(check, name=f"{check.name} of {name}") for check in own]
            return [*checks, *_of_the_arm(moved, notes), *_of_the_certificate(result, moved, notes)], rational
    except np.linalg.LinAlgError as error:
        return [question("structure", f"its numbers do not stay finite: {error}")], False
    except (ValueError, OverflowError, RecursionError, AttributeError) as fault:  # Malformed among them
        return [question("structure", str(fault) or "nested too deeply")], False


def _of_the_whole(moved: Moved) -> list[Check]:
    """The objective and the shared duration."""
    ends = [case.end_time for case in moved.cases]
    shared = moved.problem["move"].get("shared", True)
    spread = max(ends) - min(ends) if shared else 0.0
    off = max(abs(moved.duration - max(ends)), spread)
    checks = [Check("one duration", off, _TIME * moved.duration, None, off <= _TIME * moved.duration)]
    found = _objective(moved)
    off, tolerance = abs(found - moved.objective), VALUE * abs(moved.objective)
    note = f"says {moved.objective!r}, recomputed {found!r}" if off else ""
    return [*checks, Check("objective", off, tolerance, None, off <= tolerance, note)]


def _objective(moved: Moved) -> float:
    """The nearest to the claim over the conventions of friction at rest (all zero on an arm)."""
    conventions = max(len(case.conventions("power")) for case in moved.cases)
    terms = list(terms_of(moved.problem))
    values = [sum(_value(moved, *term, convention) for term in terms) for convention in range(conventions)]
    return min(values, key=lambda value: abs(value - moved.objective))


def _value(
    moved: Moved, name: str, norm: str | None, shares: tuple[float, ...], combine: str, convention: int
) -> float:
    if name == "time":
        return shares[0] * moved.duration
    pairs = zip(moved.twins, shares, strict=True)
    values = [share * twin.term(name, norm, convention)[0] for twin, share in pairs if share]
    return max(values) if combine == "max" else sum(values)


def _of_the_axis(moved: Moved, k: int, strict: bool, notes: list[str]) -> tuple[list[Check], bool]:
    """Kinematics of one axis by both twins; of a gantry's axis its force and power, too."""
    case = moved.cases[k]
    kinematic = replace(case, terms=(("time", None, 1.0),), objective=case.duration)
    if moved.armed:
        limits = {name: limit for name, limit in case.limits.items() if name in DERIVATIVES}
        own = {name: x for name, x in case.metrics.items() if name in _kinematic(case)}
        kinematic = replace(kinematic, limits=limits, metrics=own)
    checks, rational = decide(kinematic, strict, notes)
    checks = [*time_checks(case), *(check for check in checks if check.name != "objective")]
    return checks + (_of_the_joint(moved, k, strict, notes) if moved.armed else []), rational


def _kinematic(case: Case) -> tuple[str, ...]:
    return metric_names(replace(case, inertia=None, motor=None))


def _of_the_joint(moved: Moved, k: int, strict: bool, notes: list[str]) -> list[Check]:
    """Limits and metrics of torque and power."""
    case, twin = moved.cases[k], moved.twins[k]
    assert isinstance(twin, JointTwin)
    between, checks = moved.limbs is not None and case.scheme == "exact", []
    if between:
        missed = twin.missed()
        checks.append(Check("torque between nodes", missed, _SMOOTH, None, missed <= _SMOOTH))
    for name in [name for name in case.limits if name not in DERIVATIVES]:
        checks += _limit_checks(case, twin, name, between, STRICT if strict else USUAL)
    for name, claimed in case.metrics.items():
        if name in _kinematic(case):
            continue
        if name not in metric_names(case) or not (between or case.scheme == "euler"):
            notes.append(f"metrics.{moved.names[k]}.{name}")
            continue
        found = to_float(twin.metric(name)[0])
        off, tolerance = abs(found - claimed), VALUE * abs(claimed) + 1e-12
        note = f"says {claimed!r}, recomputed {found!r}" if off else ""
        checks.append(Check(f"metric {name}", off, tolerance, None, off <= tolerance, note))
    return checks


def _limit_checks(case: Case, twin: JointTwin, name: str, between: bool, relative: float) -> list[Check]:
    sides = case.limits[name]
    size = max(abs(x) for side in sides if side is not None for x in side.value)
    if name == "rms_force":
        found, most = twin.total(name) if between or case.scheme == "euler" else np.inf, sides[1]
        assert most is not None
        off = max(found - most.value[0], 0.0)
        return [Check("limit rms_force", off, _BETWEEN * size, None, off <= _BETWEEN * size)]
    checks = []
    for label, ask, tolerance in (
        (f"limit {name}", twin.excess_at_nodes, relative * size),
        (f"{name} between nodes", twin.excess_between, _BETWEEN * size),
    ):
        if label.startswith("limit") or between:
            found_all = [ask(name, sign, side, tolerance) for sign, side in zip((-1, 1), sides, strict=True) if side]
            worst = max(found_all, key=lambda found: to_float(found.violation))
            off = to_float(worst.violation)
            checks.append(Check(label, off, tolerance, worst.time, off <= tolerance))
    return checks


def _of_the_arm(moved: Moved, notes: list[str]) -> list[Check]:
    """The tip, and the balance of energy and work."""
    if not moved.armed:
        return []
    if moved.limbs is None:
        notes += ["torque as a function of the motion (the arm is not the checker's)"]
        notes += ["tip"] if moved.problem.get("tip") is not None else []
        return []
    q, w = (np.array([case.signal[i] for case in moved.cases]) for i in range(2))
    checks = [] if moved.cases[0].scheme == "euler" else [_balance(moved, q, w)]
    tip = moved.problem.get("tip")
    if isinstance(tip, Mapping) and tip.get("velocity") is not None:
        checks += thrown(moved.limbs, tip, moved.release, moved.cases[0].time, q, w)
    if isinstance(tip, Mapping) and (path := path_of(tip)) is not None:
        width = number((tip.get("line") or tip["curve"]).get("width"), "tip.width")
        checks += on_the_path(moved.limbs, path, width, q, _between(moved))
    return checks


def _between(moved: Moved) -> list[Array]:
    """The joint angles on 16 parts of every interval (exact scheme), a sample of all intervals each."""
    if moved.cases[0].scheme == "euler":
        return []
    pieces = moved.twins[0].pieces
    rows = [twin.rows(0, pieces) for twin in moved.twins]
    return [np.array([horner(own, s) for own in rows]) for s in np.arange(1, 16) / 16]


def _balance(moved: Moved, q: Array, w: Array) -> Check:
    """What the joints did, less friction, against the energy that the arm gained."""
    assert moved.limbs is not None
    done = scale = 0.0
    for twin in moved.twins:
        rows, length = twin.polynomial("power")[0], twin.pieces_of("power").length
        done += float(length @ (rows @ (1 / np.arange(1, rows.shape[1] + 1))))
        friction = twin.case.viscous * to_float(twin.metric("rms_velocity")[0]) ** 2 * twin.case.end_time
        done, scale = done - friction, scale + to_float(twin.metric("energy")[0])
    energy = moved.limbs.energy(q, w)
    off, tolerance = abs(done - float(energy[-1] - energy[0])), VALUE * scale + 1e-12
    return Check("energy balance", off, tolerance, None, off <= tolerance)


def _of_the_certificate(result: Mapping[str, Any], moved: Moved, notes: list[str]) -> list[Check]:
    found = certificate_of(result.get("certificate"))
    return certificate_checks(replace(moved.cases[0], objective=moved.objective, **found), notes)


def motion_table_fault(path: Path, result: Mapping[str, Any]) -> str:
    """What a trajectory.csv says otherwise than the result of several axes; empty when it says the same. The columns of
    axes whose nodes are not all nodes are not compared."""
    try:
        with np.errstate(all="ignore"):
            moved = read_moved(result, [])
        rows = [row.split(",") for row in read_text(path).splitlines() if row and not row.startswith("#")]
        given = np.array([[float(cell) for cell in row] for row in rows[1:]])
    except (ValueError, OverflowError, RecursionError) as error:
        return f"cannot be compared: {error}"
    if moved is None:
        return "carries numbers although the result is no solution"
    time = np.unique(np.concatenate([case.time for case in moved.cases]))
    names = [cell.partition(" ")[0] for cell in rows[0]]
    if given.shape != (len(time), len(names)) or len(set(names)) != len(names):
        return f"has {len(given)} rows where {len(time)} belong, or ragged or repeated columns"
    for name, wanted in _columns(moved, time).items():
        if name not in names:
            return f"has no column {name}"
        found = given[:, names.index(name)]
        if not np.all(np.abs(found - wanted) <= _PRINTED * np.abs(wanted)):
            return f"column {name} has other numbers than the result"
    return ""


def _columns(moved: Moved, time: Array) -> dict[str, Array]:
    found = {"time": time}
    for name, case in zip(moved.names, moved.cases, strict=True):
        if len(case.time) == len(time):
            found |= {f"{name}.{DERIVATIVES[i]}": case.signal[i] for i in range(case.order)}
    return found
