"""The shortest move of a chain of integrators, by the method that its order and its ends call for."""

from __future__ import annotations

from dataclasses import replace

from trajopt.switching.chain import NAMES, Arcs, Chain, Unresolved
from trajopt.switching.doomed import refuse_doomed
from trajopt.switching.general import CUT_OFF, OPEN, shortest_general
from trajopt.switching.low import OutOfRange, shortest_low
from trajopt.switching.snap import between_rests


def shortest(chain: Chain, min_dwell: float = 0.0, touches: int | None = None) -> Arcs:
    """The verified arcs of least duration.

    A fourth-order move that holds its greatest velocity needs switches without end; they are cut off where the loss is
    below 1e-10 of the duration, after ``touches`` touches of the limit at each end, or before two switches come closer
    than ``min_dwell``; ``bracket`` tells what that costs. Orders one to three do not chatter and ignore both.
    The bracket is closed but for rounding for orders one to three without active position limits, and mostly so at
    fourth order; where the multipliers of the arcs prove less, the lower bound is that of coarse programs or of lower
    orders.
    Raises Impossible, or Unresolved when no list of arcs could be verified.
    """
    if min_dwell < 0 or (touches is not None and touches < 0):
        raise ValueError("min_dwell and touches must not be negative")
    refuse_doomed(chain)
    if chain.start == chain.end:
        return Arcs((), (), (), (), 0.0, 0.0, 0.0)
    if chain.order < 4:
        try:
            return shortest_low(chain)
        except OutOfRange:
            return shortest_general(chain, 0.0, None)
    if not chain.at_rest:
        return _either_way(chain, min_dwell, touches, None)
    arcs = between_rests(chain, min_dwell, touches)
    if arcs.loss > OPEN and not arcs.chatters and min_dwell == 0 and touches is None:
        arcs = replace(_either_way(chain, min_dwell, touches, arcs), ordinary=arcs.ordinary)
    return arcs


def _either_way(chain: Chain, min_dwell: float, touches: int | None, best: Arcs | None) -> Arcs:
    """The shortest that is found forwards in time, or where that leaves a bracket, backwards; or known already."""
    failure: Unresolved | None = None
    for turn in (False, True):
        try:
            arcs = shortest_general(chain.reversed() if turn else chain, min_dwell, touches)
        except Unresolved as reason:
            failure = failure or reason
            continue
        arcs = run_backwards(arcs, chain.order) if turn else arcs
        shorter = arcs if best is None or arcs.duration < best.duration else best
        lowest = max(arcs.lowest, best.lowest if best else 0.0)
        best = replace(shorter, lowest=min(lowest, shorter.duration))
        if min_dwell or touches is not None or best.loss <= (CUT_OFF if best.chatters else OPEN):
            break
    if best is None:
        assert failure is not None
        raise failure
    return best


def run_backwards(arcs: Arcs, order: int) -> Arcs:
    """The arcs of a chain from those of the one that runs backwards in time: odd derivatives turn their sign."""

    def turned(name: str) -> str:
        quantity, _, side = name.partition(".")
        other = {"max": "min", "min": "max"}[side]
        return f"{quantity}.{other if NAMES.index(quantity) % 2 else side}"

    sign = -1.0 if order % 2 else 1.0
    return replace(
        arcs,
        durations=arcs.durations[::-1],
        tops=tuple(sign * top for top in arcs.tops[::-1]),
        active=tuple(map(turned, arcs.active[::-1])),
        touches=tuple((arcs.duration - time, turned(name)) for time, name in arcs.touches[::-1]),
    )
