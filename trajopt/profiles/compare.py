"""Profiles compared: those that drives offer, Chebyshev profiles, and the best possible move, by transcription.

The free profile has end conditions on position and velocity alone, and keeps the problem's limits. It is the best of
local optima from several starts, "the best known", and nothing is claimed beyond that.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from trajopt import checker, units
from trajopt.answer import seal
from trajopt.errors import InternalError
from trajopt.files import write_atomically
from trajopt.problem import Problem
from trajopt.profiles.chebyshev import Family, search, search_box
from trajopt.profiles.laws import Laid, Law, refuse, trapezoid
from trajopt.solution import Solution
from trajopt.table import SYMBOLS

FORMAT: Final = "trajopt profiles 1"
_ROWS: Final = 1001  # of the table of set-points
_COLUMNS: Final = ("position", "velocity", "acceleration", "jerk", "force", "power")


@dataclass(frozen=True)
class Row:
    """A law, what it costs (SI), the limits it breaks, and for a Chebyshev profile its end conditions."""

    law: Law
    objective: float
    breaks: tuple[str, ...]
    ends: str = ""


@dataclass(frozen=True)
class Profiles:
    """The laws as asked for, and the best move known; ``audit`` is the report of the checker."""

    problem: Problem
    rows: tuple[Row, ...]
    best: Solution
    audit: dict[str, Any] = field(default_factory=dict)

    def above(self, row: Row) -> float | None:
        """By what share a law costs more than the best move known; None where that was not found."""
        return None if not self.best.objective else row.objective / self.best.objective - 1

    def to_dict(self) -> dict[str, Any]:
        """The content of profiles.json."""
        laws = [
            row.law.to_dict() | {
                "ends": row.ends, "objective": row.objective, "above": self.above(row), "breaks": list(row.breaks),
            } for row in self.rows
        ]  # fmt: skip
        best: dict[str, Any] = {"status": self.best.status.value, "objective": self.best.objective}
        best |= {"problem_hash": self.best.problem.hash, "certificate": dict(self.best.certificate) or None}
        problem = self.problem
        return {
            "format": FORMAT, "status": self.best.status.value, "problem_hash": problem.hash,
            "problem": problem.canonical(), "laws": laws, "best": best,
        }  # fmt: skip

    def sentences(self) -> list[str]:
        """What there is to say, a line a law, and what is known of the best move."""
        shown, lines = self.problem.shown, []
        for row in self.rows:
            above, breaks = self.above(row), " and ".join(shown(name) for name in row.breaks)
            text = f"{row.law.name} {row.objective:.9g}"
            text += "" if above is None else f": {_percent(above)} the best known"
            lines.append(text + (f", but breaks the {breaks} limit" if breaks else ""))
        return [*lines, self.best_text()]

    def best_text(self) -> str:
        """Where the best move known comes from."""
        best = self.best
        if best.objective is None:
            return f"best known: none found ({best.message or best.status.advice})"
        proof, count = best.certificate, best.problem.transcription.intervals
        known = f"the best of {proof['starts']} starts, of which {proof['agreed']} agree; no bound is known"
        if proof.get("lower_bound") is not None:
            known = f"lower bound {proof['lower_bound']:.9g}"
        return f"best known {best.objective:.9g}: a free profile on {count} intervals, {known}"

    def save(self, directory: str | Path) -> list[Path]:
        """Write profiles.json, a table of set-points a Chebyshev profile, pictures, and the best move into best/."""
        from trajopt.profiles.plot import plot_profiles

        directory = Path(directory)
        directory.mkdir(parents=True, exist_ok=True)
        written = [directory / "profiles.json"]
        data = seal(self.to_dict() | {"audit": self.audit})
        write_atomically(written[0], json.dumps(data, indent=1, allow_nan=False).encode())
        for row in self.rows:
            if row.ends:
                written.append(directory / f"{row.law.name}.csv")
                write_atomically(written[-1], self._table(row).encode())
        figure: Any = plot_profiles(self)[0].figure
        written.append(directory / "profiles.png")
        figure.savefig(written[-1], dpi=150)
        return [*written, *self.best.save(directory / "best")]

    def _table(self, row: Row) -> str:
        """Set-points of a law as CSV, with units in the header."""
        kinds = units.kinds(self.problem.rotary)
        fractions = np.linspace(0.0, 1.0, _ROWS)
        known = Laid(self.problem, row.law).signals(fractions)
        columns = {"time": fractions * (self.problem.move.fixed_time or 0.0)} | {name: known[name] for name in _COLUMNS}
        header = ",".join(f"{SYMBOLS[name]} [{kinds[name].unit}]" for name in columns)
        lines = [",".join(f"{x:.17g}" for x in values) for values in zip(*columns.values(), strict=True)]
        return "\n".join([f"# trajopt {self.problem.hash} {row.law.name}", header, *lines]) + "\n"


def _percent(above: float) -> str:
    return f"{abs(100 * above):.3g} % {'above' if above >= 0 else 'below'}"


def free_problem(problem: Problem) -> Problem:
    """The problem with end conditions on position and velocity alone: what any profile can be measured against."""
    ends = {
        which: getattr(problem.move, which).model_copy(update={"acceleration": "free", "jerk": None})
        for which in ("start", "end")
    }
    return problem.replace(move=problem.move.model_copy(update=ends))


def compare_profiles(
    problem: Problem,
    degrees: Sequence[int],
    ends: Literal["JF", "J0"] = "JF",
    box: bool = False,
    solve: Callable[[Problem], Solution] | None = None,
) -> Profiles:
    """Trapezoid, quintic, septic and the best Chebyshev profiles of these degrees, against the best possible move.

    ``box``: search the whole box of coefficients, too, and take the better. Raises BadInput for a move that no profile
    fits or a degree too low, and InternalError when the checker finds otherwise than we say.
    """
    from trajopt.worker import solve as usual

    refuse(problem)
    families = [Family(degree, ends) for degree in degrees]
    rows = [_row(problem, trapezoid())]
    rows += [_row(problem, family.law(), family.ends) for family in (Family(5), Family(7, "J0"))]
    for family in families:
        found = [search(problem, family), *([search_box(problem, family)] if box else [])]
        rows.append(min((_row(problem, family.law(p), ends) for p in found), key=lambda row: row.objective))
    best = (solve or usual)(free_problem(problem))
    profiles = Profiles(problem, tuple({row.law.name: row for row in rows}.values()), best)
    report = checker.check(profiles.to_dict())
    if not report.passed:
        raise InternalError("; ".join(map(str, report.failed)))
    return replace(profiles, audit=report.to_dict())


def _row(problem: Problem, law: Law, ends: str = "") -> Row:
    laid = Laid(problem, law)
    return Row(law, laid.measure(), tuple(laid.broken()), ends)
