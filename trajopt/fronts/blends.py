"""Moves blended of two others: within all convex limits, since both are; measured like any other, and as achieved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from trajopt.mesh import Floats
from trajopt.metrics import peak
from trajopt.problem import Objective, Term
from trajopt.routing import nonaffine_limits
from trajopt.trajectory import Trajectory


def blend(first: Trajectory, second: Trajectory, share: float) -> Trajectory:
    """The move that is ``share`` of the second and the rest of the first, at every instant."""
    pairs = zip(first.chain, second.chain, strict=True)
    return replace(first, chain=tuple((1 - share) * x + share * y for x, y in pairs))


def blends(first: Trajectory, second: Trajectory, terms: Sequence[Term], count: int) -> Floats:
    """(n, m) the objectives of ``count`` blends, SI, without those that break a limit that is not convex."""
    if first.duration != second.duration or first.mesh.intervals != second.mesh.intervals:
        return np.empty((0, len(terms)))
    goals = [Objective(terms=(term,)) for term in terms]
    made = (blend(first, second, k / (count + 1)) for k in range(1, count + 1))
    found = [[move.measure(goal) for goal in goals] for move in made if _keeps_nonconvex_limits(move)]
    return np.array(found).reshape(-1, len(terms))


def _keeps_nonconvex_limits(move: Trajectory) -> bool:
    for name in nonaffine_limits(move.problem):
        limit = move.problem.limits.given[name]
        if name not in ("power", "force", "current", "voltage") or limit.varies:
            return False
        if peak(move.signal(name)) > min(-limit.lowest, limit.highest):
            return False
    return True
