"""Writing a solution for a target: checked before, verified after, and only then put in its place."""

from __future__ import annotations

import re
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from trajopt import checker, units
from trajopt.errors import BadInput, InternalError, NoSolution, TrajoptError
from trajopt.export import formats
from trajopt.export.formats import Format
from trajopt.export.points import Header, Points, sample
from trajopt.export.reconstruct import NEEDS, SMOOTH
from trajopt.export.verify import Report, verify
from trajopt.fields import nearest
from trajopt.files import refuse_folder, write_atomically

if TYPE_CHECKING:
    from trajopt.solution import Solution

LARGEST: Final = 2**31 - 1  # of an INTEGER32
DRIVE: Final = 1e-3  # s: assumed of a drive that draws straight lines between points at no cycle
_COARSEST: Final = 1e-3  # of the stroke
_COUNTS: Final = re.compile(
    r"\s*([0-9.eE+-]+)\s*(?:counts?|increments?|steps?)?\s*(?:/|per )\s*([A-Za-z\u00b5\u03bc]+)\s*"
)
_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,62}")


class Refused(TrajoptError):
    """The file would break a limit on the machine, so that it was not left; ``report`` says by how much."""

    def __init__(self, report: Report) -> None:
        super().__init__(f"{report.format}: not written, {'; '.join(report.messages)}")
        self.report = report


def export(
    solution: Solution,
    path: str | Path,
    to: str,
    *,
    dialect: str | None = None,
    cycle: float | str | None = None,
    resolution: float | str | None = None,
    drive_cycle: float | str | None = None,
    interpolation: str | None = None,
    name: str = "axis",
    allow: bool = False,
) -> Report:
    """Write a solution to ``path`` for a target and return what the target makes of it (see `trajopt.export.verify`).

    ``to`` and ``dialect`` as in `trajopt.export.formats`; ``cycle`` (s, or a text with a unit): a point each, else the
    nodes of the move, which for minimum times are the switching times; ``resolution``: the size of an encoder count (m
    or rad, "0.1 um", or "10000 counts/mm"); ``drive_cycle``: the drive's own, where it interpolates finer than the
    points (1 ms where neither is given and it draws straight lines); ``interpolation``: hold, linear, cubic, quintic or
    spline instead of the target's usual one; ``name`` of the axis in the file; ``allow`` leaves a file that would break
    limits.

    Raises BadInput, NoSolution, TrajoptError where the checker rejects the solution, Refused, OSError.
    """
    form, path = formats.find(to, dialect), Path(path)
    trajectory = _checked(solution)
    refuse_folder(path)
    header = _header(solution, form, name, _seconds(cycle, "cycle"), resolution)
    kind = _interpolation(interpolation, form, trajectory.order, header.cycle is not None)
    exact = sample(solution, form, kind, header.cycle)
    drive = _drive(_seconds(drive_cycle, "drive_cycle"), exact, kind, header.cycle is not None)
    found: list[Report] = []

    def accept(written: Path) -> None:
        read = _read(written, form, header)
        report = verify(form.name, str(path), exact, read, header, trajectory, kind, drive, form.rounds)
        if report.verdict == "refused" and not allow:
            raise Refused(replace(report, written=False))
        found.append(report)

    write_atomically(path, form.write(_rounded(exact, form, header), header), accept)
    return found[0]


def _header(solution: Solution, form: Format, name: str, cycle: float | None, resolution: float | str | None) -> Header:
    trajectory, problem = solution.trajectory, solution.problem
    assert trajectory is not None
    if _NAME.fullmatch(name) is None:
        raise BadInput(f"name: must be letters, digits and _, at most 63, got {name[:80]!r}")
    count = _resolution(resolution, problem.rotary, float(np.ptp(trajectory.chain[0])))
    if form.counts and count is None:
        raise BadInput(f'resolution: is missing; {form.name} counts, write for example "0.1 um" or "10000 counts/mm"')
    origin = trajectory.origin + float(trajectory.chain[0][0])
    return Header(name, problem.rotary, trajectory.order, origin, cycle, count, problem.hash)


def _read(written: Path, form: Format, header: Header) -> Points:
    try:
        return form.read(written.read_bytes(), header)
    except (ValueError, IndexError, KeyError) as error:
        raise InternalError(f"{form.name}: its own file cannot be read back: {error}") from error


def _checked(solution: Solution) -> Any:
    """The trajectory of a solution that passes the independent check again, by the exact scheme."""
    if solution.trajectory is None:
        raise NoSolution(f"{solution.status.value}: {solution.message or solution.status.advice}; nothing to export")
    if solution.trajectory.scheme.name != "exact":
        raise BadInput("transcription.scheme: euler has only nodes, and what a drive draws between them takes up to "
                       'four times the acceleration; solve again with scheme = "exact"')  # fmt: skip
    report = checker.check(solution.to_dict())
    if not report.passed:
        raise TrajoptError(f"the checker rejects this solution, nothing is exported: {report.summary()}")
    return solution.trajectory


def _rounded(points: Points, form: Format, header: Header) -> Points:
    """Positions as whole counts: of the start where a file counts from there, else of zero."""
    if header.count is None or not form.rounds:
        return points
    base = header.origin if form.at_rest else 0.0
    counts = np.round((points.position - base) / header.count)
    reach = float(np.max(np.abs(counts)))
    if form.counts and max(reach, float(np.max(np.abs(points.values[1]))) / header.count) > LARGEST:
        raise BadInput(f"resolution: {header.count:g} (SI) makes more counts, or counts a second, than 32 bits hold; "
                       f"give at least {header.count * max(reach / LARGEST, 1.0):.3g}, or a coarser one for the speed")
    return replace(points, values=(base + counts * header.count, *points.values[1:]))


def _seconds(value: float | str | None, field: str) -> float | None:
    if value is None:
        return None
    try:
        seconds = units.to_si(value, "time") if isinstance(value, str) else float(value)
    except (units.UnitError, TypeError, ValueError) as error:
        raise BadInput(f"{field}: {error}") from None
    if not (isfinite(seconds) and seconds > 0):
        raise BadInput(f'{field}: must be > 0, got {value}; write for example "1 ms"')
    return seconds


def _resolution(value: float | str | None, rotary: bool, stroke: float) -> float | None:
    """The size of a count, m or rad."""
    if value is None:
        return None
    counts = _COUNTS.fullmatch(value) if isinstance(value, str) else None
    try:
        if counts is not None:
            size = units.to_si(f"1 {counts[2]}", "position", rotary) / float(counts[1])
        else:
            size = units.to_si(value, "position", rotary) if isinstance(value, str) else float(value)
    except ZeroDivisionError:
        size = 0.0
    except (units.UnitError, TypeError, ValueError) as error:
        raise BadInput(f"resolution: {error}, or counts per unit such as '10000 counts/mm'") from None
    if not (isfinite(size) and size > 0):
        raise BadInput(f"resolution: must be > 0, got {value}; write for example '0.1 um' or '10000 counts/mm'")
    if size > _COARSEST * stroke:
        raise BadInput(f"resolution: {size:g} (SI) is coarser than a thousandth of the stroke of {stroke:g}; the move "
                       f"would be steps; give at most {_COARSEST * stroke:.3g}")  # fmt: skip
    return size


def _interpolation(asked: str | None, form: Format, order: int, cyclic: bool) -> str:
    kind = asked or form.interpolation(order, cyclic)
    if kind not in NEEDS:
        raise BadInput(f"interpolation: unknown {kind[:60]!r}{nearest(kind, list(NEEDS))}")
    if NEEDS[kind] > min(form.carries, order):
        raise BadInput(f"interpolation: {kind} needs {('velocities', 'accelerations')[NEEDS[kind] - 1]}, which "
                       f"{form.name} does not carry; use {', '.join(k for k, n in NEEDS.items() if n <= form.carries)}")
    return kind


def _drive(drive: float | None, points: Points, kind: str, cyclic: bool) -> float | None:
    """The drive's own cycle, s: as given, or assumed where it draws straight lines between points at no cycle."""
    apart = float(np.max(np.diff(points.time)))
    if drive is None:
        return min(DRIVE, apart) if kind not in SMOOTH and not cyclic else None
    if not points.time[-1] / 1e6 <= drive <= apart * (1 + 1e-9):
        raise BadInput(f"drive_cycle: must be at most the points' own distance of {apart:g} s and at least a "
                       f"millionth of the move, got {drive:g} s")  # fmt: skip
    return drive
