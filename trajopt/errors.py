"""What can go wrong, as types: each carries the exit code of the command line."""

from __future__ import annotations


class TrajoptError(Exception):
    """Base of all errors that are not our own bugs; ``exit_code`` is what the command line returns."""

    exit_code = 3


class BadInput(TrajoptError, ValueError):
    """The problem as stated cannot be meant: one line naming field, value, unit, allowed range and remedy."""

    exit_code = 2


class NoSolution(TrajoptError):
    """Numbers were asked of a solution that has none (impossible, undecided, limit)."""


class MissingPackage(TrajoptError):
    """Something that is asked for needs a package that is not installed; the message names it."""

    exit_code = 4


class MissingSolver(MissingPackage):
    """A solver is not installed; the message names the package that brings it."""


class InternalError(TrajoptError):
    """Two independent parts of trajopt contradict each other: our bug, never the user's."""

    exit_code = 70
