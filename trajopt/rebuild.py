"""From a solver's vector to a trajectory: re-integrated, so that nothing but the top derivative is taken on trust."""

from __future__ import annotations

from typing import Final

import numpy as np

from trajopt.mesh import Floats, Mesh
from trajopt.problem import Problem
from trajopt.scaling import Sizes
from trajopt.schemes import Scheme
from trajopt.trajectory import Trajectory
from trajopt.transcribe import node_limits, prescribed

_ROUNDING: Final = 1e-14  # of a condition, over its size: corrections hardly come closer


def rebuild(
    problem: Problem, mesh: Mesh, scheme: Scheme, sizes: Sizes, duration: float, start: Floats, top: Floats
) -> Trajectory:
    """The trajectory that starts at ``start`` (m,) and follows ``top`` (N,), corrected to meet every prescribed state.

    Solvers meet equalities to 1e-9 or so. The correction is the smallest that meets them to rounding, spent where
    the top derivative has room to its limits.
    """
    steps = mesh.steps * duration
    start = start.copy()
    conditions = []
    for node, i, value in prescribed(problem, mesh):
        if node == 0:
            start[i] = value
        else:
            conditions.append((node, i, value))
    lower, upper = node_limits(problem, problem.order, mesh, duration)
    top = np.clip(top, lower, upper)
    order = problem.order
    chain = scheme.rollout(start, top, steps)
    for _ in range(2):  # the second pass removes the rounding of the first
        miss = np.array([(value - chain[i][node]) / sizes.derivative[i] for node, i, value in conditions])
        if np.max(np.abs(miss), initial=0.0) <= _ROUNDING:
            break
        effects = np.array([scheme.influence(i, order, node, steps) / sizes.derivative[i] for node, i, _ in conditions])
        top = top + _correction(effects, miss, np.minimum(upper - top, top - lower) / sizes.derivative[order])
        chain = scheme.rollout(start, top, steps)
    for node, i, value in conditions:
        if node == mesh.intervals and abs(chain[i][node] - value) <= 1e-11 * sizes.derivative[i]:
            chain[i][node] = value
    return Trajectory(problem, mesh, scheme, sizes, duration, problem.move.start_position or 0.0, tuple(chain))


def _correction(effects: Floats, miss: Floats, room: Floats) -> Floats:
    """(N,) the smallest change of the top derivative, weighted by its (N,) ``room``, that makes good what is ``miss``
    (m,) of the conditions; (m, N) ``effects`` on them. All but the change over sizes."""
    weighted = effects * np.square(np.clip(room, 1e-4, 1.0))
    multiplier = np.linalg.lstsq(weighted @ effects.T, miss, rcond=None)[0]
    return np.asarray(weighted.T @ multiplier)
