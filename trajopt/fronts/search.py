"""Where to solve next: anchors first, then wherever the front is known least, until it is known well enough."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil
from time import perf_counter
from typing import Any, Final

import numpy as np

from trajopt.fronts import geometry
from trajopt.fronts.blends import blends
from trajopt.fronts.front import Front, Point, outside, ranges
from trajopt.fronts.geometry import Gap, Outside
from trajopt.fronts.scalarise import Answer, Task, answer, is_convex
from trajopt.mesh import Floats
from trajopt.problem import Problem, Term
from trajopt.trajectory import Trajectory
from trajopt.verdict import Verdict
from trajopt.workers import Here, Processes

MOST: Final = 200  # solves
_SAME: Final = 1e-6  # weights, normalised, and points this close are one
_LEAST: Final = 1e-3  # weight, of the largest: with none at all the others could be anything
_BLENDS: Final = 256  # at least, along the range of an objective

Progress = Callable[[int, "float | None"], None]


@dataclass(frozen=True)
class Request:
    """``method``: weights or epsilon; ``points`` evenly placed, or else as many as ``error`` takes."""

    method: str = "weights"
    points: int | None = None
    error: float | None = None


class Search:
    """A front in the making. `front` can be asked for at any time, also after an interrupt."""

    def __init__(
        self, problem: Problem, terms: tuple[Term, ...], request: Request, hands: Here | Processes, progress: Progress
    ) -> None:
        self.problem, self.terms, self.request = problem, terms, request
        self.answers: list[Answer] = []
        self.convex = is_convex(problem)
        self._hands, self._progress = hands, progress
        self._per_range = _BLENDS if request.error is None else float(np.clip(2.5 / request.error, _BLENDS, 8192))
        self._blended: dict[tuple[int, int], Floats] = {}
        self._asked: list[Floats] = []
        self._started = perf_counter()

    def run(self) -> Front:
        """Solve until the front is as it was asked for, or nothing more can be learnt."""
        size, request = len(self.terms), self.request
        self._solve([Task(self.problem, self.terms, "anchor", minimized=k) for k in range(size)])
        if request.points is not None and size == 2:
            for shares in halvings(request.points - 2):
                self._solve(self._evenly(shares))
        while tasks := self._next():
            self._solve(tasks)
        return self.front()

    def _solve(self, tasks: Sequence[Task]) -> None:
        found: dict[int, Answer] = {}
        try:
            for k, done in self._hands.run(answer, tasks):
                found[k] = done
                self._progress(len(self.answers) + len(found), None)
        finally:  # in the order of the tasks, whoever was first
            self.answers += [found[k] for k in sorted(found)]

    def _evenly(self, shares: Sequence[float]) -> list[Task]:
        """The tasks at these fractions of the way between the anchors."""
        if self.request.method == "weights":
            return [self._task("weights", weights=(w, 1 - w)) for w in shares]
        ends = [x.values[0] for x in self.answers if x.values is not None and x.task.kind == "anchor"]
        if len(ends) < 2:
            return []
        return [self._ceiling(min(ends) + s * (max(ends) - min(ends))) for s in shares]

    def _task(self, kind: str, weights: tuple[float, ...] = (), ceilings: tuple[float | None, ...] = ()) -> Task:
        minimized = ceilings.index(None) if ceilings else 0
        return Task(self.problem, self.terms, kind, weights, minimized, ceilings, self._nearest(weights, ceilings))

    def _nearest(self, weights: tuple[float, ...], ceilings: tuple[float | None, ...]) -> Trajectory | None:
        """The move of the answer whose weights, or whose values under the ceilings, are most like these."""

        def apart(found: Answer) -> float:
            assert found.values is not None and found.weights is not None
            pairs: Any = zip(weights, np.array(found.weights) / sum(found.weights), strict=True)
            if ceilings:
                pairs = ((most, value) for most, value in zip(ceilings, found.values, strict=True) if most is not None)
            return float(max(abs(asked - there) for asked, there in pairs))

        known = [x for x in self.answers if x.values is not None and x.weights is not None]
        return min(known, key=apart).solution.trajectory if known else None

    def _ceiling(self, most: float) -> Task:
        return self._task("epsilon", ceilings=(most, None))

    def _next(self) -> list[Task]:
        """What to solve into every gap that is too wide."""
        target, points = self.request.error or 0.0, self.request.points
        if (points is not None and (len(self.terms) == 2 or len(self.answers) >= points)) or len(self.answers) >= MOST:
            return []
        gaps = self.gaps()
        self._progress(len(self.answers), _widest(gaps))
        wide = [gap for gap in gaps if gap.error > max(target, 1e-9) and np.isfinite(gap.error)]
        tasks = [task for gap in wide if (task := self._into(gap)) is not None]
        return tasks[: (points or MOST) - len(self.answers)]

    def _into(self, gap: Gap) -> Task | None:
        """The task that looks into a gap; None where it has been looked at."""
        if self.request.method == "weights":
            weights = np.maximum(gap.weights, _LEAST * float(np.max(gap.weights)))
            weights = weights / float(np.sum(weights))
            if not self._known(weights):
                si = weights / ranges(*self._ends)
                return self._task("weights", weights=tuple(float(w) for w in si / np.sum(si)))
        if self.convex or gap.between is None:
            return None
        points = self._points()
        left, right = (points[k].values for k in gap.between)
        middle, size = (left[0] + right[0]) / 2, ranges(*self._ends)[0]
        if right[0] - left[0] < 1e-4 * size or self._known(np.array([middle / size])):
            return None
        return self._ceiling(middle)

    def _known(self, asked: Floats) -> bool:
        if any(len(x) == len(asked) and np.max(np.abs(x - asked)) <= _SAME for x in self._asked):
            return True
        self._asked.append(asked)
        return False

    @property
    def _ends(self) -> tuple[Floats, Floats]:
        """The best and the worst values of the anchors."""
        anchors = [x.values for x in self.answers if x.values is not None and x.task.kind == "anchor"]
        found = np.array(anchors or [x.values for x in self.answers if x.values is not None])
        return found.min(axis=0), found.max(axis=0)

    def _points(self) -> list[Point]:
        """The points that no other dominates, in order of the first objective."""
        return [point for point, kept in self._sorted() if kept]

    def _sorted(self) -> list[tuple[Point, bool]]:
        found = [
            Point(x.solution, x.values, x.task.kind, x.weights, x.task.ceilings or None)
            for x in self.answers if x.values is not None
        ]  # fmt: skip
        if not found:
            return []
        from moocore import is_nondominated

        ideal, nadir = self._ends
        rounded = np.round((np.array([p.values for p in found]) - ideal) / ranges(ideal, nadir) / _SAME)
        kept: list[bool] = is_nondominated(rounded, keep_weakly=self.request.points is not None).tolist()
        return sorted(zip(found, kept, strict=True), key=lambda pair: pair[0].values)

    def _outside(self) -> Outside:
        planes = [plane for x in self.answers for plane in x.planes]
        return outside(planes, [corner for x in self.answers for corner in x.corners], *self._ends)

    def gaps(self) -> list[Gap]:
        """Where the front is known least, the widest gap first; none while an anchor or its bound is missing."""
        anchors = [x for x in self.answers if x.task.kind == "anchor"]
        if len(anchors) < len(self.terms) or not all(x.values is not None and x.planes for x in anchors):
            return []
        points, beyond = self._points(), self._outside()
        ideal, nadir = self._ends
        y = (np.array([point.values for point in points]) - ideal) / ranges(ideal, nadir)
        if self.convex:
            return geometry.hull_gaps(y, beyond)
        if len(self.terms) > 2:
            return geometry.point_gaps(y, beyond)
        between = [(self._between(p, q) - ideal) / ranges(ideal, nadir) for p, q in pairwise(points)]
        return geometry.staircase_gaps(y, between, beyond)

    def _between(self, first: Point, second: Point) -> Floats:
        key = id(first.solution), id(second.solution)
        if key not in self._blended:
            moves = first.solution.trajectory, second.solution.trajectory
            assert moves[0] is not None and moves[1] is not None
            self._blended[key] = blends(moves[0], moves[1], self.terms, self._count(first, second))
        return self._blended[key]

    def _count(self, first: Point, second: Point) -> int:
        """How many moves to blend of two neighbours: the more, the farther they lie apart."""
        apart = np.abs(np.subtract(second.values, first.values)) / ranges(*self._ends)
        return ceil(self._per_range * float(np.max(apart)))

    def _counts(self) -> tuple[int, ...]:
        """Of each two neighbours; none where blends play no part."""
        if self.convex or len(self.terms) > 2 or not self._per_range:
            return ()
        return tuple(self._count(p, q) for p, q in pairwise(self._points()))

    def error(self) -> float | None:
        """How well the front is known; None where no bound is."""
        return _widest(self.gaps())

    def front(self, interrupted: bool = False) -> Front:
        """What is known by now."""
        found = self._sorted()
        unsolved = tuple(x.solution for x in self.answers if x.values is None)
        error = self.error()
        status, message = self._verdict(error, len(unsolved))
        if interrupted:
            status, message = Verdict.INTERRUPTED, f"stopped by the user after {len(self.answers)} solves"
        ideal, nadir = (tuple(x.tolist()) for x in self._ends) if found else ((), ())
        return Front(
            self.problem, self.terms, status, message,
            tuple(point for point, kept in found if kept), tuple(point for point, kept in found if not kept), unsolved,
            tuple(plane for x in self.answers for plane in x.planes),
            tuple(corner for x in self.answers for corner in x.corners),
            self.convex, self._counts(),
            error, self.request.error, ideal, nadir, len(self.answers), {"total": perf_counter() - self._started},
        )  # fmt: skip

    def _verdict(self, error: float | None, unsolved: int) -> tuple[Verdict, str]:
        asked = self.request.error
        if unsolved:
            first = next(x.solution for x in self.answers if x.values is None)
            return Verdict.UNDECIDED, f"{unsolved} of {len(self.answers)} points not solved: {first.message}"
        if asked is None or (error is not None and error <= asked):
            known = "no bound is known" if error is None else f"known within {100 * error:.2g} %"
            return Verdict.SOLVED, known
        if error is None:
            return Verdict.UNDECIDED, "no lower bound is known for these objectives: the error cannot be certified"
        text = f"known within {100 * error:.2g} %, not the {100 * asked:.2g} % asked for"
        return Verdict.UNDECIDED, f"{text}: closer, the lower bounds are too loose, or {MOST} solves too few"


def _widest(gaps: Sequence[Gap]) -> float | None:
    return max(gaps[0].error, 0.0) if gaps and np.isfinite(gaps[0].error) else None


def halvings(count: int) -> Iterator[list[float]]:
    """``count`` fractions evenly inside (0, 1), in rounds that halve what is left between those before."""
    ends, size = [0, count + 1], count + 1
    while middles := [(a + b) // 2 for a, b in pairwise(ends) if b - a > 1]:
        yield [k / size for k in middles]
        ends = sorted([*ends, *middles])
