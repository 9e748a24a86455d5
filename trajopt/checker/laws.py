"""Laws of motion checked: ends, smoothness, objective and broken limits of each, recomputed from its coefficients."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.polynomial import chebyshev

from trajopt.checker.case import POWERS, TOTALS, VALUE, Array, Case
from trajopt.checker.float_twin import FloatTwin
from trajopt.checker.reading import ends, stated
from trajopt.checker.report import Check, question, to_float
from trajopt.checker.values import Malformed, mapping, number, shown, vector

FORMAT: Final = "trajopt profiles 1"
_PARTS: Final = 64  # of every piece: short enough for powers
_END: Final = 1e-9  # of the stroke, and of it over the time, its square …
_DEGREES: Final = 64
_DOUBT: Final = (1e-7, 1e-5)  # relative: a limit exceeded by so much may or may not be called broken
_KINDS: Final = {"l1": "l1", "l2": "rms", "linf": "peak"}
_ENERGIES: Final = {"energy": "l1", "copper_loss": "copper", "electrical_energy": "drawn"}


def law_checks(result: Mapping[str, Any], notes: list[str]) -> list[Check]:
    """Every check of a file of profiles; what is not as it should be is a failed one."""
    try:
        problem = mapping(result.get("problem"), "problem")
        laws = result.get("laws")
        if not isinstance(laws, list | tuple) or not laws:
            raise Malformed("laws is missing or empty")
        best = mapping(result.get("best"), "best")
        checks = [question("structure")]
        for law in laws:
            checks += _law(problem, mapping(law, "a law"), best.get("objective"), notes)
        return checks
    except Malformed as fault:
        return [question("structure", str(fault))]


def _law(problem: Mapping[str, Any], law: Mapping[str, Any], best: Any, notes: list[str]) -> list[Check]:
    name = str(law.get("name"))
    case, jumps = _case(problem, law, notes)
    conditions = {"JF": 2, "J0": 3}.get(str(law.get("ends")), 1)
    with np.errstate(all="ignore"):
        twin = FloatTwin(case)
        value = _objective(twin)
        off = min(abs(x - case.objective) for x in value)
        tolerance = VALUE * abs(case.objective)
        checks = [Check(f"{name} objective", off, tolerance, None, bool(off <= tolerance))]
        checks += [Check(f"{name} smoothness", jumps, _END, None, jumps <= _END)]
        checks += [_end(name, case, problem, which, conditions) for which in ("start", "end")]
        checks.append(question(f"{name} limits", _broken_fault(twin, law.get("breaks"))))
    if best is not None:
        above = case.objective / number(best, "best.objective") - 1
        off = abs(number(law.get("above"), f"{name}.above") - above)
        checks.append(Check(f"{name} above the best", off, VALUE, None, off <= VALUE))
    return checks


def _case(problem: Mapping[str, Any], law: Mapping[str, Any], notes: list[str]) -> tuple[Case, float]:
    """The law as a chain of integrators up to its degree, and the largest jump of position or velocity inside."""
    parts = stated(problem, notes)
    start, end = ends(problem, 2)
    duration = parts["move_time"]
    if not isinstance(duration, float) or 0 not in start or 0 not in end:
        raise Malformed("a profile needs a fixed time between given positions")
    pieces = law.get("pieces")
    if not isinstance(pieces, list | tuple) or not pieces:
        raise Malformed(f"{law.get('name')} has no pieces")
    borders, tables = [0.0], []
    for piece in pieces:
        one = mapping(piece, "a piece", ("from", "to", "coefficients"))
        coefficients = vector(one.get("coefficients"), "coefficients")
        if not 1 <= len(coefficients) <= _DEGREES or number(one.get("from"), "from") != borders[-1]:
            raise Malformed(f"{law.get('name')}: pieces must join, and have 1 to {_DEGREES} coefficients")
        borders.append(number(one.get("to"), "to"))
        tables.append(coefficients)
    if abs(borders[-1] - 1) > _END or min(np.diff(borders)) <= 0:
        raise Malformed(f"{law.get('name')}: pieces must run from 0 to 1")
    order = max(2, *(len(table) - 1 for table in tables))
    half, middle = (end[0] - start[0]) / 2, (end[0] + start[0]) / 2
    time, rows, jumps = [np.zeros(1)], [], 0.0
    for k, table in enumerate(tables):
        x = np.linspace(-1.0, 1.0, _PARTS + 1)
        rows.append(_derivatives(table, x, order, borders[k + 1] - borders[k]))
        time.append(borders[k] + (borders[k + 1] - borders[k]) * (x[1:] + 1) / 2)
        if k:
            jumps = max(jumps, float(np.max(np.abs(rows[-1][:2, 0] - rows[-2][:2, -1]))))
    chain = np.hstack([*(row[:, :-1] for row in rows), rows[-1][:, -1:]])
    scaled = chain * (half / duration ** np.arange(order + 1.0))[:, None]
    scaled[0] += middle
    signal = (*scaled[:-1], scaled[-1][:-1])
    case = Case(
        scheme="exact", order=order, time=np.concatenate(time) * duration, signal=signal, start=start, end=end, via=(),
        objective=number(law.get("objective"), "objective"), duration=duration, metrics={}, lower_bound=None, gap=None,
        has_certificate=False, **parts,
    )  # fmt: skip
    return case, jumps


def _derivatives(table: Array, x: Array, order: int, span: float) -> Array:
    """(order + 1, places) derivatives by the fraction of the time of a piece that takes ``span`` of it."""
    found = np.zeros((order + 1, len(x)))
    for i in range(min(order, len(table) - 1) + 1):
        found[i] = chebyshev.chebval(x, chebyshev.chebder(table, i)) * (2 / span) ** i
    return found


def _objective(twin: FloatTwin) -> list[float]:
    """The objective, for each way to see friction at rest."""
    totals = [0.0]
    for name, norm, weight in twin.case.terms:
        kind = _ENERGIES.get(name) or _KINDS.get(str(norm))
        if kind is None or name in ("time", "position"):
            raise Malformed(f"the objective {name} {norm} is none that profiles are compared by")
        values = [to_float(x) for x in twin.metric_between(kind, POWERS.get(name, name))]
        totals = [total + weight * value for total in totals for value in values]
    return totals


def _end(name: str, case: Case, problem: Mapping[str, Any], which: str, conditions: int) -> Check:
    """At each end the position, and no velocity, acceleration … as far as the law says so."""
    node = 0 if which == "start" else -1
    stroke, wanted = abs(case.end[0] - case.start[0]), case.start if which == "start" else case.end
    off = abs(case.signal[0][node] - wanted[0]) / stroke
    for i in range(1, conditions + 1):
        off = max(off, abs(case.signal[i][node]) * case.duration**i / stroke)
    return Check(f"{name} {which}", float(off), 1e3 * _END, None, bool(off <= 1e3 * _END))


def _broken_fault(twin: FloatTwin, claimed: Any) -> str:
    if not isinstance(claimed, list | tuple):
        return f"breaks is {shown(claimed)}"
    for name in twin.case.limits:
        if name.startswith("envelope") or name in ("brake_energy", "snap"):
            continue
        size = max(abs(x) for side in twin.case.limits[name] if side is not None for x in side.value)
        ask = twin.excess_in_total(name) if name in TOTALS else twin.excess(name, _DOUBT[0] * size)
        share = to_float(ask.violation) / size if size else math.inf
        if (share > _DOUBT[1] and name not in claimed) or (share < _DOUBT[0] and name in claimed):
            return f"{name} is exceeded by {share:.3g} of it, and breaks says {list(claimed)}"
    return ""
