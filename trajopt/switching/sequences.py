"""Sequences of arcs between touches of the velocity limit: what they must meet, their bound, and their verdict."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate
from math import fsum, inf

from trajopt.switching.certificate import lower_bound
from trajopt.switching.chain import Arcs, Chain
from trajopt.switching.polynomials import audit
from trajopt.switching.ramps import Part, merged
from trajopt.switching.stationary import Condition, prices_of

Parts = list[Part]  # a touch of the velocity limit between each and the next


@dataclass(frozen=True)
class Candidate:
    """A sequence with the lower bound on the least duration that its multipliers give, or minus infinity."""

    parts: Parts
    lowest: float = -inf

    @property
    def pieces(self) -> Part:
        return tuple(p for part in self.parts for p in part)

    @property
    def duration(self) -> float:
        return fsum(p.duration for p in self.pieces)


def certified(chain: Chain, sequence: Parts) -> Candidate:
    parts = [merged(part) for part in sequence]
    flat = [p for part in parts for p in part]
    durations = [p.duration for p in flat]
    conditions = [*plateaus(chain, parts), *(Condition(len(flat), i, x) for i, x in enumerate((1.0, 0.0, 0.0, 0.0)))]
    prices = prices_of((0.0,) * 4, [p.top for p in flat], conditions, durations)
    return Candidate(parts, lower_bound(chain, [p.active for p in flat], durations, conditions, prices))


def plateaus(chain: Chain, parts: Parts) -> list[Condition]:
    """Touches and plateaus of a sequence without empty pieces."""
    out, arcs = [], 0
    for number, part in enumerate(parts):
        if number:
            out += [Condition(arcs, 1, chain.limits[1][1]), Condition(arcs, 2, 0.0)]
        for piece in part:
            name, _, side = piece.active.partition(".")
            derivative = {"velocity": 1, "acceleration": 2, "jerk": 3}.get(name)
            if derivative is not None:
                out.append(Condition(arcs, derivative, chain.limits[derivative][side == "max"]))
                out += [Condition(arcs, i, 0.0) for i in range(derivative + 1, 4)]
            arcs += 1
    return out


def keeps(candidate: Candidate, min_dwell: float) -> bool:
    whole = merged(candidate.pieces)
    return min(p.duration for p in whole) >= min_dwell * (1 - 1e-12)


def accepted(chain: Chain, candidate: Candidate) -> Arcs | None:
    pieces = merged(candidate.pieces)
    verdict = audit(chain, [p.top for p in pieces], [p.duration for p in pieces])
    if not verdict.accepted:
        return None
    ends = accumulate(fsum(p.duration for p in part) for part in candidate.parts)
    touches = tuple((t, "velocity.max") for t in list(ends)[:-1])
    return Arcs(
        tuple(p.duration for p in pieces),
        tuple(p.top for p in pieces),
        tuple(p.active for p in pieces),
        touches,
        -inf,
        verdict.residual,
        verdict.excess,
    )


def mirrored_arcs(arcs: Arcs) -> Arcs:
    turn = {"max": "min", "min": "max"}

    def name(text: str) -> str:
        limit, _, side = text.partition(".")
        return f"{limit}.{turn[side]}"

    return replace(
        arcs,
        tops=tuple(0.0 - u for u in arcs.tops),
        active=tuple(map(name, arcs.active)),
        touches=tuple((t, name(x)) for t, x in arcs.touches),
    )
