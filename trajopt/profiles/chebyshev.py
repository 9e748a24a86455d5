"""Chebyshev profiles: polynomials φ(x) = Σ p_i T_i(x) on -1 <= x <= 1, after Van Oosterwyck et al.

φ(±1) = ±1 and φ' = φ'' = 0 at both ends leave p_6 … p_n free ("JF"); φ''' = 0 as well leaves p_8 … p_n ("J0"). Every
profile that stays between its ends has |p_0| <= 1 and |p_k| <= 4/π; |p_k| <= 1 where 3k > n, and |p_k| <= 4/(πk) if it
never goes back. The search for the best one starts from zero, or is made in that whole box.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi, prod
from typing import Any, Final, Literal

import numpy as np
from numpy.polynomial import Chebyshev, chebyshev

import norms
from trajopt.errors import BadInput
from trajopt.mesh import Floats
from trajopt.problem import Problem
from trajopt.profiles.laws import Law, loaded, measured, motion, refuse

HIGHEST: Final = 30
_CONDITIONS: Final = {"JF": 3, "J0": 4}  # of φ and its derivatives, at each end
_OUTSIDE: Final = 1e3  # how dear it is to leave the table, per span and size of the objective


@dataclass(frozen=True)
class Family:
    """All profiles of a degree with given end conditions. Raises BadInput for a degree that cannot meet them."""

    degree: int
    ends: Literal["JF", "J0"] = "JF"

    def __post_init__(self) -> None:
        if self.ends not in _CONDITIONS:
            raise BadInput(f"ends: must be JF (jerk free) or J0 (jerk zero at the ends), got {self.ends!r}")
        least = 2 * _CONDITIONS[self.ends] - 1
        if not least <= self.degree <= HIGHEST:
            raise BadInput(
                f"degree: {self.degree} must be {least} to {HIGHEST}: end conditions {self.ends} alone take {least}"
            )

    @property
    def name(self) -> str:
        """As the paper has it: cheb9J0; poly5 and poly7J0 where nothing is free."""
        return f"{'cheb' if self.free else 'poly'}{self.degree}{'' if self.ends == 'JF' else self.ends}"

    @property
    def first(self) -> int:
        """The number of the first free coefficient."""
        return 2 * _CONDITIONS[self.ends]

    @property
    def free(self) -> int:
        """How many coefficients are free."""
        return self.degree + 1 - self.first

    @cached_property
    def basis(self) -> tuple[Floats, Floats]:
        """(n+1,) coefficients with all free ones zero, and (n+1, free) their change by the free ones."""
        rows = np.array([
            [sign ** (i + k) * _slope_at_one(i, k) for i in range(self.degree + 1)]
            for k in range(_CONDITIONS[self.ends]) for sign in (1, -1)
        ], dtype=float)  # fmt: skip
        values = np.zeros(len(rows))
        values[:2] = 1.0, -1.0
        bound, free = rows[:, : self.first], rows[:, self.first :]
        base = np.concatenate([np.linalg.solve(bound, values), np.zeros(self.free)])
        return base, np.vstack([-np.linalg.solve(bound, free), np.eye(self.free)])

    def law(self, free: Any = None) -> Law:
        """The profile with these free coefficients, none by default."""
        base, by = self.basis
        return Law(self.name, (Chebyshev(base if free is None else base + by @ np.asarray(free), domain=[0, 1]),))

    def box(self, monotone: bool = False) -> list[tuple[float, float]]:
        """The exact bounds on the free coefficients."""
        return [(-x, x) for x in (bound(k, self.degree, monotone) for k in range(self.first, self.degree + 1))]


def bound(k: int, degree: int, monotone: bool = False) -> float:
    """The exact bound on |p_k| of a profile of a degree that stays within -1 to 1 (and never goes back)."""
    if k == 0:
        return 1.0
    return 4 / (pi * k) if monotone else 1.0 if 3 * k > degree else 4 / pi


def _slope_at_one(i: int, k: int) -> float:
    """The k-th derivative of T_i at 1."""
    return prod((i**2 - j**2) / (2 * j + 1) for j in range(k))


def search(problem: Problem, family: Family) -> Floats:
    """The free coefficients of the best profile that a gradient search from zero finds: Levenberg and Marquardt for an
    RMS, else BFGS. Raises BadInput for a problem without rest-to-rest move or fixed time."""
    return _descend(_Cost(problem, family), np.zeros(family.free))


def search_box(problem: Problem, family: Family, seed: int = 1) -> Floats:
    """The same from differential evolution in the whole box, and a gradient search from the best of it."""
    from scipy.optimize import Bounds, differential_evolution

    cost = _Cost(problem, family)
    if not family.free:
        return np.zeros(0)
    each: Any = cost.each
    low, high = zip(*family.box(), strict=True)
    found = differential_evolution(
        each, Bounds(low, high), rng=seed, vectorized=True, updating="deferred", polish=False, tol=1e-10, maxiter=600
    )
    return _descend(cost, found.x)


def _descend(cost: _Cost, start: Floats) -> Floats:
    from scipy.optimize import least_squares, minimize

    if not len(start):
        return start
    if cost.is_rms:
        tight = 1e-14
        return np.asarray(
            least_squares(cost.residual, start, cost.slope, method="lm", xtol=tight, ftol=tight, gtol=tight).x
        )
    value: Any = lambda p: float(cost.each(p[:, None])[0])  # noqa: E731
    return np.asarray(minimize(value, start, method="BFGS").x)


class _Cost:
    """The objective over the free coefficients, at Gauss points."""

    def __init__(self, problem: Problem, family: Family) -> None:
        refuse(problem)
        self.problem, self.family = problem, family
        places, self.weights = family.law().quadrature
        self.base, self.by = [], []
        for i in range(4):
            table = chebyshev.chebvander(2 * places - 1, max(family.degree - i, 0))
            change = 2.0**i * table @ chebyshev.chebder(np.eye(family.degree + 1), i) if i else table
            self.base.append(change @ family.basis[0])
            self.by.append(change @ family.basis[1])
        spans = np.array([curve.span for curve in problem.load.curves.values()]).reshape(-1, 2)
        self.reach = (np.max(spans[:, 0]), np.min(spans[:, 1])) if len(spans) else (-np.inf, np.inf)
        (term, *others) = problem.objective.terms
        self.is_rms = not others and term.minimize == "force" and isinstance(term.norm, norms.L2)
        self.size = self._value(self._motion(np.zeros((family.free, 1)))[0])[0]

    def _motion(self, free: Floats) -> tuple[dict[str, Any], Floats]:
        """Signals (points, profiles), with positions kept within the tables, and by what share they leave them."""
        phi = [base[:, None] + by @ free for base, by in zip(self.base, self.by, strict=True)]
        known = motion(self.problem, phi)
        inside = np.clip(known["position"], *self.reach)
        outside = (known["position"] - inside) / (np.ptp(self.reach) if len(self.problem.load.curves) else 1.0)
        known["position"] = inside
        return known | loaded(self.problem.load, known), outside

    def _value(self, known: dict[str, Any]) -> list[float]:
        count = known["velocity"].shape[1]
        return [
            measured(self.problem, {name: x[:, k] for name, x in known.items()}, self.weights) for k in range(count)
        ]

    def each(self, free: Floats) -> Floats:
        """(profiles,) the objective of each column of free coefficients."""
        known, outside = self._motion(free)
        return np.array(self._value(known)) + _OUTSIDE * self.size * (self.weights @ outside**2)

    def residual(self, free: Floats) -> Floats:
        """What is squared and summed to the square of the RMS of force, and to the price of leaving the table."""
        known, outside = self._motion(free[:, None])
        root = np.sqrt(self.weights)
        return np.concatenate([root * known["force"][:, 0], _OUTSIDE * self.size * root * outside[:, 0]])

    def slope(self, free: Floats) -> Floats:
        """The derivative of `residual`: ∂T/∂q = F' + ½ J'' v² + J' a, ∂T/∂v = J' v + viscous, ∂T/∂a = J."""
        known, outside = self._motion(free[:, None])
        load, (q, v, a) = self.problem.load, (known[name] for name in ("position", "velocity", "acceleration"))
        by = motion(self.problem, [x + 0.0 for x in self.by])
        centre = motion(self.problem, [np.zeros(1)])["position"]
        change_q, change_v, change_a = by["position"] - centre, by["velocity"], by["acceleration"]
        curve, force = load.curves.get("inertia"), load.force
        if curve is None:
            assert isinstance(load.inertia, float)
            change = load.inertia * change_a + load.viscous * change_v
        else:
            slope, bend = curve.at(q, 1), curve.at(q, 2)
            change = (bend * v**2 / 2 + slope * a) * change_q + (slope * v + load.viscous) * change_v
            change += curve.at(q) * change_a
        change = change + (0.0 if force is None else force.at(q, 1) * change_q)
        root = np.sqrt(self.weights)[:, None]
        left = (outside != 0) * change_q / (np.ptp(self.reach) if len(load.curves) else 1.0)
        return np.concatenate([root * change, _OUTSIDE * self.size * root * left])
