"""The store of a study: what it has taken is there after any failure, once, and for one process at a time."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import trajopt
from tests.study_faults import files, invented, stills
from trajopt.study import run as running
from trajopt.study import store
from trajopt.study.plan import Plan
from trajopt.study.pool import Done, Task
from trajopt.study.store import Kept, Store


class Inline:
    """Answers without processes."""

    def answers(self, tasks: Iterator[Task]) -> Iterator[list[Done]]:
        for task in tasks:
            yield [Done(task.key, invented(task.question), 0.1, 1)]

    def close(self) -> None:
        """Nothing to close."""


class Counter:
    """How many cases were announced."""

    def __init__(self) -> None:
        self.announced = 0

    def begin(self, total: int, reused: Any) -> None:
        """Not counted."""

    def kept(self, statuses: Any) -> None:
        self.announced += len(statuses)


@pytest.fixture
def inline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "_workers", lambda options, count: Inline())


PLAN = stills(4)
WITH_MOVES = running.Options(trajectories=True)


@pytest.fixture
def undisturbed(inline: None, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("undisturbed")
    running.run(PLAN, folder, WITH_MOVES)
    return files(folder)


def _stored(folder: Path) -> list[str]:
    with Store(folder) as kept:
        return [row.key for row in kept.answers()]


def test_what_was_added_is_there_again_and_the_file_is_a_log_with_full_synchronisation(tmp_path: Path) -> None:
    with Store(tmp_path) as kept:
        kept.add([Kept("a", {"status": "SOLVED", "files": {".csv": "x"}}, 1.5, 2, (("move.time", "1 s"),))])
        modes = [kept._database.execute(f"PRAGMA {what}").fetchone()[0] for what in ("journal_mode", "synchronous")]
    assert modes == ["wal", 2]
    with Store(tmp_path) as kept:
        (row,) = kept.answers()
        assert row == Kept("a", {"status": "SOLVED"}, 1.5, 2, [["move.time", "1 s"]])
        assert kept.files("a") == {".csv": "x"} and kept.with_files() == {"a"}


def test_an_edited_study_keeps_its_former_answers_as_stale(inline: None, tmp_path: Path) -> None:
    counter = Counter()
    running.run(stills(3), tmp_path, watch=counter)
    edited = running.run(Plan("", PLAN.bases, PLAN.cases[1:]), tmp_path, watch=counter)
    assert counter.announced == 4 and (edited.reused, edited.stale) == (2, 1)
    back = running.run(stills(3), tmp_path, watch=counter)
    assert counter.announced == 4 and (back.reused, back.stale) == (3, 1)


def test_fresh_solves_everything_again_and_retry_what_was_ended(inline: None, tmp_path: Path) -> None:
    running.run(PLAN, tmp_path)
    with Store(tmp_path) as kept:
        kept.add([Kept(PLAN.cases[0].key, {"status": "LIMIT", "message": "late"}, 1.0, 1)])
    assert running.run(PLAN, tmp_path).reused == 4
    assert running.run(PLAN, tmp_path, running.Options(retry=True)).reused == 3
    assert running.run(PLAN, tmp_path, running.Options(fresh=True)).reused == 0


def test_moves_asked_for_later_are_found_later(inline: None, tmp_path: Path, undisturbed: dict[str, bytes]) -> None:
    running.run(PLAN, tmp_path)
    assert not (tmp_path / "trajectories").exists()
    assert running.run(PLAN, tmp_path, WITH_MOVES).reused == 0
    assert files(tmp_path) == undisturbed


class _Faulty(sqlite3.Connection):
    """Fails at a statement, as a disk does."""

    left = 0

    def execute(self, *words: Any) -> sqlite3.Cursor:
        self._count()
        return super().execute(*words)

    def executemany(self, *words: Any) -> sqlite3.Cursor:
        self._count()
        return super().executemany(*words)

    def commit(self) -> None:
        self._count()
        super().commit()

    def _count(self) -> None:
        _Faulty.left -= 1
        if _Faulty.left == 0:
            raise sqlite3.OperationalError("disk I/O error")


def test_every_statement_may_fail_and_nothing_announced_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undisturbed: dict[str, bytes]
) -> None:
    def connect(path: Path) -> sqlite3.Connection:
        return sqlite3.connect(path, isolation_level=None, factory=_Faulty)

    failures = 0
    for n in range(1, 200):
        folder, counter = tmp_path / str(n), Counter()
        folder.mkdir()
        with monkeypatch.context() as faulty:
            faulty.setattr(store, "connect", connect)
            _Faulty.left = n
            try:
                running.run(PLAN, folder, WITH_MOVES, counter)
            except OSError as error:
                assert str(folder / "study.sqlite") in str(error) and "resumes" in str(error)
                failures += 1
            if _Faulty.left > 0:
                break
        assert len(_stored(folder)) >= counter.announced
        assert running.run(PLAN, folder, WITH_MOVES).reused >= counter.announced
        assert files(folder) == undisturbed
    assert failures > 30 and _Faulty.left > 0  # the last run was not disturbed


@pytest.mark.parametrize("call", ["fsync", "replace", "chmod"])
def test_every_file_may_fail_to_be_written(
    call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undisturbed: dict[str, bytes]
) -> None:
    import os

    real, failures = getattr(os, call), 0
    for n in range(1, 50):
        folder, calls = tmp_path / str(n), 0
        folder.mkdir()

        def failing(*words: Any, at: int = n) -> Any:
            nonlocal calls
            calls += 1
            if calls == at:
                raise OSError(28, "No space left on device", "somewhere")
            return real(*words)

        with monkeypatch.context() as faulty:
            faulty.setattr(os, call, failing)
            try:
                running.run(PLAN, folder, WITH_MOVES)
            except OSError:
                failures += 1
        assert running.run(PLAN, folder, WITH_MOVES).reused == len(PLAN.cases)
        assert files(folder) == undisturbed
        if calls < n:
            break
    assert failures >= 3 and calls < n


LIMITED = """
import resource, sys
from tests.test_study_store import PLAN, WITH_MOVES, Inline, running
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
running._workers = lambda options, count: Inline()
from pathlib import Path
try:
    running.run(PLAN, Path(sys.argv[1]), WITH_MOVES)
except OSError as error:
    print(error)
    sys.exit(4)
"""


@pytest.mark.parametrize("size", [0, 4096, 16_000, 28_000])
def test_a_disk_that_is_full_ends_the_run_and_leaves_the_store_intact(
    size: int, tmp_path: Path, undisturbed: dict[str, bytes]
) -> None:
    line = [sys.executable, "-c", LIMITED, tmp_path, str(size)]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 4 and str(tmp_path) in done.stdout, done.stderr
    running.run(PLAN, tmp_path, WITH_MOVES)
    assert files(tmp_path) == undisturbed


def test_a_second_process_is_refused_with_the_name_of_the_first(tmp_path: Path) -> None:
    second = "import sys\nfrom pathlib import Path\nfrom trajopt.study.store import Store\nStore(Path(sys.argv[1]))"
    with Store(tmp_path):
        with pytest.raises(BlockingIOError, match="locked by process [0-9]+ on .* since .* UTC"):
            Store(tmp_path)
        done = subprocess.run([sys.executable, "-c", second, tmp_path], capture_output=True, text=True, check=False)
        assert "BlockingIOError" in done.stderr
    Store(tmp_path).close()


def test_what_is_no_store_of_ours_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "study.sqlite").write_bytes(b"something else altogether" * 100)
    with pytest.raises(OSError, match="not a database"):
        Store(tmp_path)
    assert (tmp_path / "study.sqlite").read_bytes().startswith(b"something else")
    (tmp_path / "study.sqlite").unlink()
    other = sqlite3.connect(tmp_path / "study.sqlite")
    other.execute("PRAGMA user_version = 7")
    other.close()
    with pytest.raises(trajopt.BadInput, match="is of version 7"):
        Store(tmp_path)


@pytest.mark.parametrize("name", ["study.sqlite", "study.lock", "study.csv", "trajectories"])
def test_nothing_is_written_through_a_symbolic_link(name: str, inline: None, tmp_path: Path) -> None:
    outside, folder = tmp_path / "outside", tmp_path / "out"
    folder.mkdir()
    (folder / name).symlink_to(outside)
    with pytest.raises(OSError, match="symbolic link"):
        running.run(PLAN, folder, WITH_MOVES)
    assert not outside.exists()
