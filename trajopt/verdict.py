"""How a case can end: each verdict knows its exit code and says what to try next."""

from __future__ import annotations

from enum import StrEnum


class Verdict(StrEnum):
    """The end of one case. Only SOLVED and SOLVED_LOCAL carry numbers, and both have passed the independent check."""

    SOLVED = "SOLVED"
    SOLVED_LOCAL = "SOLVED_LOCAL"
    IMPOSSIBLE = "IMPOSSIBLE"
    IMPOSSIBLE_ON_GRID = "IMPOSSIBLE_ON_GRID"
    UNDECIDED = "UNDECIDED"
    LIMIT = "LIMIT"
    BAD_INPUT = "BAD_INPUT"
    CRASHED = "CRASHED"
    INTERRUPTED = "INTERRUPTED"

    @property
    def solved(self) -> bool:
        """Whether there is a checked trajectory."""
        return self in (Verdict.SOLVED, Verdict.SOLVED_LOCAL)

    @property
    def exit_code(self) -> int:
        """What the command line returns for a single case of this verdict."""
        return {Verdict.BAD_INPUT: 2, Verdict.INTERRUPTED: 130}.get(self, 0 if self.solved else 3)

    @property
    def advice(self) -> str:
        """What it means, and what to try next."""
        return _ADVICE[self]


_ADVICE = {
    Verdict.SOLVED: "optimal on this mesh, checked and certified",
    Verdict.SOLVED_LOCAL: "checked; locally optimal, no better move is known",
    Verdict.IMPOSSIBLE: "no move meets these limits; give it more time or wider limits",
    Verdict.IMPOSSIBLE_ON_GRID: "no move on this mesh meets these limits; try more intervals",
    Verdict.UNDECIDED: "no answer passed the check; try more intervals, or limits further from the edge",
    Verdict.LIMIT: "stopped at the time or iteration limit; allow more",
    Verdict.BAD_INPUT: "the problem cannot be meant as stated",
    Verdict.CRASHED: "the solver process died; try another solver",
    Verdict.INTERRUPTED: "stopped by the user",
}
