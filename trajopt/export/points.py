"""The points that a file holds: samples of the exact interpolant at nodes, at a bus cycle, or on a clock's ticks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from trajopt.errors import BadInput
from trajopt.mesh import Floats
from trajopt.problem import DERIVATIVES

if TYPE_CHECKING:
    from trajopt.export.formats import Format
    from trajopt.solution import Solution
    from trajopt.trajectory import Trajectory

MOST: Final = 1_000_000  # points of a file
_SAME: Final = 1e-9  # s, and relative: times closer than this are one
_SHORTEST: Final = 1e-3  # of a cycle, that the last one may be
_ON_A_TICK: Final = 1e-6  # of a tick
_AT_REST: Final = 1e-9  # of the peak velocity


@dataclass(frozen=True)
class Header:
    """What a reader must know and the numbers of a file do not say: the ``name`` of the axis, ``rotary``, the ``order``
    of the move, its ``origin`` (m or rad), the ``cycle`` (s) and the size of a ``count`` (m or rad), None where there
    are none, and the hash of the problem."""

    name: str
    rotary: bool
    order: int
    origin: float
    cycle: float | None
    count: float | None
    hash: str = ""


@dataclass(frozen=True)
class Points:
    """(n,) times (s, from 0) and (n,) values of position, velocity, … at them (SI), lowest derivative first."""

    time: Floats
    values: tuple[Floats, ...]

    @property
    def position(self) -> Floats:
        """(n,) m or rad."""
        return self.values[0]


def sample(solution: Solution, form: Format, kind: str, cycle: float | None) -> Points:
    """The points of a move for a format that is interpolated as ``kind``: every ``cycle`` (s), or at its nodes, rounded
    to the format's clock and taken there.

    Of the nodes those between equal polynomials are left out where the interpolation reproduces them: what remains of a
    minimum time are its switching times. A file of set-points goes on to the first cycle at or after the end, where the
    move holds its end state.

    Raises BadInput for a cycle that the move or the format cannot have.
    """
    trajectory = solution.trajectory
    assert trajectory is not None
    duration = trajectory.duration
    _refuse_cycle(solution, form, cycle)
    time = nodes(trajectory, kind) if cycle is None else _every(cycle, duration, form.equidistant)
    if form.tick is not None:
        ticks = np.unique(np.round(time / form.tick))
        ticks[-1] = np.ceil(duration / form.tick - _ON_A_TICK)
        time = np.unique(ticks) * form.tick
    if time[-1] - duration > max(_SAME * duration, _SAME):
        _refuse_moving_end(solution, form, time[-1])
    within = np.minimum(time, duration)
    within[-1] = duration
    values = trajectory.at(within)
    points = Points(time, tuple(values[name] for name in DERIVATIVES[: trajectory.order + 1]))
    if len(time) > form.most:
        raise BadInput(f"cycle: {form.name} holds {form.most} points at most, these are {len(time)}; give a longer one")
    return _at_rest(points, form) if form.at_rest else points


def nodes(trajectory: Trajectory, kind: str) -> Floats:
    """Times of the nodes, s: where the top derivative changes, or all where straight lines or splines join them."""
    degree = {"cubic": 3, "quintic": 5}.get(kind, 0)
    time, top = trajectory.time, trajectory.chain[-1]
    if degree < trajectory.order:
        return time
    changes = np.abs(np.diff(top)) > _SAME * float(np.max(np.abs(top)))
    kept: Floats = time[np.concatenate([[True], changes, [True]])]
    return kept


def shortest_arc(solution: Solution) -> float:
    """The shortest arc of a move by switching times, s; its duration where it has no arcs."""
    arcs = [arc["to"] - arc["from"] for arc in solution.structure.get("arcs", ())]
    assert solution.duration is not None
    return min(arcs, default=solution.duration)


def _every(cycle: float, duration: float, equidistant: bool) -> Floats:
    count = int(np.ceil(duration / cycle * (1 - _SAME)))
    time: Floats = cycle * np.arange(count + 1, dtype=float)
    if not equidistant:
        time[-1] = duration
        if count > 1 and time[-1] - time[-2] < _SHORTEST * cycle:  # a polynomial over so little would be rounding
            time = np.delete(time, -2)
    return time


def _refuse_cycle(solution: Solution, form: Format, cycle: float | None) -> None:
    assert solution.duration is not None
    if cycle is None:
        if form.equidistant:
            raise BadInput(f'cycle: is missing; {form.name} has a point every bus cycle, write for example "1 ms"')
        return
    if not (np.isfinite(cycle) and cycle > 0):
        raise BadInput(f'cycle: must be > 0, got {cycle:g} s; write for example "1 ms"')
    longest = shortest_arc(solution)
    if cycle > longest * (1 + _SAME):
        whole = longest == solution.duration
        remedy = "" if form.equidistant or whole else ", or leave it out: the points are then the switching times"
        what = "move" if whole else "shortest arc"
        raise BadInput(f"cycle: {cycle:g} s is longer than the {what}, {longest:.9g} s; give at most that{remedy}")
    if solution.duration / cycle > MOST:
        raise BadInput(f"cycle: {cycle:g} s makes more than {MOST} points of a move of {solution.duration:g} s; "
                       f"give at least {solution.duration / MOST:g} s")  # fmt: skip


def _refuse_moving_end(solution: Solution, form: Format, end: float) -> None:
    """Whoever does not rest at the end cannot wait there for the next tick."""
    assert solution.duration is not None and solution.trajectory is not None
    chain = solution.trajectory.chain
    if abs(chain[1][-1]) > _AT_REST * float(np.max(np.abs(chain[1]))):
        raise BadInput(f"cycle: the move ends in motion after {solution.duration:.9g} s, which is not on the clock of "
                       f"{form.name} (next: {end:.9g} s); choose a cycle that divides it, or --to csv")  # fmt: skip


def _at_rest(points: Points, form: Format) -> Points:
    """The points with velocities of exactly zero at both ends, for a format that can only start and stop at rest.

    Raises BadInput where the move does not.
    """
    velocity = points.values[1].copy()
    for index, end in ((0, "begins"), (-1, "ends")):
        if abs(velocity[index]) > _AT_REST * float(np.max(np.abs(velocity))):
            raise BadInput(f"to: {form.name} starts and stops at rest, the move {end} at {velocity[index]:g} (SI); "
                           "export it to csv, ros or mat")  # fmt: skip
    velocity[[0, -1]] = 0.0
    return replace(points, values=(points.position, velocity, *points.values[2:]))
