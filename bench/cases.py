"""What is measured: frozen specs, each a rest-to-rest axis with limits on velocity, acceleration and jerk."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import trajopt

DISTANCE: Final = 0.254  # m
DURATION: Final = 1.0  # s
MASS: Final = 10.0  # kg
VELOCITY: Final = (0.0, 0.5)  # m/s
ACCELERATION: Final = 4.905  # m/s²
JERK: Final = 98.1  # m/s³

Terms = tuple[tuple[str, str, float], ...]  # (quantity, norm or nothing, weight)


@dataclass(frozen=True)
class Case:
    """One objective on that axis, over ``distance`` (m)."""

    name: str
    terms: Terms
    convex: bool = True
    distance: float = DISTANCE

    def problem(self, intervals: int, distance: float | None = None) -> trajopt.Problem:
        """As it is asked of us."""
        distance = self.distance if distance is None else distance
        terms = [trajopt.Term(minimize=q, norm=norm or None, weight=weight) for q, norm, weight in self.terms]
        return trajopt.Problem(
            move=trajopt.Move(time=DURATION, start=trajopt.State(position=0.0), end=trajopt.State(position=distance)),
            limits=trajopt.Limits(velocity=VELOCITY, acceleration=ACCELERATION, jerk=JERK),
            load=trajopt.Load(inertia=MASS),
            objective=trajopt.Objective(terms=tuple(terms)),
            transcription=trajopt.Transcription(intervals=intervals),
        )


CASES: Final = {
    case.name: case
    for case in (
        Case("velocity Linf", (("velocity", "linf", 1.0),)),
        Case("acceleration Linf", (("acceleration", "linf", 1.0),)),
        Case("jerk L1", (("jerk", "l1", 1.0),)),
        Case("jerk L2", (("jerk", "l2", 1.0),)),  # no limit acts
        Case("jerk L2, limited", (("jerk", "l2", 1.0),), distance=0.32),  # that of velocity does
        Case("energy", (("energy", "", 1.0),), convex=False),
        Case("power L2", (("power", "l2", 1.0),), convex=False),
        Case("power Linf", (("power", "linf", 1.0),), convex=False),
        Case("energy and power Linf", (("energy", "", 0.5), ("power", "linf", 0.5)), convex=False),
    )
}

SNAP: Final = {"velocity": 1.0, "acceleration": 20.0, "jerk": 1000.0, "snap": 1e5}
THIRD: Final = {"velocity": (-1.79, 1.11), "acceleration": (-1.94, 1.52), "jerk": 3.76}
MOVING: Final = {"start": {"velocity": -0.5, "acceleration": 0.8}, "end": {"velocity": 0.54, "acceleration": -0.37}}
S_CURVE: Final = {"velocity": 0.5, "acceleration": 4.905, "jerk": 98.1}


def least_time(distance: float, limits: dict[str, Any], start: Any = None, end: Any = None) -> trajopt.Problem:
    """A minimum-time move from 0 to ``distance``."""
    return trajopt.Problem(
        move=trajopt.Move(
            time="free",
            start=trajopt.State(position=0.0, **(start or {})),
            end=trajopt.State(position=distance, **(end or {})),
        ),
        limits=trajopt.Limits(**limits),
        objective=trajopt.Objective(minimize="time"),
    )


LEAST_TIMES: Final[dict[str, trajopt.Problem]] = {
    "third order, rest to rest": least_time(0.254, S_CURVE),
    "third order, moving ends": least_time(1.04, THIRD, **MOVING),
    "fourth order, short": least_time(0.01, SNAP),
    "fourth order, chattering": least_time(0.3, SNAP),
}
