"""The least L2 norm of the top derivative where no limit acts: linear equations instead of a program.

What the states demand of the (N,) values x of the top derivative are a few rows E x = m. The least x'Wx is that of
x = W⁻¹E'λ with E W⁻¹E' λ = m; and no x that meets the rows has less than 2 λ'm - λ'E W⁻¹E'λ, whatever λ is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

import norms
from trajopt.attempt import ENOUGH, Attempt
from trajopt.mesh import Floats
from trajopt.model import Claim, Outcome
from trajopt.prices import ranked
from trajopt.problem import DERIVATIVES, Problem
from trajopt.rebuild import rebuild
from trajopt.routing import Route
from trajopt.signals import Signal
from trajopt.transcribe import Setting, origin_of, prescribed

ROUTE: Final = Route("closed form", "linear equations", "the smoothest move keeps all limits by itself", unique=True)
_KNOWN: Final = {*DERIVATIVES, "force", "power", "current", "voltage"}
_INSIDE: Final = 1e-12  # of a limit's signal, by which rounding may pass it
_STEP: Final = 1e-7  # of the duration, for the price of the time


def smoothest_move(setting: Setting) -> Attempt | None:
    """The move whose top derivative has the least L2 norm, where that is the objective and no limit acts; else None."""
    problem, duration = setting.problem, setting.problem.move.fixed_time
    if duration is None or not _takes(problem) or (least := _least(setting, duration)) is None:
        return None
    chain = setting.scheme.rollout(least.start, least.top, setting.mesh.steps * duration)
    if not all(_keeps(setting, name, values) for name, values in zip(DERIVATIVES, chain, strict=False)):
        return None
    move = rebuild(problem, setting.mesh, setting.scheme, setting.sizes, duration, least.start, least.top)
    for name in problem.limits.given:
        signal = move.signal(name)
        if not _keeps(setting, name, signal.rows if signal.pieces else signal.nodes):
            return None
    value, prices = move.measure(problem.objective), {}
    if not problem.move.via and setting.mesh.is_uniform and (later := _least(setting, duration * (1 + _STEP))):
        per_second = (later.value - least.value) / (_STEP * duration)
        prices["time"] = per_second, per_second * duration
    notes = {"prices": ranked(problem, prices, value), "bounds": "every move on this mesh"}
    outcome, size = Outcome(Claim.OPTIMAL, "closed form"), setting.sizes.derivative[-1]
    attempt = Attempt(outcome, move, value, least.value, notes=notes, size=size)
    return attempt if abs(attempt.gap) <= ENOUGH else None  # states close to each other may cost it digits


def _takes(problem: Problem) -> bool:
    """Whether the objective is that norm alone, and all limits are simple ones."""
    (term, *more), load = problem.objective.terms, problem.load
    plain = not (more or problem.objective.ceilings or problem.vibration or load.coulomb or load.curves)
    limited = all(name in _KNOWN and not limit.varies for name, limit in problem.limits.given.items())
    least = term.minimize == DERIVATIVES[problem.order] and type(term.norm) is norms.L2
    return plain and limited and least and problem.transcription.solver == "auto"


@dataclass(frozen=True)
class _Least:
    """The start (m,), the top derivative (N,), and what no move has less of; SI."""

    start: Floats
    top: Floats
    value: float


def _least(setting: Setting, duration: float) -> _Least | None:
    """The least without limits. None where the start is not given, or states contradict each other."""
    problem, mesh, scheme, order = setting.problem, setting.mesh, setting.scheme, setting.problem.order
    states, steps, sizes = prescribed(problem, mesh), mesh.steps * duration, setting.sizes.derivative
    given = {i: value for node, i, value in states if node == 0}
    later = [state for state in states if state[0]]
    if len(given) < order or not later:
        return None
    start = np.array([given[i] for i in range(order)])
    still = scheme.rollout(start, np.zeros(mesh.intervals), steps)
    E = np.array([scheme.influence(i, order, node, steps) * (sizes[order] / sizes[i]) for node, i, _ in later])
    m = np.array([(value - still[i][node]) / sizes[i] for node, i, value in later])
    weighted = E / scheme.weights(Signal(None, (still[-1],)), mesh.steps)
    G = weighted @ E.T
    y = np.linalg.lstsq(G, m, rcond=None)[0]
    if np.max(np.abs(G @ y - m)) > ENOUGH * np.max(np.abs(m)):
        return None
    size = problem.objective.terms[0].weight * sizes[order]
    return _Least(start, sizes[order] * (y @ weighted), size * float(np.sqrt(max(2 * y @ m - y @ G @ y, 0.0))))


def _keeps(setting: Setting, name: str, values: Floats) -> bool:
    """Whether values of a signal keep its limit, if it has one."""
    limit, room = setting.problem.limits.given.get(name), _INSIDE * setting.sizes.of(name)
    if limit is None:
        return True
    origin = origin_of(setting.problem, name)
    return bool(limit.lowest - room <= values.min() + origin and values.max() + origin <= limit.highest + room)
