"""Reading the result of several axes without trust: a case and a twin an axis, and what they share."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from trajopt.checker.arm import Limbs
from trajopt.checker.case import Case
from trajopt.checker.float_twin import FloatTwin
from trajopt.checker.joint_twin import JointTwin
from trajopt.checker.reading import FORMAT as OF_A_MOVE
from trajopt.checker.reading import read
from trajopt.checker.tip import path_of
from trajopt.checker.values import Malformed, all_finite, is_solved, mapping, nonnegative, number, vector

FORMAT: Final = "trajopt axes 1"
_NUMBERS: Final = ("objective", "duration", "metrics", "axes")
_KNOWN: Final = ("move", "axes", "arm", "tip", "objective", "transcription", "search", "title", "source", "moral")
_DEFAULTS: Final = ("coulomb", "switching", "eddy", "hysteresis", "hysteresis_exponent", "recovery")


@dataclass(frozen=True)
class Moved:
    """A motion as it was read: a case an axis, of kinematics alone and in full, and the twin of the full one."""

    problem: Mapping[str, Any]
    names: tuple[str, ...]
    cases: tuple[Case, ...]
    twins: tuple[FloatTwin, ...]
    limbs: Limbs | None
    armed: bool
    objective: float
    duration: float
    release: float | None


def read_moved(result: Mapping[str, Any], notes: list[str]) -> Moved | None:
    """The motion, None when its status is one without a solution. Raises Malformed."""
    if not is_solved(result, ("trajopt", "status", "problem_hash", "problem", *_NUMBERS), _NUMBERS):
        return None
    problem = mapping(result["problem"], "problem", _KNOWN)
    all_finite(problem, "problem")
    axes, found = problem.get("axes"), result["axes"]
    if not isinstance(axes, list | tuple) or not isinstance(found, list | tuple) or len(axes) != len(found):
        raise Malformed("axes: as many trajectories as axes are needed")
    arm = problem.get("arm")
    known = isinstance(arm, Mapping) and arm.get("kind") in ("scara", "planar")
    limbs = Limbs.read(arm) if known and isinstance(arm, Mapping) else None
    if limbs is not None and len(limbs.lengths) != len(axes):
        raise Malformed("arm has another number of links than there are axes")
    names = tuple(str(mapping(axis, "an axis").get("name")) for axis in axes)
    cases = tuple(_case(result, k, arm is not None, notes) for k in range(len(axes)))
    return Moved(
        problem, names, cases, _twins(cases, limbs, found, arm is not None), limbs, arm is not None,
        number(result["objective"], "objective"), number(result["duration"], "duration"),
        None if result.get("release") is None else number(result["release"], "release"),
    )  # fmt: skip


def _twins(cases: Sequence[Case], limbs: Limbs | None, found: Sequence[Any], armed: bool) -> tuple[FloatTwin, ...]:
    if not armed:
        return tuple(FloatTwin(case) for case in cases)
    if any(len(case.time) != len(cases[0].time) or np.any(case.time != cases[0].time) for case in cases):
        raise Malformed("the joints of an arm need one time grid")
    twins = []
    for k, case in enumerate(cases):
        given = None if limbs is not None else vector(found[k].get("torque"), "axes.torque")
        if given is not None and len(given) != len(case.time):
            raise Malformed("axes.torque needs a value a node")
        twins.append(JointTwin(case, k, limbs, given))
    for twin in twins:
        twin.all = tuple(twins)
    return tuple(twins)


def _case(result: Mapping[str, Any], k: int, armed: bool, notes: list[str]) -> Case:
    """An axis as a move of its own. On an arm its inertia is a placeholder that `JointTwin` never looks at."""
    problem = result["problem"]
    axis, move = mapping(problem["axes"][k], "an axis"), mapping(problem.get("move"), "problem.move")
    own, trajectory = mapping(axis.get("move"), "an axis.move"), mapping(result["axes"][k], "axes").get("trajectory")
    terms = [{"minimize": name, "norm": norm, "weight": 1.0} for name, norm, _, _ in terms_of(problem)]
    load = dict(mapping(axis.get("load", {}), "load"))
    if armed and load.keys() - {"inertia", "viscous", *_DEFAULTS}:
        raise Malformed("the load of a joint is the arm")
    if armed:
        load = {"inertia": 1.0, "viscous": load.get("viscous", 0.0)}
    path = isinstance(problem.get("tip"), Mapping) and path_of(problem["tip"]) is not None
    start, end = ({**own.get(key, {}), **({"position": "free"} if path else {})} for key in ("start", "end"))
    time, ended = move.get("time"), vector(mapping(trajectory, "trajectory").get("time"), "trajectory.time")
    name = f"{axis.get('name')}."
    metrics = mapping(result["metrics"], "metrics")
    case = read(
        {
            **result, "format": OF_A_MOVE, "objective": 0.0, "certificate": None, "trajectory": trajectory,
            "duration": result["duration"] if move.get("shared", True) else float(ended[-1]),
            "metrics": {key.removeprefix(name): x for key, x in metrics.items() if key.startswith(name)},
            "problem": {
                "move": {"time": time, "start": start, "end": end, "via": own.get("via", ()),
                         "dwell": move.get("dwell", 0.0)},
                "limits": axis.get("limits", {}), "load": load, "objective": {"terms": terms},
                "transcription": problem.get("transcription"), "rotary": axis.get("rotary", False),
            },
        },
        notes,
    )  # fmt: skip
    assert case is not None
    return case


def terms_of(problem: Mapping[str, Any]) -> Iterator[tuple[str, str | None, tuple[float, ...], str]]:
    """(quantity, norm, weight an axis, sum or max) of every term; the time has one weight."""
    count = len(problem["axes"])
    for term in mapping(problem.get("objective"), "objective").get("terms", ()):
        term = mapping(term, "an objective term", ("minimize", "norm", "weight", "axes", "combine"))
        weight, shares = nonnegative(term.get("weight", 1.0), "weight"), term.get("axes")
        own = np.ones(count) if shares is None else vector(shares, "objective.axes")
        if len(own) != count or np.any(own < 0) or term.get("combine", "sum") not in ("sum", "max"):
            raise Malformed("an objective term needs a weight an axis, and combine sum or max")
        if term.get("minimize") == "time":
            own = np.ones(1)
        yield str(term.get("minimize")), term.get("norm"), tuple(weight * own), term.get("combine", "sum")
