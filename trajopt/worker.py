"""Solving in a process of its own, so that time limits, interrupts and crashes of native code can be dealt with.

Native solvers hold the interpreter: neither a signal handler nor a thread gets through to them. A process can be ended.
"""

from __future__ import annotations

import multiprocessing
import signal
import threading
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any, overload

from trajopt.errors import BadInput
from trajopt.problem import Problem
from trajopt.solution import Solution
from trajopt.verdict import Verdict

if TYPE_CHECKING:
    from trajopt.axes.problem import AxesProblem
    from trajopt.axes.solution import AxesSolution
    from trajopt.plant.problem import PlantProblem
    from trajopt.plant.solution import PlantSolution

GRACE = 0.5  # s beyond the limit that a solver gets to stop by itself


@overload
def solve(problem: Problem, seconds: float | None = None) -> Solution: ...
@overload
def solve(problem: PlantProblem, seconds: float | None = None) -> PlantSolution: ...
@overload
def solve(problem: AxesProblem, seconds: float | None = None) -> AxesSolution: ...
def solve(
    problem: Problem | PlantProblem | AxesProblem, seconds: float | None = None
) -> Solution | PlantSolution | AxesSolution:
    """Solve, check and certify; ``seconds`` limits the wall time, by solving in a process that can be ended.

    Returns a solution in every case; look at ``status``. Raises BadInput for a limit that is no positive time and when
    the solver asked for cannot take the problem, or no command can do what is asked of a plant; MissingSolver when the
    solver is not installed, InternalError when a bound exceeds a checked answer.
    """
    if seconds is None:
        return solve_here(problem, None)
    if not 0 < seconds < float("inf"):
        raise BadInput(f"seconds: must be > 0 and finite, got {seconds!r}; leave it out for no limit")
    if multiprocessing.current_process().daemon:  # which may have no child of its own
        return solve_here(problem, seconds)
    return solve_apart(problem, seconds)


@overload
def solve_apart(problem: Problem, seconds: float | None = None) -> Solution: ...
@overload
def solve_apart(problem: PlantProblem, seconds: float | None = None) -> PlantSolution: ...
@overload
def solve_apart(problem: AxesProblem, seconds: float | None = None) -> AxesSolution: ...
def solve_apart(
    problem: Problem | PlantProblem | AxesProblem, seconds: float | None = None
) -> Solution | PlantSolution | AxesSolution:
    """`solve` in a child process, with a limit or without."""
    import trajopt.solving  # noqa: F401 (once here, and not in every child)

    with Apart() as child:
        return child.solve(problem, seconds)


class Apart:
    """A child process that solves one problem; it loads what that takes while its parent still reads the problem.
    It is ended at the limit (LIMIT), on Ctrl-C and with the block that it is used in; its own death is CRASHED."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("fork")
        self._pipe, there = context.Pipe()
        self._child = context.Process(target=_work, args=(there, self._pipe), daemon=True)
        self._child.start()
        there.close()
        self._before = _end_with_us()

    def solve(
        self, problem: Problem | PlantProblem | AxesProblem, seconds: float | None = None
    ) -> Solution | PlantSolution | AxesSolution:
        """`trajopt.solve`, once. Raises what that raises, and KeyboardInterrupt."""
        try:
            self._pipe.recv()  # it is ready: what it loads does not count
            self._pipe.send((problem, seconds))
            if not self._pipe.poll(None if seconds is None else seconds + GRACE):
                return _ended(problem, Verdict.LIMIT, f"stopped after {seconds:g} s")
            answer = self._pipe.recv()
        except (EOFError, ConnectionError):
            self._child.join()
            return _ended(problem, Verdict.CRASHED, f"the solver process ended with code {self._child.exitcode}")
        if isinstance(answer, BaseException):
            raise answer
        found: Solution | PlantSolution | AxesSolution = answer
        return found

    def __enter__(self) -> Apart:
        return self

    def __exit__(self, *_: Any) -> None:
        self._child.kill()
        self._child.join()
        self._pipe.close()
        if self._before is not None:
            signal.signal(signal.SIGTERM, self._before)


def solve_here(
    problem: Problem | PlantProblem | AxesProblem, seconds: float | None
) -> Solution | PlantSolution | AxesSolution:
    """`solve` in this process, where the limit is kept between and within solver runs only."""
    if isinstance(problem, Problem):
        from trajopt.solving import solve

        return solve(problem, seconds)
    from trajopt.axes.problem import AxesProblem

    if isinstance(problem, AxesProblem):
        from trajopt.axes.solving import solve as solve_axes

        return solve_axes(problem, seconds)
    from trajopt.plant.solving import solve as solve_plant

    return solve_plant(problem, seconds)


def _end_with_us() -> Any:
    """Have SIGTERM unwind us, so that the child is ended, too; returns the handler to restore, None off main."""
    if threading.current_thread() is not threading.main_thread():
        return None

    def unwind(*_: Any) -> None:
        raise SystemExit(128 + signal.SIGTERM)

    return signal.signal(signal.SIGTERM, unwind)


def _work(pipe: Connection, end_of_parent: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    end_of_parent.close()  # so that the parent's death is heard
    import trajopt.solving  # noqa: F401

    pipe.send("ready")
    try:
        problem, seconds = pipe.recv()
    except EOFError:
        return
    answer: Any
    try:
        answer = solve_here(problem, seconds)
    except Exception as error:
        error.add_note(_trace())
        answer = error
    pipe.send(answer)


def _trace() -> str:
    import traceback

    return traceback.format_exc()


def _ended(
    problem: Problem | PlantProblem | AxesProblem, verdict: Verdict, message: str
) -> Solution | PlantSolution | AxesSolution:
    from trajopt.routing import route

    if isinstance(problem, Problem):
        return Solution(verdict, problem, route(problem), message=message)
    from trajopt.axes.problem import AxesProblem

    if isinstance(problem, AxesProblem):
        from trajopt.axes.solution import AxesSolution

        return AxesSolution(verdict, problem, route(problem), message=message)
    from trajopt.plant.solution import PlantSolution

    return PlantSolution(verdict, problem, route(problem), message=message)
