"""Solving in a process of its own, so that time limits, interrupts and crashes of native code can be dealt with.

Native solvers hold the interpreter: neither a signal handler nor a thread gets through to them. A process can be ended.
"""

from __future__ import annotations

import multiprocessing
import signal
from multiprocessing.connection import Connection
from typing import Any

from trajopt.problem import Problem
from trajopt.routing import route
from trajopt.solution import Solution
from trajopt.verdict import Verdict

GRACE = 0.5  # s beyond the limit that a solver gets to stop by itself


def solve_apart(problem: Problem, seconds: float | None = None) -> Solution:
    """`trajopt.solve` in a child process, which is ended at the limit (LIMIT) and on Ctrl-C; its death is CRASHED.

    Raises what `trajopt.solve` raises, and KeyboardInterrupt.
    """
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=_work, args=(sender, problem, seconds), daemon=True)
    child.start()
    sender.close()
    try:
        if receiver.poll(None if seconds is None else seconds + GRACE):
            answer = receiver.recv()
            child.join()
        else:
            return _ended(problem, Verdict.LIMIT, f"stopped after {seconds:g} s")
    except EOFError:
        child.join()
        return _ended(problem, Verdict.CRASHED, f"the solver process ended with code {child.exitcode}")
    finally:
        child.kill()
    if isinstance(answer, BaseException):
        raise answer
    assert isinstance(answer, Solution)
    return answer


def _work(sender: Connection, problem: Problem, seconds: float | None) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    answer: Any
    try:
        from trajopt.solving import solve

        answer = solve(problem, seconds)
    except Exception as error:
        error.add_note(_trace())
        answer = error
    sender.send(answer)


def _trace() -> str:
    import traceback

    return traceback.format_exc()


def _ended(problem: Problem, verdict: Verdict, message: str) -> Solution:
    return Solution(verdict, problem, route(problem), message=message)
