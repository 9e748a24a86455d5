"""Worker processes of our own, so that a case that crashes, hangs or eats memory harms none but itself.

An executor of the standard library breaks as a whole when a worker dies, and cannot say which case killed it. Here a
worker has one case at a time; the system ends it at the time limit (an alarm, which no native code can hold up, and
which rings when we are dead, too) and refuses it memory beyond its limit. Workers are forked from a server that has
loaded the solvers, so that a new one costs little, and replaced now and then: solvers leak.
"""

from __future__ import annotations

import errno
import importlib
import json
import multiprocessing
import os
import resource
import signal
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing import connection, forkserver
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from typing import Final, NamedTuple, cast

from trajopt.study.answer import unsolved
from trajopt.verdict import Verdict
from trajopt.worker import GRACE

SOLVE: Final = "trajopt.study.answer:solve"
TRIES: Final = 2
RECYCLE: Final = 500  # cases a worker solves
PRELOAD: Final = ["trajopt.solving", "trajopt.model_cvxpy", "trajopt.model_pyomo", "trajopt.report", "trajopt.table"]
_ONE_THREAD: Final = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_OUT_OF_MEMORY: Final = 71  # exit code of a worker
_STILLBORN: Final = 10  # workers in a row that end before they are ready: no case is to blame


class Task(NamedTuple):
    """A case to solve: its key, and what to ask (see `trajopt.study.answer`)."""

    key: str
    question: str


class Done(NamedTuple):
    """An answer, as JSON; the wall time that it took in s; and the tries."""

    key: str
    answer: str
    seconds: float
    tries: int


@dataclass(frozen=True)
class Limits:
    """What a case may use: wall time in s, and memory (address space) in bytes."""

    seconds: float = 600.0
    memory: int = 4 << 30


DEFAULT: Final = Limits()


class Pool:
    """``workers`` processes that answer tasks by ``function`` (``module:name``, text to text)."""

    def __init__(self, workers: int, limits: Limits = DEFAULT, function: str = SOLVE) -> None:
        self._limits, self._function = limits, function
        self._stillborn = 0
        _serve_forks()
        self._workers = [self._new() for _ in range(workers)]

    def answers(self, tasks: Iterator[Task]) -> Iterator[list[Done]]:
        """The answers in the order in which they come, those that come together in a list. Raises OSError when no
        worker comes up."""
        again: deque[_Try] = deque()
        while True:
            for i in range(len(self._workers)):
                self._employ(i, tasks, again)
            busy = {worker.connection: i for i, worker in enumerate(self._workers) if worker.asked is not None}
            if not busy:
                return
            ready = [busy[cast(Connection, one)] for one in connection.wait(list(busy))]
            done = [found for i in ready if (found := self._collect(i, again)) is not None]
            for i in ready:  # first give them work, then let the answers be kept
                self._employ(i, tasks, again)
            if done:
                yield done

    def close(self) -> None:
        """End the workers at once."""
        for worker in self._workers:
            worker.process.kill()
            worker.close()

    def _new(self) -> _Worker:
        return _Worker(self._function, self._limits)

    def _employ(self, i: int, tasks: Iterator[Task], again: deque[_Try]) -> None:
        """Give an idle worker something to do: first what failed once, in a process that has done nothing else."""
        if self._workers[i].asked is not None:
            return
        retry = again.popleft() if again else None
        wanted = retry or next((_Try(task) for task in tasks), None)
        if wanted is None:
            return
        if self._workers[i].served >= RECYCLE or (retry and self._workers[i].served) or not self._workers[i].alive:
            self._workers[i].close()
            self._workers[i] = self._new()
        self._workers[i].ask(wanted)

    def _collect(self, i: int, again: deque[_Try]) -> Done | None:
        """The answer of a worker, or None when it is but ready. It has died: another try, or the case's verdict."""
        worker = self._workers[i]
        tried = worker.asked
        assert tried is not None
        try:
            found = worker.answer()
        except (EOFError, ConnectionError):
            return self._buried(i, tried, again)
        self._stillborn = 0
        return found and Done(tried.task.key, found[1], found[0], tried.number)

    def _buried(self, i: int, tried: _Try, again: deque[_Try]) -> Done | None:
        """Replace a worker that has died; the verdict on its case, if there is not to be another try."""
        worker = self._workers[i]
        worker.close()
        code = worker.process.exitcode
        self._workers[i] = self._new()
        if not worker.ready:
            again.append(tried)
            self._stillborn += 1
            if self._stillborn >= _STILLBORN:
                text = f"end with code {code} before they are ready; a script needs if __name__ == '__main__'"
                raise OSError(errno.ECHILD, text, "worker processes")
            return None
        if tried.number < TRIES:
            again.append(replace(tried, number=tried.number + 1))
            return None
        return Done(tried.task.key, json.dumps(self._verdict(code)), time.monotonic() - tried.since, tried.number)

    def _verdict(self, code: int | None) -> dict[str, object]:
        if code == -signal.SIGALRM:
            return unsolved(Verdict.LIMIT, f"ended after {self._limits.seconds:g} s, in {TRIES} tries")
        if code == _OUT_OF_MEMORY:
            text = f"more than {self._limits.memory / (1 << 30):g} GiB of memory wanted"
        elif code is not None and code < 0:
            text = f"the process was ended by {signal.Signals(-code).name}"
        else:
            text = f"the process ended with code {code}"
        return unsolved(Verdict.CRASHED, f"{text}, in {TRIES} tries")


@dataclass(frozen=True)
class _Try:
    task: Task
    number: int = 1
    since: float = 0.0


class _Worker:
    """A process and the case that it has."""

    def __init__(self, function: str, limits: Limits) -> None:
        context = _context()
        self.connection, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs, function, limits), daemon=True)
        self.process.start()
        theirs.close()
        self.asked: _Try | None = None
        self.ready = False
        self.served = 0

    @property
    def alive(self) -> bool:
        return self.process.is_alive()

    def ask(self, wanted: _Try) -> None:
        self.asked = replace(wanted, since=time.monotonic())
        with suppress(ConnectionError):  # it has died: to be found out when the answer is collected
            self.connection.send_bytes(wanted.task.question.encode())

    def answer(self) -> tuple[float, str] | None:
        """Wall time in s, and JSON; None for its first words, that it is ready. Raises EOFError or ConnectionError when
        the process has died."""
        seconds, _, text = self.connection.recv_bytes().decode().partition("\n")
        if not self.ready:
            self.ready = True
            return None
        self.asked, self.served = None, self.served + 1
        return float(seconds), text

    def close(self) -> None:
        """Let it end, and wait for that."""
        self.connection.close()
        self.process.join()


def _serve(asked: Connection, function: str, limits: Limits) -> None:
    """What a worker does, until the other end of the pipe is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    signal.signal(signal.SIGALRM, signal.SIG_DFL)  # the system ends us
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    memory = limits.memory if most == resource.RLIM_INFINITY else min(limits.memory, most)
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    module, _, name = function.partition(":")
    solve = getattr(importlib.import_module(module), name)
    with suppress(ConnectionError):  # the parent has died: to be found out when it asks nothing
        asked.send_bytes(b"ready")
    while True:
        try:
            question = asked.recv_bytes().decode()
            since = time.monotonic()
            signal.setitimer(signal.ITIMER_REAL, limits.seconds + GRACE)
            answer = solve(question)
            signal.setitimer(signal.ITIMER_REAL, 0)
            asked.send_bytes(f"{time.monotonic() - since!r}\n{answer}".encode())
        except (EOFError, ConnectionError):
            return
        except MemoryError:
            os._exit(_OUT_OF_MEMORY)


def _context() -> ForkServerContext:
    return multiprocessing.get_context("forkserver")


def _serve_forks() -> None:
    """Start the server that workers are forked from: solvers loaded, one thread each, deaf to Ctrl-C from the start."""
    _context().set_forkserver_preload(PRELOAD)
    with _environment(), _deaf((signal.SIGINT,)):
        forkserver.ensure_running()


@contextmanager
def _environment() -> Iterator[None]:
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(_ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _deaf(signals: Sequence[signal.Signals]) -> Iterator[None]:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
