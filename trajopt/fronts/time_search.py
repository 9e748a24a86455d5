"""Fronts of time against one other objective: the least time, and then the least cost at times in between.

Where a move may be stretched in time, each cost bounds those of all shorter times: from rest to rest, a stretched move
keeps its limits and costs no more, on the same mesh. A cost that rises with time is therefore a wrong answer.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from trajopt.fronts.front import Front
from trajopt.fronts.geometry import Gap
from trajopt.fronts.scalarise import Answer, Task, answer, stretches
from trajopt.fronts.search import MOST, Search
from trajopt.solution import Solution
from trajopt.verdict import Verdict

_RISE: Final = 1e-6  # relative: a cost may rise so much with the time, by rounding
_APART: Final = 1e-4  # of the range: times closer than this are one


class TimeSearch(Search):
    """A `Search` in which one of two objectives is the time; the problem's own time is the longest."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.convex, self._per_range = False, 0.0  # moves of different durations are not mixed

    def run(self) -> Front:
        longest = self.problem.move.fixed_time
        assert longest is not None
        self._solve([self._at(None)])
        least = self.answers[0].values
        if least is not None and least[self._time] < longest:
            self._solve([self._at(longest)])
            if (count := self.request.points) is not None:
                times = np.linspace(least[self._time], longest, count)[1:-1]
                self._solve([self._at(float(t)) for t in times])
            while tasks := self._next():
                self._solve(tasks)
            self._mend_rises()
        return self.front()

    @property
    def _time(self) -> int:
        return next(k for k, term in enumerate(self.terms) if term.minimize == "time")

    def _at(self, duration: float | None) -> Task:
        fixed = duration is not None and duration != self.problem.move.fixed_time
        minimized = self._time if duration is None else 1 - self._time
        return Task(self.problem, self.terms, "time" if fixed else "anchor", minimized=minimized, duration=duration)

    def _into(self, gap: Gap) -> Task | None:
        if gap.between is None:
            return None
        points = self._points()
        left, right = (points[k].values[self._time] for k in gap.between)
        span = float(np.ptp([p.values[self._time] for p in points]))
        return self._at((left + right) / 2) if abs(right - left) > _APART * span else None

    def _mend_rises(self) -> None:
        """Solve again, by another solver, what costs more than a faster move; flag it where that does not help."""
        if not stretches(self.problem, self.terms):
            return
        cost = 1 - self._time
        order = sorted(
            (k for k, x in enumerate(self.answers) if x.values is not None),
            key=lambda k: (self.answers[k].values or ())[self._time],
        )
        least = np.inf
        for k in order:
            if self._cost(k, cost) > least + _RISE * abs(least) and len(self.answers) < MOST:
                self.answers[k] = self._again(self.answers[k], least, cost)
            least = min(least, self._cost(k, cost))

    def _cost(self, k: int, cost: int) -> float:
        values = self.answers[k].values
        return np.inf if values is None else values[cost]

    def _again(self, first: Answer, least: float, cost: int) -> Answer:
        grid = self.problem.transcription.model_copy(update={"solver": "ipopt"})
        task = replace(first.task, problem=self.problem.replace(transcription=grid))
        second = next(found for _, found in self._hands.run(answer, [task]))
        if second.values is not None and second.values[cost] <= least + _RISE * abs(least):
            return replace(second, task=first.task)
        assert first.values is not None
        text = f"costs {first.values[cost]:.9g} in {first.values[self._time]:.9g} s, a faster move {least:.9g}"
        flagged = Solution(Verdict.UNDECIDED, first.solution.problem, first.solution.route, message=text)
        return Answer(first.task, flagged)
