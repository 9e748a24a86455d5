"""A second look at an arm of the user's own, whose dynamics the checker cannot know."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from trajopt.axes.dynamics import Energetic
from trajopt.axes.motion import Motion
from trajopt.mesh import Floats

_SAMPLES: Final = 40
_STEP: Final = 1e-4  # s, of the differences of energy
_EQUAL: Final = 1e-9  # of the largest torque
_BALANCE: Final = 1e-5  # of the largest power


def second_look(motion: Motion) -> tuple[dict[str, Any], list[str]]:
    """What was looked at, and what is wrong: whether torques are finite, the same one by one as all at once, and affine
    in the acceleration; where the arm knows its energy, whether power is its rate. A tip is compared by differences."""
    arm, time = motion.problem.dynamics, np.linspace(0.0, motion.duration, _SAMPLES + 2)[1:-1]
    states = list(motion.at(time).values())
    q, w, a = ([state[name] for state in states] for name in ("position", "velocity", "acceleration"))
    torque = np.array(arm.torque(q, w, a))
    size, looks = float(np.max(np.abs(torque))), {}
    looks["finite"] = bool(np.all(np.isfinite(torque)))
    looks["elementwise"] = _close(_one_by_one(arm, q, w, a), torque, size)
    half = np.array(arm.torque(q, w, [x / 2 for x in a]))
    looks["affine in acceleration"] = _close(2 * half - np.array(arm.torque(q, w, [0 * x for x in a])), torque, size)
    if isinstance(arm, Energetic):
        looks["power balance"] = _balanced(arm, q, w, a, torque)
    if motion.problem.reaches:
        looks["tip velocity by differences"] = _moving(arm, q, w)
    return looks, [f"the arm's own dynamics fail the look at: {name}" for name, fine in looks.items() if not fine]


def _close(found: Floats, wanted: Floats, size: float) -> bool:
    return bool(np.max(np.abs(found - wanted)) <= _EQUAL * size)


def _one_by_one(arm: Any, q: list[Floats], w: list[Floats], a: list[Floats]) -> Floats:
    columns = [
        [np.asarray(x)[0] for x in arm.torque(*([x[k : k + 1] for x in part] for part in (q, w, a)))]
        for k in range(len(q[0]))
    ]
    return np.array(columns).T


def _balanced(arm: Energetic, q: list[Floats], w: list[Floats], a: list[Floats], torque: Floats) -> bool:
    def energy(t: float) -> Floats:
        then = [x + t * v + t * t / 2 * g for x, v, g in zip(q, w, a, strict=True)]
        return np.asarray(arm.energy(then, [v + t * g for v, g in zip(w, a, strict=True)]))

    power = np.sum(torque * np.array(w), axis=0)
    rate = (energy(_STEP) - energy(-_STEP)) / (2 * _STEP)
    return bool(np.max(np.abs(rate - power)) <= _BALANCE * max(float(np.max(np.abs(power))), 1e-12))


def _moving(arm: Any, q: list[Floats], w: list[Floats]) -> bool:
    def tip(t: float) -> Floats:
        return np.array(arm.tip([x + t * v for x, v in zip(q, w, strict=True)]))

    given = np.array(arm.tip_velocity(q, w))
    found = (tip(_STEP) - tip(-_STEP)) / (2 * _STEP)
    return bool(np.max(np.abs(found - given)) <= _BALANCE * max(float(np.max(np.abs(given))), 1e-12))
