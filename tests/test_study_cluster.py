"""The same study on a real Dask scheduler with two worker processes, one of which is killed."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

import trajopt
from tests.study_faults import files, stills
from trajopt.study.cluster import refuse_open
from trajopt.study.run import Options, run


def _port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    address = f"tcp://127.0.0.1:{_port()}"
    words = ("scheduler", "--host", "127.0.0.1", "--port", address.rpartition(":")[2], "--no-dashboard")
    started = [_dask(*words)]
    words = ("worker", address, "--host", "127.0.0.1", "--nworkers", "2", "--nthreads", "1", "--no-dashboard")
    started.append(_dask(*words))
    yield address
    for process in reversed(started):
        process.terminate()
        process.wait(20)


def _dask(*words: str) -> subprocess.Popen[bytes]:
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([sys.executable, "-m", "dask", *words], **quiet)  # type: ignore[call-overload,no-any-return]


class Killer:
    """Kills the first worker process that has answered."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.killed = folder, 0

    def begin(self, total: int, reused: Sequence[str]) -> None:
        """Wait for the first answers."""

    def kept(self, statuses: Sequence[str]) -> None:
        pids = [int(path.name) for path in self.folder.iterdir()]
        if not self.killed and pids:
            self.killed = pids[0]
            os.kill(pids[0], signal.SIGKILL)


def signed(asked: str) -> str:
    """A slow invented answer, by a process that leaves its name where the test asks for it."""
    from tests.study_faults import invented

    (Path(os.environ["STUDY_PIDS"]) / str(os.getpid())).touch()
    time.sleep(0.02)
    return invented(asked)


def test_a_killed_worker_costs_nothing_and_the_rows_are_those_of_local_processes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    pids = tmp_path / "pids"
    pids.mkdir()
    monkeypatch.setenv("STUDY_PIDS", str(pids))
    address, killer = request.getfixturevalue("scheduler"), Killer(pids)
    signing = Options(scheduler=address, function="tests.test_study_cluster:signed")
    report = run(stills(60), tmp_path / "cluster", signing, killer)
    assert killer.killed and len(list(pids.iterdir())) >= 3 and report.counts["SOLVED"] == 54
    run(stills(60), tmp_path / "local", Options(workers=2, function="tests.study_faults:invented"))
    assert files(tmp_path / "cluster") == files(tmp_path / "local")


def test_real_answers_come_back_as_json(scheduler: str, tmp_path: Path) -> None:
    run(stills(3), tmp_path / "cluster", Options(scheduler=scheduler))
    run(stills(3), tmp_path / "local", Options(workers=1))
    assert files(tmp_path / "cluster") == files(tmp_path / "local")


def test_workers_without_our_code_are_named(scheduler: str, tmp_path: Path) -> None:
    with pytest.raises(trajopt.BadInput, match="a worker cannot begin.*no_such_module.*install the same trajopt"):
        run(stills(2), tmp_path, Options(scheduler=scheduler, function="tests.no_such_module:solve"))


LOCAL = ("tcp://127.0.0.1:8786", "127.0.0.1:8786", "localhost:1", "tcp://[::1]:8786")


@pytest.mark.parametrize("address", [*LOCAL, "tls://far.example:8786"])
def test_addresses_on_this_machine_or_encrypted_are_taken(address: str) -> None:
    assert refuse_open(address).endswith(address.rpartition("/")[2])


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("tcp://192.0.2.7:8786", "use tls://"),
        ("far.example:8786", "use tls://"),
        ("0.0.0.0:8786", "use tls://"),
        ("tcp://127.0.0.1.evil.example:8786", "use tls://"),
        ("tcp://user@evil.example:8786", "use tls://"),
        ("ucx://127.0.0.1:8786", "write an address such as"),
        ("127.0.0.1", "write an address such as"),
        ("tcp://127.0.0.1:port", "write an address such as"),
        ("", "write an address such as"),
    ],
)
def test_other_addresses_are_refused_with_what_to_do(address: str, words: str) -> None:
    with pytest.raises(trajopt.BadInput, match=words):
        refuse_open(address)


def test_nobody_at_the_address_is_said_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from trajopt.study import cluster

    monkeypatch.setattr(cluster, "_PATIENCE", 1.0)
    with pytest.raises(trajopt.BadInput, match="cannot be reached"):
        run(stills(1), tmp_path, Options(scheduler=f"tcp://127.0.0.1:{_port()}"))
