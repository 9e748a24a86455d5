"""A relaxation that every continuous move satisfies: what it cannot do, no mesh and no control can.

Between nodes each limited derivative may do anything within its limits. An interval then sees it only through its
moments ∫(t1-s)^a/a! (s-t0)^b/b! x(s) ds, each within [lower, upper]·h^(a+b+1)/(a+b+1)!. The moments with b = 0 and
a = 0 are what Taylor's formula leaves of the lower derivatives, forward and backward; the mixed ones are combinations.
Infeasibility of this program is impossibility in continuous time. With nodes at the switching times of a shortest move
it is sharp: costates are polynomials between them, of one sign, and the moments are their Bernstein coefficients.
"""

from __future__ import annotations

from dataclasses import replace
from math import comb, factorial
from typing import Any, Final

import numpy as np

from trajopt.attempt import Clock
from trajopt.mesh import Floats
from trajopt.model import Claim
from trajopt.motor import implied
from trajopt.problem import DERIVATIVES
from trajopt.transcribe import Setting, node_limits, prescribed

_CERTAIN: Final = 1e-9  # relative widening: below it rounding could be the reason


def is_impossible(setting: Setting, duration: float, clock: Clock) -> bool:
    """Whether no continuous move of this duration meets the kinematic limits and states, by a checked certificate.

    All limits are widened together by the least factor that makes the program feasible: when even our lower bound on
    that factor is positive, the move is impossible. (Feasibility as such is too hard a question near the edge.)
    """
    from trajopt.convex_solvers import LADDER
    from trajopt.model_cvxpy import ConvexModel

    setting = replace(setting, problem=implied(setting.problem))
    model = ConvexModel()
    by = model.vector(1, 1.0, np.zeros(1), np.full(1, np.inf))[0]
    _rows(setting, duration, model, by)
    model.minimize(by)
    for rung in LADDER:
        outcome = model.run(rung, clock.left(), above=_CERTAIN)
        if outcome.claim is Claim.INFEASIBLE or outcome.bound > _CERTAIN:
            return True
        if outcome.claim is Claim.OPTIMAL:
            return False
    return False


def _rows(setting: Setting, duration: float, model: Any, by: Any) -> None:
    problem, mesh, sizes = setting.problem, setting.mesh, setting.sizes
    order, steps = problem.order, mesh.steps * duration
    free = np.full(mesh.intervals + 1, np.inf)
    chain = [model.vector(mesh.intervals + 1, sizes.derivative[i], -free, free) for i in range(order)]
    for node, i, value in prescribed(problem, mesh):
        model.zero(chain[i][node] - value, sizes.derivative[i])
    for i in range(order + 1):
        limit = getattr(problem.limits, DERIVATIVES[i])
        if limit is None:
            continue
        if i < order:
            lower, upper = node_limits(problem, i, mesh, duration)
            _within(model, chain[i], lower, upper, sizes.derivative[i], by, 1.0)
        for r in range(1, i + 1):
            weight = steps**r / factorial(r)
            lower, upper = weight * limit.lowest, weight * limit.highest
            for b in range(r):
                moment = _moment(model, chain, steps, i, r - 1 - b, b)
                _within(model, moment, lower, upper, sizes.derivative[i - r], by, sizes.derivative[i] * weight)


def _within(model: Any, x: Any, lower: Floats, upper: Floats, size: float, by: Any, unit: Any) -> None:
    """``x`` within limits that are widened ``by`` times their own value (``by`` times ``unit`` where that is zero)."""
    for bound, sign in ((lower, -1.0), (upper, 1.0)):
        active = np.flatnonzero(np.isfinite(bound))
        if len(active):
            some = x if len(active) == len(bound) else x[active]
            wide = np.where(bound[active], np.abs(bound[active]), np.broadcast_to(unit, bound.shape)[active])
            model.nonpositive(sign * (some - bound[active]) - by * wide, size)


def _moment(model: Any, chain: list[Any], steps: Any, i: int, a: int, b: int) -> Any:
    """(N,) ∫(t1-s)^a/a! (s-t0)^b/b! x_i ds."""
    if not a:
        return _backward(model, chain, steps, i, b + 1)
    moment = _forward(model, chain, steps, i, a + b + 1) * ((-1.0) ** b * comb(a + b, b))
    for c in range(b):  # (s-t0)^b by powers of h - (t1-s)
        share = (-1.0) ** c * comb(a + c, c) / factorial(b - c)
        moment = moment + model.times(share * steps ** (b - c), _forward(model, chain, steps, i, a + c + 1))
    return moment


def _forward(model: Any, chain: list[Any], steps: Any, i: int, r: int) -> Any:
    """(N,) ∫(t1-s)^(r-1)/(r-1)! x_i ds: what Taylor's formula at the left node leaves of x_(i-r) at the right one."""
    rest = chain[i - r][1:]
    for p in range(r):
        rest = rest - model.times(steps**p / factorial(p), chain[i - r + p][:-1])
    return rest


def _backward(model: Any, chain: list[Any], steps: Any, i: int, r: int) -> Any:
    """(N,) ∫(s-t0)^(r-1)/(r-1)! x_i ds: the same backwards in time."""
    rest = chain[i - r][:-1]
    for p in range(r):
        rest = rest - model.times((-steps) ** p / factorial(p), chain[i - r + p][1:])
    return -rest if r % 2 else rest
