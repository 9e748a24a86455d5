"""What all solutions share: a verdict, numbers that were checked, who found them, and the files they are written to."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Final

from trajopt.errors import NoSolution
from trajopt.fields import digest
from trajopt.files import write_atomically
from trajopt.routing import Route
from trajopt.verdict import Verdict

_STALE: Final = (  # files of another answer in the same folder
    "trajectory.csv", "trajectory.png", "prices.png", "vibration.png", "arcs.png", "command.csv", "command.png",
    "motion.png", "motion.gif", "poses.png", "tip.png",
)  # fmt: skip


class Frozen(dict[str, Any]):
    """A mapping that is not changed once made."""

    def _refuse(self, *_: Any, **__: Any) -> Any:
        raise TypeError("a solution is frozen; copy it to a dict first")

    __setitem__ = __delitem__ = update = pop = popitem = clear = setdefault = __ior__ = _refuse

    def __reduce__(self) -> Any:
        return Frozen, (dict(self),)


@dataclass(frozen=True, repr=False)
class Answer:
    """Base of the solutions of every kind of problem. Without a checked answer it holds no numbers.

    ``objective`` SI; ``duration`` s; ``metrics`` SI by name; ``certificate``: lower bound, gap and what it bounds;
    ``audit``: report of the independent check; ``route``: model, solver, reason; ``timings`` s.
    """

    FORMAT: ClassVar[str]
    TABLE: ClassVar[str] = "trajectory.csv"  # the file of `csv`

    status: Verdict
    problem: Any
    route: Route
    objective: float | None = None
    duration: float | None = None
    metrics: Mapping[str, float] = field(default_factory=dict)
    certificate: Mapping[str, Any] = field(default_factory=dict)
    audit: Mapping[str, Any] = field(default_factory=dict)
    explanation: Mapping[str, Any] = field(default_factory=dict)
    timings: Mapping[str, float] = field(default_factory=dict)
    message: str = ""

    def __post_init__(self) -> None:
        for name in ("metrics", "certificate", "audit", "explanation", "timings"):
            object.__setattr__(self, name, Frozen(getattr(self, name)))

    @property
    def refusal(self) -> NoSolution:
        """What is raised where numbers are asked for and there are none."""
        return NoSolution(f"{self.status.value}: {self.message or self.status.advice}")

    def to_dict(self) -> dict[str, Any]:
        """The result file's content: plain JSON data, numbers null where there is no solution."""
        from trajopt import __version__

        canonical = self.problem.canonical()
        return {
            "format": self.FORMAT,
            "trajopt": __version__,
            "status": self.status.value,
            "message": self.message,
            "objective": self.objective,
            "duration": self.duration,
            "metrics": dict(self.metrics) or None,
            "certificate": dict(self.certificate) or None,
            "audit": dict(self.audit) or None,
            "explanation": dict(self.explanation) or None,
            "prices": [],
            "structure": None,
            "route": self.route.to_dict(),
            "timings": dict(self.timings),
            "problem_hash": digest(canonical),
            "problem": canonical,
            "trajectory": None,
        }

    def sealed(self, **extra: Any) -> dict[str, Any]:
        """`to_dict` with ``extra`` entries and a seal, the SHA-256 of all of it, by which the checker sees an edit."""
        return seal(self.to_dict() | extra)

    def csv(self) -> str:
        """The text of the table: a comment with the problem's hash, a header with units, 17 digits. Raises
        NoSolution."""
        raise NotImplementedError

    def save(self, directory: str | Path) -> list[Path]:
        """Write result.json and, with a solution, its table and pictures into ``directory``; returns the paths. Raises
        OSError."""
        directory = Path(directory)
        written = self.save_data(directory)
        if self.status.solved:
            for name, draw in self._pictures().items():
                written.append(directory / name)
                draw().savefig(written[-1], dpi=150)
        return written

    def save_data(self, directory: Path) -> list[Path]:
        """`save` without pictures."""
        directory.mkdir(parents=True, exist_ok=True)
        for stale in _STALE:
            (directory / stale).unlink(missing_ok=True)
        written = [directory / "result.json"]
        write_atomically(written[0], json.dumps(self.sealed(), indent=1, allow_nan=False).encode())
        if self.status.solved:
            written.append(directory / self.TABLE)
            write_atomically(written[-1], self.csv().encode())
        return written

    def _pictures(self) -> dict[str, Callable[[], Any]]:
        raise NotImplementedError

    def __repr__(self) -> str:
        value = "" if self.objective is None else f", objective={self.objective:.9g}, duration={self.duration:.9g}"
        return f"<{type(self).__name__} {self.status.value}{value}>"


def seal(data: dict[str, Any]) -> dict[str, Any]:
    """The content of a result file with its seal."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return data | {"seal": hashlib.sha256(text.encode()).hexdigest()}
