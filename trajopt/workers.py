"""Work shared out to processes: one thread each, started by a fork server, so that no lock or thread of ours is copied.

Native solvers hold the interpreter, so that an interrupt in a process that solves waits for its end; one that waits
for processes hears it at once, and ends them.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Final, TypeVar

from trajopt.errors import TrajoptError

Job = TypeVar("Job")
Answer = TypeVar("Answer")

_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_PRELOADED: Final = ["trajopt.solving", "trajopt.model_cvxpy"]


class WorkerDied(TrajoptError):
    """A process ended before its job did."""


class Here:
    """Jobs done one after the other in this process."""

    def run(self, work: Callable[[Job], Answer], jobs: Sequence[Job]) -> Iterator[tuple[int, Answer]]:
        """(position of the job, its answer), as they are done."""
        return ((k, work(job)) for k, job in enumerate(jobs))

    def __enter__(self) -> Here:
        return self

    def __exit__(self, *_: Any) -> None:
        pass


class Processes:
    """Jobs done by ``count`` processes; ``work`` must be a function of a module, jobs and answers must pickle."""

    def __init__(self, count: int) -> None:
        for name in _THREADS:  # read when BLAS is loaded, in the server
            os.environ.setdefault(name, "1")
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(_PRELOADED)
        self._before = set(multiprocessing.active_children())
        self._pool = ProcessPoolExecutor(count, mp_context=context, initializer=_deaf)

    def run(self, work: Callable[[Job], Answer], jobs: Sequence[Job]) -> Iterator[tuple[int, Answer]]:
        """(position of the job, its answer), as they are done. Raises what a job raises, and WorkerDied."""
        try:
            futures = {self._pool.submit(work, job): k for k, job in enumerate(jobs)}
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BrokenProcessPool:
            raise WorkerDied(
                'a solving process died; a script that asks for workers starts below if __name__ == "__main__":'
            ) from None

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, kind: Any, *_: Any) -> None:
        """Close; after an error or an interrupt, end what is still at work."""
        if kind is not None:
            for child in set(multiprocessing.active_children()) - self._before:
                child.kill()
        self._pool.shutdown(wait=kind is None, cancel_futures=True)


def _deaf() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
