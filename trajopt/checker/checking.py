"""The checks of one result, put together."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from trajopt.checker.axes import FORMAT as AXES
from trajopt.checker.axes import axes_checks, motion_table_fault
from trajopt.checker.case import certificate_checks, time_checks
from trajopt.checker.command import FORMAT, REST, command_checks, steps_checks
from trajopt.checker.float_twin import FloatTwin
from trajopt.checker.laws import FORMAT as PROFILES
from trajopt.checker.laws import law_checks
from trajopt.checker.questions import STRICT, USUAL, decide, metric_names
from trajopt.checker.reading import read
from trajopt.checker.report import Check, Report, question
from trajopt.checker.result_file import CheckerInputError, read_json, table_fault
from trajopt.checker.values import Malformed
from trajopt.checker.vibration import vibration_checks

FRONT: Final = "trajopt front 1"


def check(result: Mapping[str, Any], problem: Mapping[str, Any] | None = None, *, strict: bool = False) -> Report:
    """Check one result; with ``problem`` (its canonical data) also that the result answers that problem.

    Never raises on the content of ``result``: whatever is wrong with it is a failed check.
    """
    notes: list[str] = []
    checks = _identity(result, problem)
    if isinstance(result, Mapping) and result.get("format") == FORMAT:
        return replace(_report([*checks, *command_checks(result, notes)], False, strict, notes), tolerance=REST)
    if isinstance(result, Mapping) and result.get("format") == PROFILES:
        return _report([*checks, *law_checks(result, notes)], False, strict, notes)
    if isinstance(result, Mapping) and result.get("format") == AXES:
        decided, rational = axes_checks(result, strict, notes)
        return _report([*checks, *decided], rational, strict, notes)
    try:
        case = read(result, notes)
    except Malformed as fault:
        return _report([*checks, question("structure", str(fault))], False, strict, notes)
    checks.append(question("structure"))
    if case is None:
        notes.append(f"the verdict {result['status']} (its proof was checked when found, and is not in the file)")
        return _report(checks, strict, strict, notes)
    checks += [*time_checks(case), *certificate_checks(case, notes), *vibration_checks(case)]
    decided, rational = decide(case, strict, notes)
    return _report(checks + decided, rational, strict, notes)


def check_file(path: str | os.PathLike[str], problem: Mapping[str, Any] | None = None, strict: bool = False) -> Report:
    """Check the result file at ``path``, its seal, and a trajectory.csv or command.csv beside a result.json, which must
    say the same.

    Of a front.json every point's result is checked, and what is claimed of the front (see `trajopt.checker.front`).
    Raises CheckerInputError when the file cannot be read as JSON data at all.
    """
    result = read_json(Path(path))
    if result.get("format") == FRONT:
        from trajopt.checker.front import front_checks

        found, unknown = front_checks(Path(path), result)
        return _report([question("seal", _seal_fault(result)), *found], False, strict, unknown)
    report = check(result, problem, strict=strict)
    report = replace(report, checks=(question("seal", _seal_fault(result)), *report.checks))
    if result.get("format") == FORMAT:
        return replace(report, checks=(*report.checks, *steps_checks(Path(path), result)))
    table = Path(path).with_name("trajectory.csv")
    if Path(path).name != "result.json" or not os.path.lexists(table):
        return report
    notes: list[str] = []
    if result.get("format") == AXES:
        return replace(report, checks=(*report.checks, question("trajectory.csv", motion_table_fault(table, result))))
    try:
        case = read(result, notes)
        fault = table_fault(table, case, notes)
    except Malformed as malformed:
        fault = f"cannot be compared, {malformed}"
    checks = (*report.checks, question("trajectory.csv", fault))
    return replace(report, checks=checks, not_checked=tuple(dict.fromkeys((*report.not_checked, *notes))))


def measure(result: Mapping[str, Any]) -> dict[str, float]:
    """The metrics of a result's trajectory (SI), recomputed in floats; what is claimed of it is not looked at.

    Raises CheckerInputError when there is no trajectory, or none that can be read.
    """
    try:
        case = read({**result, "objective": 0.0, "metrics": {}, "certificate": None}, [])
    except Malformed as fault:
        raise CheckerInputError(f"nothing to measure: {fault}") from None
    if case is None:
        raise CheckerInputError(f"nothing to measure: {result.get('status')} carries no trajectory")
    with np.errstate(all="ignore"):
        twin = FloatTwin(case)
        return {name: float(twin.metric(name)[0]) for name in metric_names(case)}


def _report(checks: list[Check], rational: bool, strict: bool, notes: list[str]) -> Report:
    return Report(tuple(checks), "rational" if rational else "float", STRICT if strict else USUAL, tuple(notes))


def _identity(result: Mapping[str, Any], problem: Mapping[str, Any] | None) -> list[Check]:
    """Whether the result carries the problem it was made for, and the one it is asked about."""
    own = result.get("problem") if isinstance(result, Mapping) else None
    fault = ""
    if not isinstance(own, Mapping) or result.get("problem_hash") != (_hash(own) or "none"):
        fault = "problem_hash does not fit: the file was edited, or its numbers belong to another problem"
    checks = [question("problem hash", fault)]
    if problem is not None:
        checks.append(question("same problem", "" if _same(problem, own) else "the result belongs to another problem"))
    return checks


def _seal_fault(result: Mapping[str, Any]) -> str:
    """Whether anything in the file was changed since it was written."""
    if "seal" not in result:
        return "missing: the file was edited, or not written by trajopt"
    found = _hash({key: value for key, value in result.items() if key != "seal"})
    return "" if result["seal"] == found else "broken: something in the file was edited"


def _same(problem: Mapping[str, Any], own: Any) -> bool:
    try:
        return bool(_plain(problem) == _plain(own))
    except RecursionError:
        return False


def _hash(problem: Mapping[str, Any]) -> str | None:
    try:
        text = json.dumps(problem, sort_keys=True, separators=(",", ":"))
    except (TypeError, ValueError, RecursionError):
        return None
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(value: Any) -> Any:
    """Tuples as lists, so that data from code and from a file compare equal."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value
