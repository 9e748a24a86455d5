"""The mesh: intervals k = 0..N-1 between nodes k = 0..N, as fractions of the duration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trajopt.fields import Table
from trajopt.problem import Problem

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """Nodes as fractions of the duration: ``fractions`` (N+1,), from 0 to 1, increasing."""

    fractions: Floats

    @property
    def intervals(self) -> int:
        """N."""
        return len(self.fractions) - 1

    @property
    def steps(self) -> Floats:
        """(N,) interval lengths as fractions of the duration."""
        return np.diff(self.fractions)

    def places(self, top: bool) -> Floats:
        """(N+1,) the nodes or, for the top derivative, (N,) the middles of the intervals."""
        return (self.fractions[:-1] + self.fractions[1:]) / 2 if top else self.fractions

    def node_at(self, fraction: float) -> int:
        """The node at a fraction that is one."""
        return int(np.argmin(np.abs(self.fractions - fraction)))


def mesh_for(problem: Problem) -> Mesh:
    """Equal intervals, with nodes added where a limit or the load has a corner and at via states.

    An added node that falls within a thousandth of a step of a uniform one takes its place. The Euler scheme keeps
    equal steps.
    """
    count = problem.transcription.intervals
    fractions = np.arange(count + 1) / count
    duration = problem.move.fixed_time
    if duration is None or problem.transcription.scheme == "euler":
        return Mesh(fractions)
    corners = [t for limit in problem.limits.given().values() for t in limit.breakpoints]
    if isinstance(problem.load.inertia, Table):
        corners += problem.load.inertia.time
    wanted = np.unique([t / duration for t in (*corners, *(v.time for v in problem.move.via)) if 0 < t < duration])
    if not len(wanted):
        return Mesh(fractions)
    far = np.min(np.abs(fractions[:, None] - wanted[None, :]), axis=1) > 1e-3 / count
    far[[0, -1]] = True
    return Mesh(np.unique(np.concatenate([fractions[far], wanted])))
