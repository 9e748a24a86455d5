"""Laws of motion in closed form: piecewise polynomials from rest to rest, laid on a move and measured exactly.

A law has stroke from -1 to 1 in time 0 to 1. Its objective is an integral over Gauss points, which no mesh limits: the
trapezoid, the quintic and the septic that drives offer, and the Chebyshev profiles of `trajopt.profiles.chebyshev`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any, Final

import numpy as np
from numpy.polynomial import Chebyshev

from trajopt import motor
from trajopt.errors import BadInput
from trajopt.fields import Limit
from trajopt.mesh import Floats
from trajopt.objective import POWERS, integral
from trajopt.problem import DERIVATIVES, WITHOUT_NORM, Load, Objective, Problem
from trajopt.quantities import force_along
from trajopt.signals import OnFloats, gauss

_PARTS: Final = 40  # of every piece, with so many Gauss points each:
_POINTS: Final = 10
_FINE: Final = 4001  # places at which a limit is looked at
_KEPT: Final = 1e-6  # of a limit


@dataclass(frozen=True)
class Law:
    """``pieces``: polynomials of the fraction of the time, each on its domain, with values from -1 to 1."""

    name: str
    pieces: tuple[Chebyshev, ...]

    def at(self, fractions: Floats, derivative: int = 0) -> Floats:
        """The law, or a derivative of it, at fractions of the time; at a corner what follows."""
        starts = [piece.domain[0] for piece in self.pieces]
        which = np.clip(np.searchsorted(starts, fractions, side="right") - 1, 0, len(starts) - 1)
        found = np.empty(len(fractions))
        for k, piece in enumerate(self.pieces):
            found[which == k] = piece.deriv(derivative)(fractions[which == k])
        return found

    @property
    def quadrature(self) -> tuple[Floats, Floats]:
        """Places inside the pieces, and which share of the time each stands for."""
        points, shares = gauss(_POINTS)
        places, weights = [], []
        for piece in self.pieces:
            start, end = piece.domain
            ends = np.linspace(start, end, _PARTS + 1)
            places.append((ends[:-1, None] + np.diff(ends)[:, None] * points).ravel())
            weights.append(np.outer(np.diff(ends), shares).ravel())
        return np.concatenate(places), np.concatenate(weights)

    def to_dict(self) -> dict[str, Any]:
        """Plain data: for each piece where it starts and ends, and its Chebyshev coefficients there."""
        return {
            "name": self.name,
            "pieces": [{"from": p.domain[0], "to": p.domain[1], "coefficients": p.coef.tolist()} for p in self.pieces],
        }


def trapezoid() -> Law:
    """A third of the time each speeding up, cruising and slowing down."""
    thirds = (0.0, 1 / 3, 2 / 3, 1.0)

    def piece(k: int, *power: float) -> Chebyshev:
        return Chebyshev.cast(
            np.polynomial.Polynomial(power, domain=thirds[k : k + 2], window=[0, 1]), domain=thirds[k : k + 2]
        )

    return Law("trapezoid 1/3", (piece(0, -1.0, 0.0, 0.5), piece(1, -0.5, 1.0), piece(2, 0.5, 1.0, -0.5)))


@dataclass(frozen=True)
class Laid:
    """A law laid on the move of a problem. Raises BadInput for a move that is not rest to rest in a given time."""

    problem: Problem
    law: Law

    def __post_init__(self) -> None:
        refuse(self.problem)

    def signals(self, fractions: Floats) -> dict[str, Floats]:
        """Position (absolute) to jerk, force and what is made of it, SI, at fractions of the time."""
        found = motion(self.problem, [self.law.at(fractions, i) for i in range(4)])
        return found | loaded(self.problem.load, found)

    def measure(self, objective: Objective | None = None) -> float:
        """The problem's objective, or another one, SI."""
        places, weights = self.law.quadrature
        inside = self.signals(places)
        ends = self.signals(np.linspace(0.0, 1.0, _FINE))
        return measured(self.problem, inside, weights, objective, ends)

    def broken(self) -> list[str]:
        """The limits that the law does not keep, by name; a jump counts as infinite."""
        fine = self.signals(np.linspace(0.0, 1.0, _FINE))
        found = []
        for name, limit in self.problem.limits.given.items():
            if name == "rms_force":
                out = _cycle_rms(self) > limit.highest * (1 + _KEPT)
            elif name in fine:
                out = _leaves(fine[name], limit)
            else:
                out = False
            found += [name] if out else []
        return found


def _leaves(values: Floats, limit: Limit) -> bool:
    low, high = limit.at(np.linspace(0.0, 1.0, len(values)))
    size = max(abs(x) for x in (limit.lowest, limit.highest) if abs(x) < inf)
    over = max((float(np.max(side)) for side in (
        *([] if low is None else [low - values]), *([] if high is None else [values - high])
    )), default=0.0)  # fmt: skip
    return over > _KEPT * size


def _cycle_rms(laid: Laid) -> float:
    problem = laid.problem
    places, weights = laid.law.quadrature
    force, duration, dwell = laid.signals(places)["force"], problem.move.fixed_time or 0.0, problem.move.dwell
    held = 0.0 if problem.load.force is None else float(problem.load.force.at(problem.move.end.position))
    return float(np.sqrt((weights @ force**2 * duration + held**2 * dwell) / (duration + dwell)))


def refuse(problem: Problem) -> None:
    """Raise BadInput for what no law of motion can be laid on."""
    move, load = problem.move, problem.load
    ends = [state.fixed(2) for state in (move.start, move.end)]
    if not isinstance(move.end.position, float) or move.start_position is None or any(e.get(1) != 0.0 for e in ends):
        raise BadInput("move: a profile goes from rest to rest between given positions; give both, and no velocity")
    if move.fixed_time is None or move.via:
        raise BadInput('move.time: a profile needs a fixed time such as "1 s", and no via states')
    if load.inertia is None or not (isinstance(load.inertia, float) or "inertia" in load.curves):
        raise BadInput("load.inertia: a profile needs one, constant or over position")
    if any(term.minimize in ("position", "time", "snap") for term in problem.objective.terms):
        raise BadInput("objective.minimize: must be velocity to jerk, or made of force, where profiles are compared")


def motion(problem: Problem, phi: list[Any]) -> dict[str, Any]:
    """Position, velocity, … from a law and its derivatives by the fraction of the time."""
    start, end, duration = problem.move.start_position or 0.0, problem.move.end.position, problem.move.fixed_time or 1.0
    assert isinstance(end, float)
    half = (end - start) / 2
    found = {name: half * x / duration**i for i, (name, x) in enumerate(zip(DERIVATIVES, phi, strict=False))}
    return found | {"position": (start + end) / 2 + found["position"]}


def loaded(load: Load, known: dict[str, Any]) -> dict[str, Any]:
    """Force, power and with a motor what it takes, from position, velocity and acceleration."""
    model, velocity = OnFloats(), known["velocity"]
    force = force_along(model, load, known["position"], velocity, known["acceleration"])
    force = force + load.coulomb * np.sign(velocity)
    found = {"force": force, "power": force * velocity}
    if load.motor is not None:
        constant, resistance = load.motor
        current = force / constant
        found |= {"current": current, "voltage": resistance * current + constant * velocity}
        found |= {"heat": resistance * current**2, "electrical_power": motor.power(load, force, velocity)}
    return found


def measured(
    problem: Problem, inside: dict[str, Any], weights: Floats, objective: Objective | None = None, ends: Any = None
) -> float:
    """An objective from signals at places that stand for shares of the time; peaks also among those of ``ends``."""
    total, duration = 0.0, problem.move.fixed_time or 1.0
    for term in (objective or problem.objective).terms:
        name = POWERS.get(term.minimize, term.minimize)
        norm = term.norm or integral(term.minimize, problem.load)
        value = norm.measure(inside[name], weights, duration)
        if term.minimize not in WITHOUT_NORM and norm.name == "linf" and ends is not None:
            value = max(value, norm.measure(ends[name], np.ones(1), duration))
        total += term.weight * value
    return float(total)
