"""Contradictions of a problem of several axes that can be seen without solving, in one line each."""

from __future__ import annotations

from math import hypot
from typing import TYPE_CHECKING

import numpy as np

from trajopt.problem import FREE

if TYPE_CHECKING:
    from trajopt.axes.problem import AxesProblem


def refuse_contradictions(problem: AxesProblem) -> None:
    """Raise ValueError for a problem that cannot be meant as it stands."""
    if problem.arm is None and problem.tip is not None:
        raise ValueError('tip: needs an arm; write [arm] with kind = "scara"')
    if problem.arm is not None:
        _arm(problem)
        _tip(problem)
    _objective(problem)
    moves = problem.moves  # each refuses what is wrong with one axis
    if problem.release is not None:
        _speed(problem)
    if problem.coupled and len({move.order for move in moves}) > 1:
        orders = ", ".join(f"{move.title} {('acceleration', 'jerk', 'snap')[move.order - 2]}" for move in moves)
        raise ValueError(f"axes: coupled ones need one top derivative, got {orders}; limit the same derivatives")
    if not problem.move.shared and problem.coupled:
        raise ValueError("move.shared: axes that are coupled by an arm or by their objective share one time")


def _objective(problem: AxesProblem) -> None:
    for k, term in enumerate(problem.objective.terms):
        if term.axes is not None and term.minimize == "time":
            raise ValueError(f"objective.terms[{k}].axes: time is shared; give weight instead")
        if term.axes is not None and len(term.axes) != len(problem.axes):
            raise ValueError(
                f"objective.terms[{k}].axes: needs a weight an axis, {len(problem.axes)}, got {len(term.axes)}"
            )


def _arm(problem: AxesProblem) -> None:
    from trajopt.axes.problem import IN_ARMS

    joints = problem.dynamics.joints
    if joints != len(problem.axes):
        raise ValueError(f"axes: the arm has {joints} joints, got {len(problem.axes)} axes; give one a joint")
    for k, axis in enumerate(problem.axes):
        if not axis.rotary:
            raise ValueError(f"axes[{k}].rotary: joints of an arm turn; write rotary = true and angles in rad or deg")
        given = axis.load.model_dump(exclude_defaults=True)
        if wrong := next((key for key in given if key != "viscous"), None):
            raise ValueError(f"axes[{k}].load.{wrong}: the load of a joint is the arm; leave it out (viscous may stay)")
        if wrong := next((name for name in axis.limits.given if name not in IN_ARMS), None):
            raise ValueError(f"axes[{k}].limits.{wrong}: not known on an arm; one of {', '.join(IN_ARMS[:-1])}")
    for k, term in enumerate(problem.objective.terms):
        if term.minimize not in IN_ARMS:
            raise ValueError(f"objective.terms[{k}].minimize: {term.minimize} is not known on an arm; "
                             f"one of {', '.join(name for name in IN_ARMS if name != 'rms_force')}")  # fmt: skip
    if problem.transcription.solver not in ("auto", "ipopt"):
        raise ValueError(f'transcription.solver: an arm is nonconvex, {problem.transcription.solver!r} is for convex '
                         'problems; use "ipopt" or leave it out')  # fmt: skip


def _tip(problem: AxesProblem) -> None:
    tip = problem.tip
    if tip is None:
        return
    if not problem.reaches:
        raise ValueError("tip: the arm does not know where its tip is; give it methods tip and tip_velocity")
    if tip.path is not None:
        if not hasattr(problem.dynamics, "inverse"):
            raise ValueError('tip: a line or curve needs the inverse of two links; use kind = "scara"')
        _within_reach(problem)
        return
    if isinstance(tip.release, float):
        _release(problem, tip.release)
    elif tip.release == FREE and any(limit.varies for axis in problem.axes for limit in axis.limits.given.values()):
        raise ValueError("tip.release: limits by time need a fixed one such as \"0.7 s\"")
    if tip.release == FREE and any(axis.limits.rms_force or axis.move.via for axis in problem.axes):
        raise ValueError('tip.release: via states and RMS limits need a fixed one such as "0.7 s"')


def _release(problem: AxesProblem, time: float) -> None:
    duration = problem.fixed_time
    if duration is None:
        raise ValueError('tip.release: a time needs a fixed move.time, too; or write "free" or "end"')
    if time >= duration:
        raise ValueError(f'tip.release: {time:g} s must be before move.time = {duration:g} s; or write "end"')
    steps = time / duration * problem.transcription.intervals
    if problem.transcription.scheme == "euler" and abs(steps - round(steps)) > 1e-9:
        step = duration / problem.transcription.intervals
        raise ValueError(f"tip.release: {time:g} s must be a multiple of the euler step {step:g} s")


def _speed(problem: AxesProblem) -> None:
    """Refuse a tip speed that no motion can have, and one that the arm cannot have in the pose that is prescribed."""
    from trajopt.axes.explain import closed_bound

    assert problem.tip is not None and problem.tip.velocity is not None
    asked, bound = hypot(*problem.tip.velocity), closed_bound(problem)
    if asked > bound * (1 + 1e-9):
        raise ValueError(
            f"tip.velocity: {asked:g} m/s is beyond {bound:.6g} m/s, which no motion exceeds within the limits of the"
            " joints and the time; ask for less, or widen the limits or the time"
        )
    pose = [move.move.end.position for move in problem.moves]
    if problem.release != "end" or not all(isinstance(x, float) for x in pose):
        return
    q = [np.array([x]) for x in pose]
    units = np.eye(len(q))
    jacobian = np.array([[x[0] for x in problem.dynamics.tip_velocity(q, list(row[:, None]))] for row in units]).T
    wanted = np.array(problem.tip.velocity)
    missed = wanted - jacobian @ np.linalg.lstsq(jacobian, wanted, rcond=1e-9)[0]
    if hypot(*missed) > 1e-6 * max(asked, 1e-12):
        shown = ", ".join(f"{x:.6g}" for x in pose if isinstance(x, float))
        raise ValueError(
            f"tip.velocity: the arm is singular in the end pose ({shown}) rad, where no joint speeds move its tip that"
            " way; bend it, or leave the end free"
        )


def _within_reach(problem: AxesProblem) -> None:
    """The path must stay between the circles that the tip can reach; its ends are refused by the inverse."""
    assert problem.tip is not None and problem.tip.path is not None
    nearest, farthest = problem.dynamics.reach
    s = np.linspace(0.0, 1.0, 1001)
    distance = np.hypot(*np.broadcast_arrays(*problem.tip.path.point(s)))
    k = int(np.argmax(np.maximum(nearest - distance, distance - farthest)))
    if not nearest * (1 - 1e-9) <= distance[k] <= farthest * (1 + 1e-9):
        name = "line" if problem.tip.line is not None else "curve"
        raise ValueError(
            f"tip.{name}: is {distance[k]:.6g} m from the first joint at {s[k]:.3g} of its way, out of reach:"
            f" {nearest:.6g} to {farthest:.6g} m; move it inside"
        )
