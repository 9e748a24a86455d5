"""Moves stretched in time: one that takes λ times as long along the same path has an i-th derivative λ^-i times as
large."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final

from trajopt.problem import DERIVATIVES, Problem, Term

_OURS: Final = ("l1", "l2", "linf")
_DERIVATIVE: Final[Mapping[str, int]] = MappingProxyType({name: i for i, name in enumerate(DERIVATIVES)})
_INERTIAL: Final = {"force": 2, "power": 3, "energy": 3}
FALLS: Final[Mapping[str, int]] = MappingProxyType({**_DERIVATIVE, **_INERTIAL})  # quantity -> its power of 1/λ


def stretched_cost(term: Term) -> int:
    """The power of 1/λ that a term falls with, in the exact scheme: an integral has a longer time to grow in."""
    return FALLS[term.minimize] - (term.norm is None or term.norm.name == "l1")


def is_plain(problem: Problem, terms: Sequence[Term]) -> bool:
    """Whether a stretched move answers the same problem, but for its time and limits, which fall as FALLS says, as do
    the terms: from rest to rest, without tables, vias and modes; and with a load only where nothing acts but the
    inertia."""
    limits, load = problem.limits.given, problem.load
    rest = not any(value for _, i, value in problem.prescribed if i)
    plain = not (problem.move.via or problem.vibration or any(x.varies for x in limits.values()))
    known = all(term.norm is None or term.norm.name in _OURS for term in terms)
    loaded = {*limits, *(term.minimize for term in terms)} - {*DERIVATIVES, "time"}
    inertial = isinstance(load.inertia, float) and not (load.coulomb or load.viscous or load.curves)
    return rest and plain and known and (not loaded or inertial)
