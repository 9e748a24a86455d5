"""The mesh: intervals k = 0..N-1 between nodes k = 0..N, as fractions of the duration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from trajopt.fields import Table
from trajopt.problem import Problem

LARGE: Final = 4_000  # intervals: beyond, memory counts, and solvers take firmer settings

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """Nodes as fractions of the duration: ``fractions`` (N+1,), from 0 to 1, increasing."""

    fractions: Floats

    @property
    def intervals(self) -> int:
        """N."""
        return len(self.fractions) - 1

    @cached_property
    def steps(self) -> Floats:
        """(N,) interval lengths as fractions of the duration."""
        steps = np.diff(self.fractions)
        steps.flags.writeable = False
        return steps

    @cached_property
    def is_uniform(self) -> bool:
        """Whether all intervals have one length, but for rounding."""
        return bool(np.ptp(self.steps) < 1e-12)

    def places(self, top: bool) -> Floats:
        """(N+1,) the nodes or, for the top derivative, (N,) the middles of the intervals."""
        return (self.fractions[:-1] + self.fractions[1:]) / 2 if top else self.fractions

    def node_at(self, fraction: float) -> int:
        """The node at a fraction that is one."""
        return int(np.argmin(np.abs(self.fractions - fraction)))


def mesh_for(*problems: Problem, also: Sequence[float] = ()) -> Mesh:
    """Equal intervals, with nodes added where a limit or the load has a corner, at via states and at the times ``also``
    (s); one mesh for problems of one duration.

    An added node that falls within a thousandth of a step of a uniform one takes its place. The Euler scheme keeps
    equal steps.
    """
    count = problems[0].transcription.intervals
    fractions = np.arange(count + 1) / count
    duration = problems[0].move.fixed_time
    if duration is None or problems[0].transcription.scheme == "euler":
        return Mesh(fractions)
    corners = [*also, *(t for problem in problems for t in _corners(problem))]
    wanted = np.unique([t / duration for t in corners if 0 < t < duration])
    if not len(wanted):
        return Mesh(fractions)
    far = np.min(np.abs(fractions[:, None] - wanted[None, :]), axis=1) > 1e-3 / count
    far[[0, -1]] = True
    return Mesh(np.unique(np.concatenate([fractions[far], wanted])))


def _corners(problem: Problem) -> Iterator[float]:
    """Times (s) at which a limit or the load has a corner, or a via state is passed."""
    for limit in problem.limits.given.values():
        yield from limit.breakpoints
    if isinstance(problem.load.inertia, Table):
        yield from problem.load.inertia.time
    yield from (via.time for via in problem.move.via)
