"""Friction at rest, where it is not determined, and what a program without a solution then says about the move.

A program takes Coulomb friction at rest for that in motion, coulomb·sign of the one direction that the velocity limit
allows. At rest the real one takes any value up to it, so a program may refuse a move that is possible.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from trajopt.attempt import Clock, convex, smoothest, to
from trajopt.model import Claim
from trajopt.motor import available_force
from trajopt.problem import Problem
from trajopt.quantities import FORCES, Quantities
from trajopt.signals import Signal
from trajopt.transcribe import Setting

_TOTALS: Final = ("rms_force", "brake_energy")  # limits to which every pause adds its friction


def is_settled(setting: Setting, clock: Clock) -> bool:
    """Whether the move of a program without a solution is impossible on its mesh, however friction at rest counts.

    An axis that moves one way rests without acceleration, and then the program asks of its limits what it asks in a
    crawl. Where they allow a crawl, the program asks nothing that the move does not. Elsewhere, and for the nodes of
    the Euler scheme, at rest for an instant only, it is tried again with less friction than any move has.
    """
    problem = setting.problem
    if not problem.load.coulomb or not _loaded(problem) or _allows_crawling(setting):
        return True
    duration = problem.move.fixed_time
    assert duration is not None
    lenient = replace(setting, quantities=Shared)
    return convex(lenient, duration, to(smoothest(problem)), clock).outcome.claim is Claim.INFEASIBLE


class Shared(Quantities):
    """Quantities of a one-way axis with a share of its Coulomb friction, on every interval (Euler: at every node), of
    at least that of the velocity in its limit: none at rest, never more than in motion, and affine."""

    def _coulomb(self, velocity: Signal) -> Signal:
        load, way = self.problem.load, self.problem.one_way
        share = self._share(way * velocity.nodes, bool(velocity.pieces))
        friction = self.model.times(way * load.coulomb, share)
        return Signal(None, (friction,)) if velocity.pieces else Signal(friction, ())

    def _share(self, speed: Any, whole: bool) -> Any:
        model, count = self.model, self.mesh.intervals + (not whole)
        share = model.vector(count, 1.0, np.zeros(count), np.ones(count))
        limit = self.problem.limits.velocity
        assert limit is not None
        top = max(abs(limit.lowest), abs(limit.highest))
        if np.isfinite(top):
            for ends in (speed[:-1], speed[1:]) if whole else (speed,):
                model.nonpositive(ends - model.times(top, share), top)
        return share


def is_charged(setting: Setting) -> bool:
    """Whether a bound counts friction at rest as in motion: no bound on moves that pause, where it is held for less."""
    problem = setting.problem
    velocity = problem.limits.velocity
    pauses = velocity is not None and problem.one_way != 0 and velocity.lowest <= 0 <= velocity.highest
    if not problem.load.coulomb or not pauses:
        return False
    minimised = {term.minimize for term in problem.objective.terms} & {*FORCES, "electrical_energy"}
    return bool(minimised) or (bool(_loaded(problem)) and not _allows_crawling(setting))


def _loaded(problem: Problem) -> list[str]:
    """The limits that friction counts for."""
    return [name for name in (*FORCES, "brake_energy") if getattr(problem.limits, name, None) is not None]


def _allows_crawling(setting: Setting) -> bool:
    """Whether friction alone keeps the limits, at no speed, in a scheme that looks between the nodes, too."""
    problem = setting.problem
    if setting.scheme.terms == 1 or any(getattr(problem.limits, name, None) is not None for name in _TOTALS):
        return False
    force = problem.limits.force
    if force is not None and force.varies:
        return False
    low, high = available_force(problem, (0.0, 0.0))
    return low <= _friction(problem) <= high


def _friction(problem: Problem) -> float:
    return problem.one_way * problem.load.coulomb
