"""The checks of a Pareto front: every point's result, no point below a bound, and the error recomputed from both.

The lower bounds themselves rest on dual vectors that are not in the files; what is checked is that each is the bound
that a point's own certificate states, that no point anywhere lies below it, and that the error follows from them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations, product
from pathlib import Path
from typing import Any, Final

import numpy as np

from trajopt.checker.case import EPS, TOTALS, VALUE, Array, Case
from trajopt.checker.checking import check_file
from trajopt.checker.float_twin import FloatTwin
from trajopt.checker.reading import read
from trajopt.checker.report import Check, question, to_float
from trajopt.checker.result_file import CheckerInputError, read_json
from trajopt.checker.values import Malformed, shown

_PLACE: Final = re.compile(r"points/[0-9]{3,6}/result\.json")
_KEYS: Final = ("objectives", "points", "planes", "corners", "ideal", "nadir", "error", "convex", "blends", "status")
_BELOW: Final = 1e-6  # relative: a point may lie below a bound by rounding
_ERROR: Final = 1e-6  # of the ranges, between the stated error and ours
_FAR: Final = 1e9
_COUNTED: Final = 4.0  # ranges: moves that are worse than that in an objective do not count
_MANY: Final = 60  # points of three objectives: with more, there are more corners than can be looked at
_MOST_BLENDS: Final = 100_000  # of two neighbours: more would keep the check busy for minutes
_NONCONVEX: Final = ("force", "power", "current", "voltage")


@dataclass(frozen=True)
class _Front:
    """``values`` (n, m) recomputed, SI, with the cases they come from; ``weights`` (k, m) and ``least`` (k,) of the
    half-planes, ``corners`` (c, m); ``low`` and ``size`` (m,) normalise."""

    terms: tuple[tuple[str, str | None], ...]
    cases: list[Case]
    values: Array
    weights: Array
    least: Array
    corners: Array
    low: Array
    size: Array
    kept: int  # of the points, those that no other dominates, which come first
    blends: list[int]  # how many moves were blended of each two neighbours among them; none where that means nothing

    def depth(self, corners: Array) -> Array:
        """(u,) how far each of the normalised ``corners`` (u, m) reaches beyond what bounds every move."""
        weights = self.weights * self.size
        planes = (corners @ weights.T + self.weights @ self.low - self.least) / weights.sum(axis=1)
        found: Array = np.min(planes, axis=1, initial=np.inf)
        for corner in (self.corners - self.low) / self.size:
            held = np.isfinite(corner)
            found = np.minimum(found, np.max(corners[:, held] - corner[held], axis=1))
        return found


def front_checks(path: Path, stated: Mapping[str, Any]) -> tuple[list[Check], list[str]]:
    """The checks of a front file, and what could not be checked."""
    notes: list[str] = []
    try:
        entries = _entries(stated)
        if not entries:
            return [question("structure")], ["a front without points"]
        checks, cases, own = _points(path.parent, stated, entries, notes)
        front = _front(stated, cases)
    except (Malformed, CheckerInputError, TypeError, ValueError, KeyError) as fault:
        return [question("structure", f"this is no front: {fault}")], notes
    checks.append(question("structure"))
    checks += _value_checks(front, entries)
    checks.append(_provenance(front, own, notes))
    checks += _bound_checks(front)
    return [*checks, *_error_checks(front, stated, notes)], notes


def _entries(stated: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    for key in _KEYS:
        if key not in stated:
            raise Malformed(f"{key} is missing")
    entries: list[Mapping[str, Any]] = list(stated["points"])
    for entry in entries:
        if not _PLACE.fullmatch(str(entry["result"])):
            raise Malformed(f"a point's result is {shown(entry['result'])}, not in the folder of the points")
    return entries


def _points(
    folder: Path, stated: Mapping[str, Any], entries: list[Mapping[str, Any]], notes: list[str]
) -> tuple[list[Check], list[Case], list[tuple[Any, float | None]]]:
    """The check of each point's result; its case; the weights and the lower bound that it states."""
    checks, cases, own = [], [], []
    for entry in entries:
        report = check_file(folder / entry["result"])
        notes += [note for note in report.not_checked if note not in notes]
        fault = "" if report.passed else "; ".join(map(str, report.failed[:2]))
        checks.append(question(f"point {entry['result'].split('/')[1]}", fault))
        result = read_json(folder / entry["result"])
        case = read(result, [])
        if case is None:
            raise Malformed(f"{entry['result']} is no solution")
        cases.append(case)
        own.append(({(name, norm): weight for name, norm, weight in case.terms}, case.lower_bound))
    timed = any(objective["minimize"] == "time" for objective in stated["objectives"])
    problems = {(case.scheme, case.order, *(() if timed else (case.count, case.end_time))) for case in cases}
    checks.append(question("one mesh", "" if len(problems) <= 1 else "the points are moves on different meshes"))
    return checks, cases, own


def _front(stated: Mapping[str, Any], cases: list[Case]) -> _Front:
    terms = tuple((str(x["minimize"]), x["norm"]) for x in stated["objectives"])
    count = len(terms)
    values = np.array([_values(case, terms) for case in cases]).reshape(-1, count)
    weights = np.array([plane["weights"] for plane in stated["planes"]], dtype=float).reshape(-1, count)
    least = np.array([plane["value"] for plane in stated["planes"]], dtype=float)
    corners = [[np.inf if x is None else float(x) for x in corner] for corner in stated["corners"]]
    low, high = np.array(stated["ideal"], dtype=float), np.array(stated["nadir"], dtype=float)
    if np.any(weights < 0) or not np.all(np.isfinite(weights)) or not np.all(np.isfinite(least)):
        raise Malformed("a half-plane has negative weights, or numbers that are not finite")
    size = np.where(high - low > 1e-6 * np.abs(high), high - low, np.maximum(np.abs(high), 1e-300))
    kept = sum(entry["on_front"] is True for entry in stated["points"])
    blends = list(stated["blends"])
    if len(blends) not in (0, kept - 1) or not all(type(x) is int and 0 <= x <= _MOST_BLENDS for x in blends):
        raise Malformed(f"blends must be whole numbers, one for each two neighbours: {shown(stated['blends'])}")
    return _Front(terms, cases, values, weights, least, np.array(corners).reshape(-1, count), low, size, kept, blends)


def _values(case: Case, terms: tuple[tuple[str, str | None], ...]) -> list[float]:
    twin = FloatTwin(case)
    return [twin.term(name, norm, 0)[0] for name, norm in terms]


def _value_checks(front: _Front, entries: list[Mapping[str, Any]]) -> list[Check]:
    """The objectives of every point, stated against recomputed."""
    found = []
    for k, (name, norm) in enumerate(front.terms):
        given = np.array([float(entry["values"][k]) for entry in entries])
        off = float(np.max(np.abs(given - front.values[:, k]), initial=0.0))
        tolerance = VALUE * float(np.max(np.abs(front.values[:, k]), initial=EPS))
        found.append(Check(f"values {name} {norm or ''}".strip(), off, tolerance, None, off <= tolerance))
    return found


def _provenance(front: _Front, own: list[tuple[Any, float | None]], notes: list[str]) -> Check:
    """Whether every half-plane with the weights of a point's result has the lower bound that is stated there."""
    foreign = 0
    for weights, least in zip(front.weights, front.least, strict=True):
        wanted = {term: float(w) for term, w in zip(front.terms, weights, strict=True) if w > 0}
        bounds = [bound for terms, bound in own if terms == wanted and bound is not None]
        if any(least > bound + VALUE * abs(bound) for bound in bounds):
            return question("bounds", f"a half-plane is at {float(least)!r}, its point's certificate at {bounds[0]!r}")
        foreign += not bounds
    if foreign:
        notes.append(f"{foreign} half-planes that come from no point's own certificate")
    return question("bounds")


def _bound_checks(front: _Front) -> list[Check]:
    """No point lies below a half-plane, nor is it better than a corner in every objective."""
    sums = front.values @ front.weights.T
    below = float(np.max((front.least - sums) / np.maximum(np.abs(sums), 1e-300), initial=0.0))
    checks = [Check("points above the half-planes", below, _BELOW, None, below <= _BELOW)]
    scaled = (front.values - front.low) / front.size
    inside = 0.0
    for corner in (front.corners - front.low) / front.size:
        held = np.isfinite(corner)
        inside = max(inside, float(np.max(np.min(corner[held] - scaled[:, held], axis=1), initial=0.0)))
    return [*checks, Check("points outside the corners", inside, _BELOW, None, inside <= _BELOW)]


def _error_checks(front: _Front, stated: Mapping[str, Any], notes: list[str]) -> list[Check]:
    error, asked = stated["error"], stated.get("asked")
    if error is None:
        notes.append("the error of the front (none is stated)")
        claims = stated["status"] == "SOLVED" and asked is not None
        return [question("error", "SOLVED, but the error asked for is not certified" if claims else "")]
    ours = _error(front, bool(stated["convex"]))
    if ours is None:
        notes.append("the error of the front: too many corners to look at")
        return []
    over = max(ours - float(error), 0.0)
    checks = [Check("error", over, _ERROR, None, over <= _ERROR, f"stated {error!r}, recomputed {ours!r}")]
    late = stated["status"] == "SOLVED" and asked is not None and float(error) > float(asked)
    return [*checks, question("error as asked", f"{error!r} is more than {asked!r}" if late else "")]


def _error(front: _Front, convex: bool) -> float | None:
    """The most by which any move may be better than all that was achieved, in every objective, normalised."""
    points = (front.values - front.low) / front.size
    if convex:
        if points.shape[1] > 2 and len(points) > _MANY:
            return None
        normals = _normals(points)
        below = np.min(points @ normals.T, axis=0) - _vertices(front) @ normals.T  # the most is the distance
        return float(np.max(below, initial=0.0))
    if points.shape[1] == 2:
        moves = np.vstack([front.values, *_blended(front)])
        return float(np.max(front.depth(_stairs((moves - front.low) / front.size)), initial=0.0))
    if len(points) > _MANY:
        return None
    axes = [np.append(points[:, k], _FAR) for k in range(points.shape[1])]
    worst = 0.0
    for first in axes[0]:
        corners = np.array([(first, *rest) for rest in product(*axes[1:])])
        free = ~np.any(np.all(points[None, :, :] < corners[:, None, :], axis=2), axis=1)
        worst = max(worst, float(np.max(front.depth(corners[free]), initial=0.0)))
    return worst


def _stairs(points: Array) -> Array:
    """The corners between points that are worse in one objective and better in the other, and those at the ends."""
    order = np.lexsort((points[:, 1], points[:, 0]))
    x, best = points[order, 0], np.minimum.accumulate(points[order, 1])
    corners = np.column_stack([np.append(x, _FAR), np.concatenate([[_FAR], best])])
    return corners


def _vertices(front: _Front) -> Array:
    """Every place where as many half-planes meet as there are objectives, and that is above all of them; no farther
    than _COUNTED ranges above the best."""
    count = front.weights.shape[1]
    rows = front.weights * front.size
    rows, least = rows / rows.sum(axis=1)[:, None], (front.least - front.weights @ front.low) / rows.sum(axis=1)
    rows, least = np.vstack([rows, -np.eye(count)]), np.append(least, np.full(count, -_COUNTED))
    found = []
    for chosen in combinations(range(len(rows)), count):
        system = rows[list(chosen)]
        if abs(np.linalg.det(system)) > 1e-12:
            found.append(np.linalg.solve(system, least[list(chosen)]))
    corners = np.array(found).reshape(-1, count)
    kept: Array = corners[np.all(corners @ rows.T >= least - 1e-9, axis=1)]
    return kept


def _normals(points: Array) -> Array:
    """(w, m) every direction, of sum one, in which a half-plane can rest on the hull of the points: on as many of them
    as it has weights that are not zero."""
    count = points.shape[1]
    found = [np.eye(count)]
    for size in range(2, count + 1):
        for axes in combinations(range(count), size):
            chosen = np.array(list(combinations(range(len(points)), size)), dtype=int).reshape(-1, size)
            systems = np.ones((len(chosen), size + 1, size + 1))
            systems[:, :size, :size] = points[:, axes][chosen]
            systems[:, size, size] = 0.0
            systems = systems[np.abs(np.linalg.det(systems)) > 1e-14]
            right = np.zeros((len(systems), size + 1, 1))
            right[:, size] = 1.0
            weights = np.linalg.solve(systems, right)[:, :size, 0]
            normals = np.zeros((len(weights), count))
            normals[:, axes] = weights
            found.append(normals[np.all(weights >= 0, axis=1)])
    return np.vstack(found)


def _blended(front: _Front) -> list[Array]:
    """The objectives of moves blended of neighbours, SI; of those that keep the limits that are not convex."""
    order = sorted(range(front.kept), key=lambda k: tuple(front.values[k]))
    found = []
    for i, j, count in zip(order, order[1:], front.blends, strict=False):
        if front.cases[i].end_time != front.cases[j].end_time:
            continue  # moves of different durations cannot be blended
        first, second = front.cases[i], front.cases[j]
        for k in range(1, count + 1):
            share = k / (count + 1)
            signal = tuple((1 - share) * x + share * y for x, y in zip(first.signal, second.signal, strict=True))
            mixed = replace(first, signal=signal)
            if _keeps(mixed):
                found.append(np.array([_values(mixed, front.terms)]))
    return found


def _keeps(case: Case) -> bool:
    twin = FloatTwin(case)
    for name in case.limits:
        found = twin.excess_in_total(name) if name in TOTALS else twin.excess(name, 0.0) if name in _NONCONVEX else None
        size = to_float(twin.total(name)) if name in TOTALS else twin.peak(name)
        if found is not None and to_float(found.violation) > VALUE * size:
            return False
    return True
