"""Ruckig: least times at third order; it knows no fourth."""

from __future__ import annotations

from collections.abc import Callable

from ruckig import InputParameter, Result, Ruckig, Trajectory

import trajopt


def least_time(stated: trajopt.Problem) -> Callable[[], float] | None:
    """What finds the least time of the same problem, s; None at fourth order."""
    if stated.order != 3:
        return None
    given = InputParameter(1)
    for name in ("position", "velocity", "acceleration"):
        for which, state in (("current", stated.move.start), ("target", stated.move.end)):
            setattr(given, f"{which}_{name}", [float(getattr(state, name) or 0.0)])
    velocity, acceleration, jerk = (getattr(stated.limits, name) for name in ("velocity", "acceleration", "jerk"))
    given.min_velocity, given.max_velocity = [velocity.lowest], [velocity.highest]
    given.min_acceleration, given.max_acceleration = [acceleration.lowest], [acceleration.highest]
    given.max_jerk = [jerk.highest]

    def run() -> float:
        trajectory = Trajectory(1)
        if Ruckig(1).calculate(given, trajectory) not in (Result.Working, Result.Finished):
            raise RuntimeError("the peer found no move")
        return float(trajectory.duration)

    return run
