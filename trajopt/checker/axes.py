"""The checks of a motion of several axes: each axis as a move of its own, then what couples them.

The kinematics of every axis go to the two twins. Torque and power of an arm are recomputed by a formulation of the
checker's own (`trajopt.checker.arm`) and followed between the nodes by the polynomial through their values on every
interval. Tolerances, relative: as for moves; limits on torque and power, and the width of a path, which are held at the
nodes, 1e-6 there and 1e-3 (2e-2) between them; tip velocity 1e-6; energy against the work of the joints 1e-6.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.polynomial import polynomial

from trajopt.checker.arm import Limbs
from trajopt.checker.case import DERIVATIVES, VALUE, Array, Case, certificate_checks, time_checks
from trajopt.checker.float_twin import FloatTwin, Instants, _Pieces
from trajopt.checker.polynomials import product
from trajopt.checker.questions import STRICT, USUAL, decide, metric_names
from trajopt.checker.reading import FORMAT as OF_A_MOVE
from trajopt.checker.reading import (
    WITH_SOLUTION,
    WITHOUT_SOLUTION,
    Malformed,
    _certificate,
    _finite,
    _mapping,
    _nonnegative,
    _number,
    _vector,
    read,
    shown,
)
from trajopt.checker.report import Check, question, to_float
from trajopt.checker.result_file import _text as read_text

FORMAT: Final = "trajopt axes 1"
BETWEEN: Final = 1e-3  # of a limit on torque or power, which is held at the nodes
_TUBE: Final = 2e-2  # of the width of a path, between the nodes
_TIP: Final = 1e-6
_DEGREE: Final = 8  # of the polynomials through torque
_SMOOTH: Final = 1e-7  # of the peak: what they may miss it by
_TIME: Final = 1e-12
_PRINTED: Final = 1e-15
_NUMBERS: Final = ("objective", "duration", "metrics", "axes")
_KNOWN: Final = ("move", "axes", "arm", "tip", "objective", "transcription", "search", "title", "source", "moral")


class JointTwin(FloatTwin):
    """The float twin of one joint, whose torque follows from the motion of all; ``limbs`` None: from the file."""

    def __init__(self, case: Case, joint: int, limbs: Limbs | None, given: Array | None) -> None:
        super().__init__(case)
        self.joint, self.limbs, self.given = joint, limbs, given
        self.all: Sequence[JointTwin] = (self,)

    def loaded(self, name: str, instants: Instants, velocity: Array, friction: Array) -> Array:
        if self.limbs is None:
            assert self.given is not None
            force = self.given[instants.node]
        else:
            q, w, a = (np.array([twin.sampled(i, instants) for twin in self.all]) for i in range(3))
            force = self.limbs.torque(q, w, a)[self.joint] + self.case.viscous * velocity
        return force * velocity if name == "power" else force

    def loaded_rows(self, name: str, at_rest: float) -> Array:
        if name == "power":
            return product(self.polynomial("force")[0], self.rows(1, self.one_way))
        points = (1 - np.cos(np.pi * np.arange(_DEGREE + 1) / _DEGREE)) / 2
        values = np.array([self.inside(self.one_way, s) for s in points])
        return np.asarray(np.linalg.solve(np.vander(points, increasing=True), values).T)

    def inside(self, pieces: _Pieces, s: float) -> Array:
        """The torque at a fraction of every piece."""
        assert self.limbs is not None
        q, w, a = (np.array([_horner(twin.rows(i, pieces), s) for twin in self.all]) for i in range(3))
        return np.asarray(self.limbs.torque(q, w, a)[self.joint] + self.case.viscous * w[self.joint])

    def missed(self) -> float:
        """By how much of its peak the polynomials miss the torque between the points they were drawn through."""
        rows, pieces = self.polynomial("force")[0], self.one_way
        off = [np.max(np.abs(_horner(rows, s) - self.inside(pieces, s))) for s in (0.07, 0.31, 0.5, 0.83)]
        return float(max(off)) / max(self.peak("force"), 1e-300)

    def noise(self, name: str) -> float:
        return 1e-9 * self.peak(name) if self.case.is_loaded(name) and self.limbs else super().noise(name)


def _horner(rows: Array, s: float) -> Array:
    return np.asarray(rows @ s ** np.arange(rows.shape[1]))


@dataclass(frozen=True)
class Moved:
    """A motion as it was read: a case an axis, of kinematics alone and in full, and the twin of the full one."""

    problem: Mapping[str, Any]
    names: tuple[str, ...]
    cases: tuple[Case, ...]
    twins: tuple[FloatTwin, ...]
    limbs: Limbs | None
    armed: bool
    objective: float
    duration: float
    release: float | None


def axes_checks(result: Mapping[str, Any], strict: bool, notes: list[str]) -> tuple[list[Check], bool]:
    """Everything that is checked of a motion, and whether rational numbers had a say. Never raises on the content."""
    try:
        with np.errstate(all="ignore"):
            moved = _read(result, notes)
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


def _read(result: Mapping[str, Any], notes: list[str]) -> Moved | None:
    for key in ("trajopt", "status", "problem_hash", "problem", *_NUMBERS):
        if key not in result:
            raise Malformed(f"{key} is missing")
    status = result["status"]
    if status in WITHOUT_SOLUTION:
        for key in _NUMBERS:
            if result[key] is not None:
                raise Malformed(f"{status} must carry no numbers, but {key} is not null")
        return None
    if status not in WITH_SOLUTION:
        raise Malformed(f"unknown status {shown(status)}")
    problem = _mapping(result["problem"], "problem", _KNOWN)
    _finite(problem, "problem")
    axes, found = problem.get("axes"), result["axes"]
    if not isinstance(axes, list | tuple) or not isinstance(found, list | tuple) or len(axes) != len(found):
        raise Malformed("axes: as many trajectories as axes are needed")
    arm = problem.get("arm")
    known = isinstance(arm, Mapping) and arm.get("kind") in ("scara", "planar")
    limbs = Limbs.read(arm) if known and isinstance(arm, Mapping) else None
    if limbs is not None and len(limbs.lengths) != len(axes):
        raise Malformed("arm has another number of links than there are axes")
    names = tuple(str(_mapping(axis, "an axis").get("name")) for axis in axes)
    cases = tuple(_case(result, k, arm is not None, notes) for k in range(len(axes)))
    return Moved(
        problem, names, cases, _twins(cases, limbs, found, arm is not None), limbs, arm is not None,
        _number(result["objective"], "objective"), _number(result["duration"], "duration"),
        None if result.get("release") is None else _number(result["release"], "release"),
    )  # fmt: skip


def _twins(cases: Sequence[Case], limbs: Limbs | None, found: Sequence[Any], armed: bool) -> tuple[FloatTwin, ...]:
    if not armed:
        return tuple(FloatTwin(case) for case in cases)
    if any(len(case.time) != len(cases[0].time) or np.any(case.time != cases[0].time) for case in cases):
        raise Malformed("the joints of an arm need one time grid")
    twins = []
    for k, case in enumerate(cases):
        given = None if limbs is not None else _vector(found[k].get("torque"), "axes.torque")
        if given is not None and len(given) != len(case.time):
            raise Malformed("axes.torque needs a value a node")
        twins.append(JointTwin(case, k, limbs, given))
    for twin in twins:
        twin.all = tuple(twins)
    return tuple(twins)


def _case(result: Mapping[str, Any], k: int, armed: bool, notes: list[str]) -> Case:
    """An axis as a move of its own. On an arm its inertia is a placeholder that `JointTwin` never looks at."""
    problem = result["problem"]
    axis, move = _mapping(problem["axes"][k], "an axis"), _mapping(problem.get("move"), "problem.move")
    own, trajectory = _mapping(axis.get("move"), "an axis.move"), _mapping(result["axes"][k], "axes").get("trajectory")
    terms = [{"minimize": name, "norm": norm, "weight": 1.0} for name, norm, _, _ in _terms(problem)]
    load = dict(_mapping(axis.get("load", {}), "load"))
    if armed and load.keys() - {"inertia", "viscous", *_DEFAULTS}:
        raise Malformed("the load of a joint is the arm")
    if armed:
        load = {"inertia": 1.0, "viscous": load.get("viscous", 0.0)}
    path = isinstance(problem.get("tip"), Mapping) and _path(problem["tip"]) is not None
    start, end = ({**own.get(key, {}), **({"position": "free"} if path else {})} for key in ("start", "end"))
    time, ended = move.get("time"), _vector(_mapping(trajectory, "trajectory").get("time"), "trajectory.time")
    name = f"{axis.get('name')}."
    metrics = _mapping(result["metrics"], "metrics")
    case = read(
        {
            **result, "format": OF_A_MOVE, "objective": 0.0, "certificate": None, "trajectory": trajectory,
            "duration": result["duration"] if move.get("shared", True) else float(ended[-1]),
            "metrics": {key.removeprefix(name): x for key, x in metrics.items() if key.startswith(name)},
            "problem": {
                "move": {"time": time, "start": start, "end": end, "via": own.get("via", ()),
                         "dwell": move.get("dwell", 0.0)},
                "limits": axis.get("limits", {}), "load": load, "objective": {"terms": terms},
                "transcription": problem.get("transcription"), "rotary": axis.get("rotary", False),
            },
        },
        notes,
    )  # fmt: skip
    assert case is not None
    return case


_DEFAULTS: Final = ("coulomb", "switching", "eddy", "hysteresis", "hysteresis_exponent", "recovery")


def _terms(problem: Mapping[str, Any]) -> Iterator[tuple[str, str | None, tuple[float, ...], str]]:
    """(quantity, norm, weight an axis, sum or max) of every term; the time has one weight."""
    count = len(problem["axes"])
    for term in _mapping(problem.get("objective"), "objective").get("terms", ()):
        term = _mapping(term, "an objective term", ("minimize", "norm", "weight", "axes", "combine"))
        weight, shares = _nonnegative(term.get("weight", 1.0), "weight"), term.get("axes")
        own = np.ones(count) if shares is None else _vector(shares, "objective.axes")
        if len(own) != count or np.any(own < 0) or term.get("combine", "sum") not in ("sum", "max"):
            raise Malformed("an objective term needs a weight an axis, and combine sum or max")
        if term.get("minimize") == "time":
            own = np.ones(1)
        yield str(term.get("minimize")), term.get("norm"), tuple(weight * own), term.get("combine", "sum")


def _of_the_whole(moved: Moved) -> list[Check]:
    """The objective and the shared duration."""
    ends = [case.end_time for case in moved.cases]
    shared = moved.problem["move"].get("shared", True)
    spread = max(ends) - min(ends) if shared else 0.0
    off = max(abs(moved.duration - max(ends)), spread)
    checks = [Check("one duration", off, _TIME * moved.duration, None, off <= _TIME * moved.duration)]
    found = _objective(moved) if shared else max(ends)
    off, tolerance = abs(found - moved.objective), VALUE * abs(moved.objective)
    note = f"says {moved.objective!r}, recomputed {found!r}" if off else ""
    return [*checks, Check("objective", off, tolerance, None, off <= tolerance, note)]


def _objective(moved: Moved) -> float:
    """The nearest to the claim over the conventions of friction at rest (all zero on an arm)."""
    conventions = max(len(case.conventions("power")) for case in moved.cases)
    terms = list(_terms(moved.problem))
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
        return [Check("limit rms_force", off, BETWEEN * size, None, off <= BETWEEN * size)]
    checks = []
    for label, ask, tolerance in (
        (f"limit {name}", twin.excess_at_nodes, relative * size),
        (f"{name} between nodes", twin.excess_between, BETWEEN * size),
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
        checks += _thrown(moved, tip, q, w)
    if isinstance(tip, Mapping) and (path := _path(tip)) is not None:
        checks += _on_the_path(moved, path, _number((tip.get("line") or tip["curve"]).get("width"), "width"), q, w)
    return checks


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


def _thrown(moved: Moved, tip: Mapping[str, Any], q: Array, w: Array) -> list[Check]:
    assert moved.limbs is not None
    at, end, asked = moved.release, moved.duration, tip.get("release", "end")
    if at is None or not 0 < at <= end * (1 + _TIME):
        return [question("release", "the time of the release is missing, or not within the motion")]
    wanted = end if asked == "end" else at if asked == "free" else _number(asked, "tip.release")
    k = moved.cases[0].nearest(at)
    off = max(abs(at - wanted), abs(float(moved.cases[0].time[k]) - at))
    checks = [Check("release", off, 1e3 * _TIME * end, at, off <= 1e3 * _TIME * end)]
    velocity = complex(*_vector(tip["velocity"], "tip.velocity"))
    miss = float(abs(moved.limbs.tip(q[:, k : k + 1], w[:, k : k + 1])[1][0] - velocity))
    tolerance = _TIP * max(abs(velocity), 1e-3)
    return [*checks, Check("tip velocity", miss, tolerance, at, miss <= tolerance)]


def _path(tip: Mapping[str, Any]) -> Array | None:
    """The complex coefficients of the path that the tip follows, lowest power of the path parameter first."""
    if tip.get("line") is not None:
        line = _mapping(tip["line"], "tip.line", ("start", "end", "width", "elbow"))
        start, end = (complex(*_vector(line.get(key), f"tip.line.{key}")) for key in ("start", "end"))
        return np.array([start, end - start])
    if tip.get("curve") is None:
        return None
    curve = _mapping(tip["curve"], "tip.curve", ("x", "y", "width", "elbow"))
    x, y = (_vector(curve.get(key), f"tip.curve.{key}") for key in ("x", "y"))
    found = np.zeros(max(len(x), len(y), 2), dtype=complex)
    found[: len(x)] += x
    found[: len(y)] += 1j * y
    return found


def _on_the_path(moved: Moved, path: Array, width: float, q: Array, w: Array) -> list[Check]:
    """The ends, and the distance from the path at the nodes and on 16 parts of every interval."""
    assert moved.limbs is not None
    place, length = moved.limbs.tip(q, w)[0], float(np.sum(np.abs(path[1:])))
    checks = []
    for label, found, wanted in (("path start", place[0], path[0]), ("path end", place[-1], np.sum(path))):
        off = float(abs(found - wanted))
        checks.append(Check(label, off, _TIP * length, None, off <= _TIP * length))
    moments = [place]
    if moved.cases[0].scheme == "exact":
        for s in np.arange(1, 16) / 16:
            rows = [np.array([_horner(twin.rows(i, moved.twins[0].pieces), s) for twin in moved.twins]) for i in (0, 1)]
            moments.append(moved.limbs.tip(*rows)[0])
    for label, found, share in (("path", moments[0], _TIP), ("path between nodes", np.concatenate(moments), _TUBE)):
        over = max(float(np.max(_distance(path, found))) - width / 2, 0.0)
        checks.append(Check(label, over, share * width, None, over <= share * width))
    return checks


def _distance(path: Array, points: Array) -> Array:
    """How far points are from a path: from the nearest of 1001 of its points, then by Newton's method."""
    grid = np.linspace(0.0, 1.0, 1001)
    first, second = polynomial.polyder(path), polynomial.polyder(path, 2)
    s = grid[np.argmin(np.abs(points[:, None] - polynomial.polyval(grid, path)), axis=1)]
    for _ in range(4):
        off, slope = polynomial.polyval(s, path) - points, polynomial.polyval(s, first)
        bend = np.abs(slope) ** 2 + (np.conj(off) * polynomial.polyval(s, second)).real
        s = np.clip(s - (np.conj(off) * slope).real / np.where(bend > 0, bend, np.inf), 0.0, 1.0)
    return np.asarray(np.abs(polynomial.polyval(s, path) - points))


def _of_the_certificate(result: Mapping[str, Any], moved: Moved, notes: list[str]) -> list[Check]:
    found = _certificate(result.get("certificate"))
    return certificate_checks(replace(moved.cases[0], objective=moved.objective, **found), notes)


def motion_table_fault(path: Path, result: Mapping[str, Any]) -> str:
    """What a trajectory.csv says otherwise than the result of several axes; empty when it says the same. The columns of
    axes whose nodes are not all nodes are not compared."""
    try:
        with np.errstate(all="ignore"):
            moved = _read(result, [])
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
