"""The checks of an arm's tip: its velocity at the release, its distance from a path. Points are complex numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.polynomial import polynomial

from trajopt.checker.arm import Limbs
from trajopt.checker.case import Array
from trajopt.checker.report import Check, question
from trajopt.checker.values import mapping, number, vector

_TUBE: Final = 1e-5  # of the width of a path, between the nodes
_TIP: Final = 1e-6
_TIME: Final = 1e-9  # of the duration: how far a release may be from a node


def thrown(
    limbs: Limbs, tip: Mapping[str, Any], at: float | None, time: Array, q: Array, w: Array
) -> list[Check]:
    """The time of the release (s) and the velocity of the tip then; ``q`` and ``w`` (joints, nodes)."""
    end, asked = float(time[-1]), tip.get("release", "end")
    if at is None or not 0 < at <= end * (1 + _TIME):
        return [question("release", "the time of the release is missing, or not within the motion")]
    wanted = end if asked == "end" else at if asked == "free" else number(asked, "tip.release")
    k = int(np.argmin(np.abs(time - at)))
    off = max(abs(at - wanted), abs(float(time[k]) - at))
    checks = [Check("release", off, _TIME * end, at, off <= _TIME * end)]
    velocity = complex(*vector(tip["velocity"], "tip.velocity"))
    miss = float(abs(limbs.tip(q[:, k : k + 1], w[:, k : k + 1])[1][0] - velocity))
    tolerance = _TIP * max(abs(velocity), 1e-3)
    return [*checks, Check("tip velocity", miss, tolerance, at, miss <= tolerance)]


def path_of(tip: Mapping[str, Any]) -> Array | None:
    """The complex coefficients of the path that the tip follows, lowest power of the path parameter first."""
    if tip.get("line") is not None:
        line = mapping(tip["line"], "tip.line", ("start", "end", "width", "elbow"))
        start, end = (complex(*vector(line.get(key), f"tip.line.{key}")) for key in ("start", "end"))
        return np.array([start, end - start])
    if tip.get("curve") is None:
        return None
    curve = mapping(tip["curve"], "tip.curve", ("x", "y", "width", "elbow"))
    x, y = (vector(curve.get(key), f"tip.curve.{key}") for key in ("x", "y"))
    found = np.zeros(max(len(x), len(y), 2), dtype=complex)
    found[: len(x)] += x
    found[: len(y)] += 1j * y
    return found


def on_the_path(limbs: Limbs, path: Array, width: float, nodes: Array, between: list[Array]) -> list[Check]:
    """The ends, and the distance from the path, of joint angles (joints, samples) at the nodes and ``between`` them."""
    still = np.zeros_like(nodes)
    place, length = limbs.tip(nodes, still)[0], float(np.sum(np.abs(path[1:])))
    checks = []
    for label, found, wanted in (("path start", place[0], path[0]), ("path end", place[-1], np.sum(path))):
        off = float(abs(found - wanted))
        checks.append(Check(label, off, _TIP * length, None, off <= _TIP * length))
    moments = np.concatenate([place, *(limbs.tip(q, np.zeros_like(q))[0] for q in between)])
    for label, points, share in (("path", place, _TIP), ("path between nodes", moments, _TUBE)):
        over = max(float(np.max(_distance(path, points))) - width / 2, 0.0)
        checks.append(Check(label, over, share * width, None, over <= share * width))
    return checks


def _distance(path: Array, points: Array) -> Array:
    """How far points are from a path: from the nearest of 1001 of its points, then by Newton's method."""
    grid = np.linspace(0.0, 1.0, 1001)
    first, second = polynomial.polyder(path), polynomial.polyder(path, 2)
    s = grid[np.argmin(np.abs(points[:, None] - polynomial.polyval(grid, path)), axis=1)]
    for _ in range(4):
        off, slope = polynomial.polyval(s, path) - points, polynomial.polyval(s, first)
        bend = np.abs(slope) ** 2 + (np.conj(off) * polynomial.polyval(s, second)).real
        s = np.clip(s - (np.conj(off) * slope).real / np.where(bend > 0, bend, np.inf), 0.0, 1.0)
    return np.asarray(np.abs(polynomial.polyval(s, path) - points))
