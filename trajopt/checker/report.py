"""What a check found and what it means: one Check per question, one Report per result."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple, TypeAlias

Number: TypeAlias = float | Fraction


class Found(NamedTuple):
    """A worst violation, the time (s) of it, how far floats may be wrong about it, and a word of explanation."""

    violation: Number
    time: float | None = None
    rounding: float = 0.0
    note: str = ""


@dataclass(frozen=True)
class Check:
    """One thing that was checked: worst violation (SI; 1 for a plain question), its time (s), tolerance, verdict."""

    name: str
    violation: float
    tolerance: float
    time: float | None
    passed: bool
    note: str = ""

    @property
    def ratio(self) -> float:
        """Violation per tolerance; 1 or less passes."""
        return 0.0 if self.violation == 0 else self.violation / self.tolerance if self.tolerance else math.inf

    def __str__(self) -> str:
        if self.tolerance == 0 and self.note:
            return f"{self.name}: {self.note}"
        where = "" if self.time is None else f" at t = {self.time:.9g} s"
        note = f"; {self.note}" if self.note else ""
        return f"{self.name}: off by {self.violation:.3g}{where}, tolerance {self.tolerance:.3g}{note}"


@dataclass(frozen=True)
class Report:
    """The verdict on one result. ``tolerance`` is the relative one on limits; ``decided_by`` float or rational."""

    checks: tuple[Check, ...]
    decided_by: str
    tolerance: float
    not_checked: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether every check passed."""
        return all(check.passed for check in self.checks)

    @property
    def worst(self) -> Check:
        """The check with the largest violation per tolerance."""
        return max(self.checks, key=lambda check: (not check.passed, check.ratio))

    @property
    def excess(self) -> float:
        """The worst excess of a limit, relative to it (to the signal's own peak where that is smaller)."""
        limits = [check for check in self.checks if check.name.startswith("limit ") and check.tolerance > 0]
        return max((check.violation / check.tolerance * self.tolerance for check in limits), default=0.0)

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that did not pass."""
        return tuple(check for check in self.checks if not check.passed)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON data."""
        worst = self.worst
        return {
            "passed": self.passed,
            "tolerance": self.tolerance,
            "excess": self.excess,
            "decided_by": self.decided_by,
            "worst": {
                "name": worst.name, "violation": worst.violation, "tolerance": worst.tolerance, "time": worst.time,
            },
            "failed": [str(check) for check in self.failed],
            "checks": len(self.checks),
            "not_checked": list(self.not_checked),
        }  # fmt: skip

    def summary(self) -> str:
        """One line for people."""
        count = f"{len(self.checks)} checks in {self.decided_by} arithmetic"
        if self.passed:
            unchecked = f"; not checked: {', '.join(self.not_checked)}" if self.not_checked else ""
            return f"passed {count}; worst {self.worst.name}, {self.worst.ratio:.2g} of its tolerance{unchecked}"
        worst = sorted(self.failed, key=lambda check: -check.ratio)[:3]
        return f"FAILED {len(self.failed)} of {count}: {'; '.join(map(str, worst))}"


def question(name: str, fault: str = "") -> Check:
    """A check that is a matter of yes or no; ``fault`` says what is wrong."""
    return Check(name, float(bool(fault)), 0.0, None, not fault, fault)


def to_float(value: Number) -> float:
    try:
        found = float(value)
    except OverflowError:
        found = math.inf
    return found if abs(found) <= sys.float_info.max else sys.float_info.max
