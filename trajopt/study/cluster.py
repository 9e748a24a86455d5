"""The same cases on a Dask cluster: our function by its name, JSON there and back, a bounded window of cases under way.

A worker that dies is the scheduler's affair: it has the case solved elsewhere, and after some such deaths gives it up.
"""

from __future__ import annotations

import errno
import importlib
import ipaddress
import json
import signal
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError
from typing import Any, Final
from urllib.parse import urlsplit

from trajopt.errors import BadInput, MissingSolver
from trajopt.study.answer import unsolved
from trajopt.study.pool import DEFAULT, SOLVE, Done, Limits, Task
from trajopt.verdict import Verdict
from trajopt.worker import GRACE

AHEAD: Final = 3  # cases under way for each worker
_PATIENCE: Final = 10.0  # s to reach the scheduler


class Cluster:
    """The workers of a Dask scheduler at ``address``, each with one thread.

    Raises BadInput for an address that is not loopback without TLS, one that does not answer, and for workers with
    several threads; MissingSolver where Dask is not installed.
    """

    def __init__(self, address: str, limits: Limits = DEFAULT, function: str = SOLVE) -> None:
        self._limits, self._function = limits, function
        self._address = address
        self._distributed = _imported()
        self._client = self._connected(refuse_open(address))
        try:
            self._refuse_threads()
        except BaseException:
            self.close()
            raise

    def answers(self, tasks: Iterator[Task]) -> Iterator[list[Done]]:
        """The answers as they come; see `trajopt.study.pool.Pool.answers`."""
        flying: dict[Any, Task] = {}
        coming = self._distributed.as_completed(loop=self._client.loop)
        while True:
            while len(flying) < AHEAD * max(self._size(), 1) and (task := next(tasks, None)) is not None:
                future = self._client.submit(work, self._function, self._limits.seconds, task.question, pure=False)
                flying[future] = task
                coming.add(future)
            if not flying:
                return
            ready = [next(coming), *coming.next_batch(block=False)]
            yield [self._done(flying.pop(future).key, future) for future in ready]

    def close(self) -> None:
        """Let go of what is under way."""
        self._client.close()

    def _size(self) -> int:
        return len(self._client.scheduler_info(n_workers=-1)["workers"])

    def _refuse_threads(self) -> None:
        try:
            self._client.wait_for_workers(1, timeout=_PATIENCE)
        except TimeoutError:
            how = f"start some: dask worker {self._address} --nthreads 1 --nworkers 2"
            raise BadInput(f"--scheduler {self._address}: it has no workers; {how}") from None
        workers = self._client.scheduler_info(n_workers=-1)["workers"]
        if any(worker["nthreads"] != 1 for worker in workers.values()):
            text = "its workers have several threads, which solvers do not bear; start them with --nthreads 1"
            raise BadInput(f"--scheduler {self._address}: {text}, and --nworkers instead")

    def _connected(self, address: str) -> Any:
        try:
            encrypted = address.startswith("tls")
            security = self._distributed.Security(require_encryption=True) if encrypted else None
            return self._distributed.Client(address, security=security, timeout=_PATIENCE, set_as_default=False)
        except (OSError, ValueError, TypeError, RuntimeError) as error:
            why = " ".join(str(error).split())
            raise BadInput(f"--scheduler {self._address}: cannot be reached: {why}; is it running?") from None

    def _done(self, key: str, future: Any) -> Done:
        """The answer of a case, or what became of it. Raises OSError when the scheduler is gone, BadInput for workers
        without our code."""
        try:
            seconds, answer = future.result()
        except self._distributed.KilledWorker:
            text = "its workers died, one after the other"
        except MemoryError:
            text = "more memory wanted than a worker has"
        except CancelledError:
            gone = "the scheduler is gone; what was finished is kept, the same command resumes"
            raise OSError(errno.ECONNABORTED, gone, self._address) from None
        except Exception as error:  # a case raises nothing else: it was not begun
            how = "install the same trajopt where the workers run"
            raise BadInput(f"--scheduler {self._address}: a worker cannot begin: {error!r}; {how}") from None
        else:
            return Done(key, answer, seconds, 1)
        return Done(key, json.dumps(unsolved(Verdict.CRASHED, text)), 0.0, 1)


def work(function: str, seconds: float, question: str) -> tuple[float, str]:
    """What a worker does: wall time in s, and the answer. The system ends the worker where no limit is kept."""
    module, _, name = function.partition(":")
    solve = getattr(importlib.import_module(module), name)
    since = time.monotonic()
    signal.setitimer(signal.ITIMER_REAL, seconds + GRACE)
    try:
        answer = solve(question)
        return time.monotonic() - since, answer
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def refuse_open(address: str) -> str:
    """The address, if it is on this machine or encrypted. Raises BadInput."""
    parts = urlsplit(address if "://" in address else f"tcp://{address}")
    try:
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if parts.scheme not in ("tcp", "tls") or host is None or port is None:
        raise BadInput(f"--scheduler {address}: write an address such as tcp://127.0.0.1:8786 or tls://host:8786")
    if parts.scheme == "tcp" and not _is_loopback(host):
        how = "use tls://, with the certificates that Dask's configuration names (distributed.comm.tls)"
        raise BadInput(f"--scheduler {address}: others could read and change what goes to another machine; {how}")
    return f"{parts.scheme}://{parts.netloc}"


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _imported() -> Any:
    try:
        return importlib.import_module("distributed")
    except ImportError:
        raise MissingSolver("--scheduler: needs Dask; install trajopt[cluster]") from None
