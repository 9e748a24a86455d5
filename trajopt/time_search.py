"""Minimum time as a search over fixed-time convex programs: the shortest duration in which the end can be reached.

For a move that may wait at one end the farthest reachable position grows with the duration, so that a bracketing root
finder on it needs a handful of programs; bisection on feasibility would need thirty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.optimize import brentq

from trajopt.attempt import Attempt, Clock, Goal, convex
from trajopt.model import Claim, Outcome
from trajopt.objective import Lowered
from trajopt.prices import time_prices
from trajopt.problem import FREE
from trajopt.switching import Impossible, Unresolved
from trajopt.switching_times import as_chain, next_possible
from trajopt.transcribe import Setting

_RELATIVE = 1e-10  # of the duration: how close the search brackets it
_SLACK = 1e-9  # of the stroke: an end on a position limit is reached, never passed
_LEAST: Final = 1e-6  # of the longest duration in the grid of those that are scanned
_LONGEST = 1e6  # times the first estimate: beyond it the limits cannot be meant


def minimum_time(setting: Setting, clock: Clock) -> Attempt:
    """The shortest move, with a certified lower bound on its duration in the attempt's ``bound``."""
    search = _Search(setting, clock)
    try:
        shortest = search.least()
        bound = search.bound_below(shortest)
    except _Stopped as stop:
        return Attempt(stop.outcome)
    attempt, sign = search.attempt(shortest), search.binding[shortest]
    if attempt.trajectory is None:
        return Attempt(Outcome(Claim.FAILED, "the shortest duration could not be confirmed"))
    trajectory = replace(attempt.trajectory, problem=setting.problem)
    found = time_prices(_end_freed(setting, shortest), attempt, _outwards(setting, sign), shortest)
    notes = {"programs": search.programs, "prices": found}
    return replace(attempt, trajectory=trajectory, value=shortest, bound=bound, notes=notes)


def farthest(setting: Setting, duration: float, sign: float, clock: Clock) -> Attempt:
    """The move of a given duration whose end lies farthest in the direction of ``sign``; the objective is minus the
    displacement of its end, SI."""
    return convex(_end_freed(setting, duration), duration, _outwards(setting, sign), clock)


def _end_freed(setting: Setting, duration: float) -> Setting:
    problem = setting.problem
    end = problem.move.end.model_copy(update={"position": FREE})
    move = problem.move.model_copy(update={"time": duration, "end": end})
    return replace(setting, problem=problem.model_copy(update={"move": move}))


def _outwards(setting: Setting, sign: float) -> Goal:
    stroke = setting.sizes.derivative[0]
    return lambda transcript: Lowered(-sign / stroke * transcript.chain[0][-1], stroke, None)


def feasible_times(
    setting: Setting, clock: Clock, near: Sequence[float] = ()
) -> list[tuple[float, float | None]]:
    """The intervals of durations in which the move is possible, in order; the last may have no end (None).

    For ends that move, possible times need not be an up-set: past a short time in which the axis runs through, there
    may be none until it can turn back. Sought on both sides of the borders known to be ``near`` (s), else scanned on a
    geometric grid, where slivers between its points are missed. None are returned when the time limit cuts that short.
    """
    search = _Search(setting, clock)
    few = setting.problem.transcription.model_copy(update={"intervals": min(setting.mesh.intervals, 40)})
    coarse = _Search(Setting.of(setting.problem.model_copy(update={"transcription": few})), clock)
    grid = setting.sizes.duration * np.geomspace(0.1, 30.0, 72)
    if near:
        grid = np.unique([t * beside for t in near for beside in (0.98, 1.02)])
    try:
        while not near and grid[0] > _LEAST * grid[-1] and coarse.margin(float(grid[0])) >= 0:
            grid = np.concatenate([[grid[0] / 2], grid])  # until the least possible time lies within the grid
        inside = [coarse.margin(float(t)) >= 0 for t in grid]
        borders = [(a, b) for a, b, was, now in zip(grid, grid[1:], inside, inside[1:], strict=False) if was != now]
        edges = [_edge(search, float(a), float(b)) for a, b in borders]
    except _Stopped:
        return []
    ends: list[float | None] = ([float(grid[0])] if inside[0] else []) + [*edges] + ([None] if inside[-1] else [])
    return [(float(low or 0.0), high) for low, high in zip(ends[::2], ends[1::2], strict=True)]


def _edge(search: _Search, low: float, high: float) -> float:
    """The border of the possible times between two durations, moved to the possible side by a millionth."""
    if (search.margin(low) >= 0) == (search.margin(high) >= 0):
        low, high = low / 1.1, high * 1.1  # the coarse mesh saw a border that the fine one puts outside
    if (search.margin(low) >= 0) == (search.margin(high) >= 0):
        raise _Stopped(Outcome(Claim.FAILED, "a border of the possible times depends on the mesh"))
    rising = search.margin(high) >= 0
    edge = float(brentq(search.margin, low, high, xtol=1e-9 * low, rtol=1e-9))
    return edge * (1 + 1e-6 if rising else 1 - 1e-6)


class _Stopped(Exception):
    def __init__(self, outcome: Outcome) -> None:
        self.outcome = outcome


class _Search:
    """How far beyond the end the axis could go in a given time, over the stroke; negative: the end is out of reach."""

    def __init__(self, setting: Setting, clock: Clock) -> None:
        move = setting.problem.move
        self._setting, self._clock = setting, clock
        self._target = float(move.end.position) - (move.start_position or 0.0)  # type: ignore[arg-type]
        self.binding: dict[float, float] = {}  # duration -> the direction in which the reach is shorter
        self._known: dict[tuple[float, float], Attempt] = {}
        self.programs = 0
        self.forward = 1.0 if self._target >= 0 else -1.0

    def least(self) -> float:
        """The shortest duration within its range."""
        time = self._range()
        if isinstance(time, tuple):
            if self.margin(time[0]) >= 0:
                return time[0]
            if self.margin(time[1]) < 0:
                raise _Stopped(Outcome(Claim.INFEASIBLE, f"more than {time[1]:g} s are needed"))
        low, high = time if isinstance(time, tuple) else self.bracket()
        return self.feasible_near(brentq(self.margin, low, high, xtol=_RELATIVE * low, rtol=_RELATIVE, maxiter=100))

    def _range(self) -> float | str | tuple[float, float]:
        """The range of durations, narrowed to where its least possible one lies if that need not be monotone."""
        problem = self._setting.problem
        time, chain = problem.move.time, as_chain(problem)
        if not isinstance(time, tuple) or problem.can_wait or chain is None:
            return time
        try:
            if (narrow := next_possible(chain, *time)) is not None:
                return narrow
        except (Impossible, Unresolved):
            pass
        raise _Stopped(Outcome(Claim.INFEASIBLE, f"no time from {time[0]:g} s to {time[1]:g} s is possible"))

    def bracket(self) -> tuple[float, float]:
        """(too short, long enough)."""
        low = high = self._setting.sizes.duration * 0.999
        while self.margin(high) < 0:
            low, high = high, high * 1.3
            if high > _LONGEST * self._setting.sizes.duration:
                raise _Stopped(Outcome(Claim.FAILED, "no duration found in which the move is possible"))
        while low == high or self.margin(low) > 0:
            low = min(low, high) * 0.7
        return low, high

    def bound_below(self, shortest: float) -> float:
        """A certified lower bound on the duration: just below the shortest, or the start of its range."""
        time, below = self._setting.problem.move.time, shortest * (1 - 1e-8)
        if isinstance(time, tuple) and shortest == time[0]:
            return shortest
        return below if self.margin(below, certified=True) < 0 else 0.0

    def feasible_near(self, root: float) -> float:
        """The root, or the next duration above it that the programs can do."""
        for step in (0.0, 1e-10, 1e-9, 1e-8, 1e-7):
            duration = root * (1 + step)
            if self.margin(duration) >= 0:
                return duration
        raise _Stopped(Outcome(Claim.FAILED, "the shortest duration could not be confirmed"))

    def margin(self, duration: float, certified: bool = False) -> float:
        """The smaller of (farthest - target) and (target - nearest), over the stroke; ``certified``: by dual bounds."""
        forward = self._reach(duration, self.forward, certified)
        two_sided = forward >= 0 and (self._target == 0 or not self._both_rest)
        backward = self._reach(duration, -self.forward, certified) if two_sided else np.inf
        self.binding[duration] = self.forward if forward <= backward else -self.forward
        return min(forward, backward) / self._setting.sizes.derivative[0] + (0.0 if certified else _SLACK)

    @property
    def _both_rest(self) -> bool:
        order, move = self._setting.problem.order, self._setting.problem.move
        return all(s.fixed(order).get(i) == 0.0 for s in (move.start, move.end) for i in range(1, order))

    def _reach(self, duration: float, sign: float, certified: bool) -> float:
        """How much farther than the target, towards ``sign``, the end can lie; negative: the target is out of reach."""
        attempt = self._farthest(duration, sign)
        if attempt.outcome.claim is Claim.INFEASIBLE:
            return -self._setting.sizes.derivative[0]
        if attempt.outcome.claim is Claim.UNBOUNDED:
            return np.inf
        return -(attempt.bound if certified else attempt.value) - sign * self._target

    def attempt(self, duration: float) -> Attempt:
        """The program of the side that binds at a duration."""
        return self._known[duration, self.binding[duration]]

    def _farthest(self, duration: float, sign: float) -> Attempt:
        if (duration, sign) in self._known:
            return self._known[duration, sign]
        if self._clock.over:
            raise _Stopped(Outcome(Claim.LIMIT, "time limit"))
        self.programs += 1
        attempt = self._known[duration, sign] = farthest(self._setting, duration, sign, self._clock)
        sideways = attempt.outcome.claim is Claim.UNBOUNDED and sign != self.forward  # no limit on that side: no matter
        if attempt.trajectory is None and attempt.outcome.claim is not Claim.INFEASIBLE and not sideways:
            raise _Stopped(attempt.outcome)
        return attempt
