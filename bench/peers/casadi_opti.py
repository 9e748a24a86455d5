"""CasADi's Opti with Ipopt: the exact scheme, jerk constant on intervals, written with vectors as its manual advises.

Norms and peaks are epigraph variables; mumps orders by PORD, without which one dense column takes it a minute.
"""

from __future__ import annotations

from typing import Any, Final

import casadi as ca
import numpy as np

from bench.cases import ACCELERATION, DISTANCE, DURATION, JERK, MASS, VELOCITY, Case

SIZES: Final = (DISTANCE, VELOCITY[1], ACCELERATION, JERK)  # in SI units Ipopt takes ten times as long
OPTIONS: Final[dict[str, Any]] = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-9,
    "mumps_pivot_order": 4,
    "max_iter": 1000,
    "max_wall_time": 40.0,
}


class Opti:
    """A case as an Opti problem, with the distance as its parameter."""

    def __init__(self, case: Case, intervals: int) -> None:
        self.case, self.opti = case, ca.Opti()
        self.solution: Any = None
        opti, n, h = self.opti, intervals, DURATION / intervals
        self.scaled = [opti.variable(n + 1), opti.variable(n + 1), opti.variable(n + 1), opti.variable(n)]
        q, v, a, j = (size * x for size, x in zip(SIZES, self.scaled, strict=True))
        self.distance, self.chain = opti.parameter(), (q, v, a, j)
        v0, a0 = v[:-1], a[:-1]
        opti.subject_to((q[1:] - q[:-1] - h * v0 - h**2 / 2 * a0 - h**3 / 6 * j) / SIZES[0] == 0)
        opti.subject_to((v[1:] - v0 - h * a0 - h**2 / 2 * j) / SIZES[1] == 0)
        opti.subject_to((a[1:] - a0 - h * j) / SIZES[2] == 0)
        opti.subject_to(ca.vertcat(q[0], v[0], a[0], v[-1], a[-1]) == 0)
        opti.subject_to(q[-1] == self.distance)
        opti.subject_to(opti.bounded(VELOCITY[0], v[1:-1], VELOCITY[1]))
        opti.subject_to(opti.bounded(VELOCITY[0], (v0 + h / 2 * a0)[1:-1], VELOCITY[1]))  # between the nodes
        opti.subject_to(opti.bounded(-ACCELERATION, a[1:-1], ACCELERATION))
        opti.subject_to(opti.bounded(-JERK, j, JERK))
        opti.minimize(sum(weight * self._lowered(what, norm, h) for what, norm, weight in case.terms))
        options: dict[str, Any] = {"print_time": False, "error_on_fail": True}
        opti.solver("ipopt", options, OPTIONS)

    def solve(self, distance: float | None = None, warm: bool = False) -> float:
        """The objective, over the case's own distance (m) or another; ``warm``: from the last answer. Raises
        RuntimeError where Ipopt fails."""
        opti, (q, v, a, _) = self.opti, self.scaled
        distance = self.case.distance if distance is None else distance
        opti.set_value(self.distance, distance)
        if warm:
            assert self.solution is not None
            opti.set_initial(self.solution.value_variables())
        else:  # the cubic between the ends, so that no start is degenerate
            s = np.linspace(0.0, 1.0, q.shape[0])
            opti.set_initial(q, distance * (3 * s**2 - 2 * s**3) / SIZES[0])
            opti.set_initial(v, distance * (6 * s - 6 * s**2) / DURATION / SIZES[1])
            opti.set_initial(a, distance * (6 - 12 * s) / DURATION**2 / SIZES[2])
        self.solution = opti.solve()
        value = float(self.solution.value(opti.f))
        alone = len(self.case.terms) == 1 and self.case.terms[0][1] == "l2"
        return float(np.sqrt(value)) if alone else value

    def _lowered(self, what: str, norm: str, h: float) -> Any:
        """A term, its square where it is a root mean square."""
        _, v, a, j = self.chain
        x = {"velocity": v, "acceleration": a, "jerk": j}.get(what, MASS * a * v)
        n = x.shape[0]
        weights = ca.DM.ones(n) * h
        if n > j.shape[0]:
            weights[0] = weights[-1] = h / 2
        if norm == "l2":
            return ca.dot(weights, x**2) / DURATION
        bound = self.opti.variable() if norm == "linf" else self.opti.variable(n)
        self.opti.subject_to(x - bound <= 0)
        self.opti.subject_to(-x - bound <= 0)
        return bound if norm == "linf" else ca.dot(weights, bound)


def cold(case: Case, intervals: int) -> float:
    """Build and solve: the objective."""
    return Opti(case, intervals).solve()
