"""Workers that crash, hang, eat memory or are killed cost their own case, and no other."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import psutil
import pytest

from tests.study_faults import STILL, stills
from trajopt.study import plan, pool
from trajopt.study.pool import Limits
from trajopt.study.run import Options, Report, run
from trajopt.study.store import Store

POISONED = Options(workers=2, limits=Limits(seconds=0.7, memory=3 << 30), function="tests.study_faults:poisoned")
POISON = {"case3": "crash", "case4": "hang", "case8": "eat", "case9": "leave"}
EXPECTED = {
    3: ("CRASHED", "the process was ended by SIGSEGV, in 2 tries"),
    4: ("LIMIT", "ended after 0.7 s, in 2 tries"),
    8: ("CRASHED", "more than 3 GiB of memory wanted, in 2 tries"),
    9: ("CRASHED", "the process ended with code 3, in 2 tries"),
}


def test_poison_harms_none_but_itself_and_is_named(tmp_path: Path) -> None:
    report = run(stills(20, **POISON), tmp_path, POISONED)
    failures = {c.number: key for key, cases in report.failures().items() for c in cases}
    assert failures == EXPECTED
    assert report.counts["SOLVED"] == 16


def test_workers_that_do_not_come_up_are_nobody_s_fault(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="before they are ready.*worker processes"):
        run(stills(3), tmp_path, Options(function="tests.no_such_module:solve", workers=2))
    with Store(tmp_path) as store:
        assert not list(store.answers())


def test_workers_killed_at_random_lose_nothing(tmp_path: Path) -> None:
    """A kill every ten answers: a case that is tried again has then been answered, and none is killed twice."""
    wanted = stills(60)
    killed: list[int] = []
    answered: list[str] = []

    class Killer:
        def begin(self, total: int, reused: Sequence[str]) -> None:
            """Wait for the first answer."""

        def kept(self, statuses: Sequence[str]) -> None:
            answered.extend(statuses)
            if len(killed) < 4 and len(answered) >= 10 * (len(killed) + 1):
                victims = [child for child in psutil.Process().children(recursive=True) if _works(child)]
                if victims:
                    killed.append(victims[0].pid)
                    os.kill(victims[0].pid, signal.SIGKILL)

    options = Options(workers=2, function="tests.study_faults:invented")
    report = run(wanted, tmp_path / "killed", options, Killer())
    assert len(killed) == 4 and "CRASHED" not in report.counts
    assert _table(report) == _table(run(wanted, tmp_path / "calm", options))


def _works(process: psutil.Process) -> bool:
    """Whether it is a fork of the server, which is one of ours itself."""
    try:
        return process.parent() != psutil.Process() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def _table(report: Report) -> bytes:
    return report.written[0].read_bytes()


def test_workers_are_recycled(tmp_path: Path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr(pool, "RECYCLE", 3)
    started: list[int] = []
    real = pool._Worker.__init__

    def counted(self, *words):  # type: ignore[no-untyped-def]
        started.append(1)
        real(self, *words)

    monkeypatch.setattr(pool._Worker, "__init__", counted)
    report = run(stills(20), tmp_path, Options(workers=2, function="tests.study_faults:invented"))
    assert report.counts.total() == 20 and 6 <= len(started) <= 8


def test_the_window_of_cases_under_way_is_bounded() -> None:
    """Cases are made when a worker is free for them: a plan of a million does not lie in the pipes."""
    made: list[int] = []

    def tasks():  # type: ignore[no-untyped-def]
        for case in PLAN.cases:
            made.append(case.number)
            yield pool.Task(case.key, '{"problem": {}, "seconds": 1, "trajectory": false}')

    workers = pool.Pool(2, function="tests.study_faults:poisoned")
    try:
        for count, _ in enumerate(workers.answers(tasks()), start=1):
            assert len(made) <= 2 * count + 2
    finally:
        workers.close()
    assert len(made) == 12


PLAN = plan.from_dict({"problem": STILL, "grid": {"limits.velocity": [f"{i} m/s" for i in range(1, 13)]}})


def test_workers_end_when_the_parent_has_gone_even_in_native_code(tmp_path: Path) -> None:
    """A hang in a worker whose parent was killed is ended by the alarm."""
    import subprocess
    import sys

    code = (
        "import sys; from pathlib import Path; from trajopt.study import pool; pool.PRELOAD.clear();"
        "from tests.test_study_pool import POISONED, run, stills;"
        "run(stills(2, case1='hang', case2='hang'), Path(sys.argv[1]), POISONED)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code, tmp_path])
    family: list[psutil.Process] = []
    deadline = time.monotonic() + 20
    while len(family) < 4 and time.monotonic() < deadline:  # resource tracker, server, two workers
        family = psutil.Process(parent.pid).children(recursive=True)
        time.sleep(0.02)
    parent.kill()
    parent.wait()
    gone, alive = psutil.wait_procs(family, timeout=10)
    assert len(family) >= 4 and not alive


def test_a_run_off_the_main_thread_works(tmp_path: Path) -> None:
    found: list[Report] = []
    options = Options(workers=1, function="tests.study_faults:invented")
    thread = threading.Thread(target=lambda: found.append(run(stills(2), tmp_path, options)))
    thread.start()
    thread.join()
    assert found[0].counts == Counter(SOLVED=2)
