"""Tightening the bound on power and energy, on request.

Where the relaxation of `trajopt.lifted` is loose, the lifted squares lie above the squares at a few nodes only: next to
where the move leaves the reach that its chord was drawn for. There, the largest and the least speed are asked for of
any move in the relaxation that costs no more than the answer. No better move is faster or slower, so the chord may be
drawn between them; the bounds on the speed are those recomputed from the duals. Then the program is relaxed again.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from trajopt.attempt import Attempt, Clock, convex, to
from trajopt.lifted import Lifted
from trajopt.mesh import Floats
from trajopt.objective import Lowered, lower
from trajopt.transcribe import Setting, Transcript, without

Reach = tuple[Floats, Floats]  # (lower, upper) bounds on the speeds

_ROUNDS: Final = 40
_TIGHT: Final = 5e-7  # relative gap: enough
_LOOSE: Final = 0.2  # of the largest slack: nodes with more are tightened
_BESIDE: Final = 1  # and so many on either side, where the slack goes next
_MARGIN: Final = 1e-9  # relative: by how much the answer's cost may be exceeded, for rounding


def tighten(setting: Setting, relaxed: Attempt, value: float, clock: Clock) -> Attempt:
    """The relaxation with its bound brought closer to an answer of cost ``value``; as it is where nothing is gained."""
    setting = without(setting, ["brake_energy"])
    reach: Reach | None = None
    best = relaxed
    for _ in range(_ROUNDS):
        if value - best.bound <= _TIGHT * abs(value) or clock.over:
            break
        attempt, slack = _relaxed(setting, reach, clock)
        if attempt.trajectory is None or slack is None:
            break
        if reach is not None:
            gained, best = attempt.bound - best.bound, attempt if attempt.bound > best.bound else best
            if gained <= _TIGHT / 100 * abs(value):
                break
        low, high = (np.zeros(len(slack)), np.full(len(slack), np.inf)) if reach is None else reach
        for k in _loose(slack):
            high[k] = min(high[k], -_extreme(setting, (low, high), int(k), -1.0, value, clock))
            low[k] = max(low[k], _extreme(setting, (low, high), int(k), 1.0, value, clock))
        reach = (low, high)
    return best


def _relaxed(setting: Setting, reach: Reach | None, clock: Clock) -> tuple[Attempt, Floats | None]:
    """The relaxation, and by how much each lifted square lies above the square."""
    duration, goal = setting.problem.move.fixed_time or 0.0, to(setting.problem.objective)
    attempt = convex(_lifted(setting, reach), duration, goal, clock)
    if attempt.trajectory is None or attempt.laid is None:
        return attempt, None
    model = attempt.laid[1].model  # of this attempt, not of one that came to nothing after it
    speed, squares = (model.value(x) for x in model.lifted_squares)
    return attempt, squares - np.square(speed) / 2


def _extreme(setting: Setting, reach: Reach, k: int, sign: float, value: float, clock: Clock) -> float:
    """A lower bound on ``sign`` times the k-th speed of every move of the relaxation that costs at most ``value``."""
    size = setting.sizes.derivative[1]

    def goal(transcript: Transcript) -> Lowered:
        held = lower(transcript, setting.problem.objective)
        most = held.expression_value(value * (1 + _MARGIN))
        transcript.model.nonpositive(held.expression - most)
        return Lowered(transcript.model.lifted_squares[0][k] * (sign / size), size, None)

    return convex(_lifted(setting, reach), setting.problem.move.fixed_time or 0.0, goal, clock).bound


def _lifted(setting: Setting, reach: Reach | None) -> Setting:
    return replace(setting, quantities=partial(Lifted, reach=reach))


def _loose(slack: Floats) -> Floats:
    """The nodes whose square is lifted well above, and their neighbours."""
    inner = np.arange(1, len(slack) - 1)
    wide = inner[slack[1:-1] > _LOOSE * np.max(slack)]
    near = np.unique(np.concatenate([wide + step for step in range(-_BESIDE, _BESIDE + 1)]))
    return near[(near > 0) & (near < len(slack) - 1)]
