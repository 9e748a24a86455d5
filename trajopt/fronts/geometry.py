"""How well a front is known. All here is normalised: every objective is 0 at its best and 1 at its worst anchor.

The error is the least e such that for every move there is, an achieved point is at most e worse in every objective.
What moves there can be is known from outside: half-planes w·f >= v from the lower bounds of weighted sums, and corners
that no move is better than in every objective, from those of epsilon-constraints. What is achieved is known from
inside: where all objectives are convex, the convex hull of the points, since mixing two moves costs no more than the
mixture of their costs; elsewhere the points alone, with moves blended of neighbours among them and measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import linprog
from scipy.spatial import HalfspaceIntersection

from trajopt.mesh import Floats

COUNTED: Final = 4.0  # ranges: where all is convex, a move that is worse than that in an objective does not count
_FAR: Final = 2.0  # beyond every anchor, within what counts


@dataclass(frozen=True)
class Outside:
    """``weights`` (k, m) with sum one and ``values`` (k,) of half-planes; ``corners`` (c, m)."""

    weights: Floats
    values: Floats
    corners: Floats

    def depth(self, u: Floats) -> float:
        """How far ``u`` (m,) can be moved against (1, …, 1) before no move is there; a coordinate may be infinite."""
        far = ~np.isfinite(u)
        known = ~np.any(self.weights[:, far] > 0, axis=1)
        planes = self.weights[known][:, ~far] @ u[~far] - self.values[known]
        with np.errstate(invalid="ignore"):  # a corner without a ceiling there is no nearer
            away = np.where(np.isinf(self.corners), -np.inf, u - self.corners)
        corners = np.max(away, axis=1, initial=-np.inf)
        return float(min(np.min(planes, initial=np.inf), np.min(corners, initial=np.inf)))


@dataclass(frozen=True)
class Gap:
    """A place where the front is known to within ``error`` only, and the ``weights`` (m,) that look into it."""

    error: float
    weights: Floats
    between: tuple[int, int] | None = None  # the points on both sides, where there are two objectives


def hull_gaps(points: Floats, outside: Outside) -> list[Gap]:
    """The gaps between the hull of ``points`` (n, m) and the outside, the widest first: one at each of its vertices."""
    gaps = [below_hull(points, vertex) for vertex in _vertices(outside)]
    return sorted(gaps, key=lambda gap: -gap.error)


def _vertices(outside: Outside) -> Floats:
    """Where the half-planes meet, (v, m), among each other and with the end of what counts."""
    count = outside.weights.shape[1]
    above = np.hstack([-outside.weights, outside.values[:, None]])
    below = np.hstack([np.eye(count), np.full((count, 1), -COUNTED)])
    meeting: Floats = HalfspaceIntersection(np.vstack([above, below]), np.full(count, _FAR)).intersections
    return meeting[np.all(np.isfinite(meeting), axis=1)]


def below_hull(points: Floats, vertex: Floats) -> Gap:
    """How far a vertex lies below the hull, along (1, …, 1), and the normal of the hull above it."""
    count, size = points.shape
    rows = np.hstack([points.T, -np.ones((size, 1))])
    cost = np.append(np.zeros(count), 1.0)
    shares = np.append(np.ones(count), 0.0)[None, :]
    bounds = [(0.0, None)] * count + [(None, None)]
    found = linprog(cost, A_ub=rows, b_ub=vertex, A_eq=shares, b_eq=[1.0], bounds=bounds, method="highs")
    if found.x is None:
        raise RuntimeError(f"the distance of a vertex from the hull: {found.message}")
    return Gap(float(found.x[-1]), np.abs(np.asarray(found.ineqlin.marginals, dtype=float)))


def staircase_gaps(points: Floats, between: list[Floats], outside: Outside) -> list[Gap]:
    """The gaps of two objectives with neighbours ``points`` (n, 2), in order, and what was achieved ``between`` each
    pair of them, the widest first; those beyond the ends look along one axis."""
    ends = [
        Gap(outside.depth(np.array([points[0, 0], np.inf])), np.array([1.0, 0.0])),
        Gap(outside.depth(np.array([np.inf, points[-1, 1]])), np.array([0.0, 1.0])),
    ]
    gaps = []
    for k, blends in enumerate(between):
        stairs = nondominated(np.vstack([points[k : k + 2], blends]))
        stairs = stairs[np.argsort(stairs[:, 0])]
        corners = np.column_stack([stairs[1:, 0], stairs[:-1, 1]])
        error = max((outside.depth(corner) for corner in corners), default=0.0)
        step = np.abs(points[k + 1] - points[k])[::-1]
        gaps.append(Gap(error, step / max(np.sum(step), 1e-300), (k, k + 1)))
    return sorted([*ends, *gaps], key=lambda gap: -gap.error)


def point_gaps(points: Floats, outside: Outside) -> list[Gap]:
    """The gaps between ``points`` (n, m) alone and the outside, the widest first."""
    gaps = []
    for corner in upper_bounds(points):
        depth = outside.depth(corner)
        inner = np.minimum(corner, _FAR) - max(depth, 0.0)
        gaps.append(Gap(depth, below_hull(points, inner).weights))
    return sorted(gaps, key=lambda gap: -gap.error)


def upper_bounds(points: Floats) -> Floats:
    """The local upper bounds of points: the largest corners below which none of them lies (Klamroth et al. 2015).

    Every place that no point is at most as bad as in every objective lies strictly below one of them.
    """
    bounds = np.full((1, points.shape[1]), np.inf)
    for point in nondominated(points):
        cut = np.all(point < bounds, axis=1)
        pieces = np.repeat(bounds[cut], len(point), axis=0)
        axes = np.tile(np.arange(len(point)), int(np.sum(cut)))
        pieces[np.arange(len(pieces)), axes] = point[axes]
        kept = np.unique(np.vstack([bounds[~cut], pieces]), axis=0)
        below = np.all(kept[:, None, :] <= kept[None, :, :], axis=2) & ~np.eye(len(kept), dtype=bool)
        bounds = kept[~np.any(below, axis=1)]
    return bounds


def nondominated(points: Floats) -> Floats:
    """The points that no other is better than."""
    from moocore import filter_dominated

    return np.asarray(filter_dominated(points), dtype=float)
