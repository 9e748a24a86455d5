"""Durations ruled out one after the other, by the multipliers of coarse programs, where those of the arcs leave a gap.

The multipliers of a linear program on a grid bound the reach of every continuous move of its duration, and of shorter
ones down to some share of it; so many durations that each begins where the last ended cover an interval.
"""

from __future__ import annotations

from trajopt.switching.certificate import impossible, reach_beyond
from trajopt.switching.chain import NAMES, Chain
from trajopt.switching.coarse import Grid

_INTERVALS = 90
_FIRST, _LEAST, _PROGRAMS = 0.1, 1e-3, 40  # steps, relative; and how many are tried


def ruled_out(chain: Chain, low: float, high: float) -> float:
    """The longest duration, up to ``high``, shown to be too short for a chain; so is any below ``low``."""
    step = _FIRST
    for _ in range(_PROGRAMS):
        if low >= high or step < _LEAST:
            break
        duration = min(low * (1 + step), high)
        if _none_between(chain, low, duration):
            low, step = duration, 2 * step
        else:
            step /= 3
    return low


def _none_between(chain: Chain, low: float, duration: float) -> bool:
    grid = Grid(chain, duration, _INTERVALS)
    names = [f"{NAMES[chain.order]}.max"] * _INTERVALS
    for way in (1.0, -1.0):
        if (found := grid.prices(way)) is None:
            continue
        beyond = reach_beyond(chain, names, [grid.step] * _INTERVALS, *found)
        if impossible(beyond, low / duration) == (low / duration, 1.0):
            return True
    return False
