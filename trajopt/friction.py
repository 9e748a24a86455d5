"""Friction at rest, where it is not determined, and what a program without a solution then says about the move.

A program takes Coulomb friction at rest for that in motion, coulomb·sign of the one direction that the velocity limit
allows. At rest the real one takes any value up to it, so a program may refuse a move that is possible.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from trajopt.attempt import Clock, convex, smoothest, to
from trajopt.fields import Limit
from trajopt.model import Claim
from trajopt.motor import available_force
from trajopt.problem import Problem
from trajopt.quantities import FORCES
from trajopt.transcribe import Setting, without

_TOTALS: Final = ("rms_force", "brake_energy")  # limits to which every pause adds its friction


def is_settled(setting: Setting, clock: Clock) -> bool:
    """Whether the move of a program without a solution is impossible on its mesh, however friction at rest counts.

    An axis that moves one way rests without acceleration, and then the program asks of its limits what it asks in a
    crawl. Where they allow a crawl, the program asks nothing that the move does not. Elsewhere, and for the nodes of
    the Euler scheme, at rest for an instant only, it is tried again with limits that no pause can break.
    """
    problem = setting.problem
    loaded = _loaded(problem)
    if not problem.load.coulomb or not loaded or _allows_crawling(setting):
        return True
    force = problem.limits.force
    lenient = without(setting, [name for name in loaded if name != "force"])
    if force is not None:
        limits = lenient.problem.limits.model_copy(update={"force": _lenient(setting, force)})
        lenient = replace(lenient, problem=lenient.problem.model_copy(update={"limits": limits}))
    duration = problem.move.fixed_time
    assert duration is not None
    return convex(lenient, duration, to(smoothest(problem)), clock).outcome.claim is Claim.INFEASIBLE


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


def _lenient(setting: Setting, force: Limit) -> Limit:
    """The limit with room for the friction of a crawl or, in the Euler scheme, for any change of friction."""
    friction = _friction(setting.problem)
    by = 2 * friction if setting.scheme.terms == 1 else 0.0
    low, high = min(force.lowest + min(by, 0.0), friction), max(force.highest + max(by, 0.0), friction)
    return Limit(min=None if force.min is None else low, max=None if force.max is None else high)
