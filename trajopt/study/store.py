"""What a study has found so far, in one SQLite file that survives kills, full disks and second processes.

Write-ahead log and full synchronisation: what `Store.add` has returned from is on the disk. One writer: a lock that the
system takes back when the process ends. Answers are found by the key of the case, so that nothing is there twice.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import socket
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, Self

from trajopt.errors import BadInput

NAME: Final = "study.sqlite"
LOCK: Final = "study.lock"
VERSION: Final = 1  # of the table below
_TABLE: Final = """
CREATE TABLE IF NOT EXISTS answers (
    key TEXT PRIMARY KEY,        -- of the canonical problem and the version that answered it
    overrides TEXT NOT NULL,     -- JSON, for people
    answer TEXT NOT NULL,        -- JSON, see trajopt.study.answer
    files TEXT,                  -- JSON, the files of the move by their endings, where they were asked for
    seconds REAL NOT NULL,
    tries INTEGER NOT NULL,
    stale INTEGER NOT NULL DEFAULT 0   -- of an earlier edition of the study
) STRICT, WITHOUT ROWID
"""


@dataclass(frozen=True)
class Kept:
    """An answer with what it took: wall time in s, and tries."""

    key: str
    answer: Mapping[str, Any]
    seconds: float
    tries: int
    overrides: Any = ()


class Store:
    """The store of a study in a folder, for one process at a time; a context manager.

    Raises OSError, naming the file, when it is in use elsewhere (BlockingIOError), or cannot be read or written; the
    store stays as it was. Raises BadInput for a file of another version.
    """

    def __init__(self, folder: Path) -> None:
        self._path = inside(folder, NAME)
        self._lock = _locked(inside(folder, LOCK))
        try:
            with self._told():
                self._database = connect(self._path)
                self._prepare()
        except BaseException:
            os.close(self._lock)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file and give the lock back."""
        try:
            with self._told():
                self._database.close()
        finally:
            os.close(self._lock)

    def _prepare(self) -> None:
        run = self._database.execute
        run("PRAGMA busy_timeout = 30000")
        mode = run("PRAGMA journal_mode = WAL").fetchone()[0]
        if mode != "wal":
            text = "the file system takes no write-ahead log; choose a local folder"
            raise OSError(errno.EOPNOTSUPP, text, str(self._path))
        run("PRAGMA synchronous = FULL")
        found = run("PRAGMA user_version").fetchone()[0]
        if found not in (0, VERSION):
            raise BadInput(f"{self._path}: is of version {found}, this trajopt writes {VERSION}; choose another folder")
        with self._database:
            run("BEGIN IMMEDIATE")  # also finds out that nothing can be written, before anything is solved
            run(_TABLE)
            run(f"PRAGMA user_version = {VERSION}")

    def add(self, answers: Iterable[Kept]) -> None:
        """Keep answers, in one transaction: they are on the disk when this returns."""
        rows = [_row(kept) for kept in answers]
        with self._told(), self._database:
            self._database.execute("BEGIN IMMEDIATE")
            self._database.executemany("INSERT OR REPLACE INTO answers VALUES (?, ?, ?, ?, ?, ?, 0)", rows)

    def edition(self, keys: Iterable[str]) -> int:
        """Mark what does not belong to the present cases as stale, and what does as not; returns how many are."""
        with self._told(), self._database:
            run = self._database.execute
            run("BEGIN IMMEDIATE")
            run("CREATE TEMP TABLE IF NOT EXISTS present (key TEXT PRIMARY KEY) WITHOUT ROWID")
            run("DELETE FROM present")
            self._database.executemany("INSERT OR IGNORE INTO present VALUES (?)", ((key,) for key in keys))
            run("UPDATE answers SET stale = key NOT IN (SELECT key FROM present)")
            return int(run("SELECT count(*) FROM answers WHERE stale").fetchone()[0])

    def forget(self) -> None:
        """Drop all answers."""
        with self._told(), self._database:
            self._database.execute("DELETE FROM answers")

    def with_files(self) -> set[str]:
        """The keys of answers that come with the files of their moves."""
        with self._told():
            return {key for (key,) in self._database.execute("SELECT key FROM answers WHERE files IS NOT NULL")}

    def answers(self) -> Iterator[Kept]:
        """All answers that are not stale, by key."""
        asked = "SELECT key, answer, seconds, tries, overrides FROM answers WHERE NOT stale ORDER BY key"
        with self._told():
            for key, answer, seconds, tries, overrides in self._database.execute(asked):
                yield Kept(key, json.loads(answer), seconds, tries, json.loads(overrides))

    def files(self, key: str) -> dict[str, str]:
        """The files of a move by their endings; empty where there are none."""
        with self._told():
            row = self._database.execute("SELECT files FROM answers WHERE key = ?", (key,)).fetchone()
        return json.loads(row[0]) if row and row[0] else {}

    @contextmanager
    def _told(self) -> Iterator[None]:
        """What SQLite says, as an OSError that names the file."""
        try:
            yield
        except sqlite3.Error as error:
            code = errno.ENOSPC if getattr(error, "sqlite_errorcode", 0) == sqlite3.SQLITE_FULL else errno.EIO
            text = f"{error}; what was finished is kept, the same command resumes"
            raise OSError(code, text, str(self._path)) from error


def connect(path: Path) -> sqlite3.Connection:
    """A connection that begins transactions only when told to."""
    return sqlite3.connect(path, isolation_level=None)


def inside(folder: Path, name: str) -> Path:
    """The path of a generated name in an output folder. Raises OSError for a symbolic link, which leads elsewhere."""
    path = folder.resolve() / name
    if path.is_symlink():
        raise OSError(errno.ELOOP, "is a symbolic link; nothing is written through one: remove it", str(path))
    return path


def _row(kept: Kept) -> tuple[Any, ...]:
    answer = dict(kept.answer)
    files = answer.pop("files", None)
    texts = json.dumps(kept.overrides), json.dumps(answer, allow_nan=False)
    return kept.key, *texts, None if files is None else json.dumps(files), kept.seconds, kept.tries


def _locked(path: Path) -> int:
    """A descriptor that holds the lock until it is closed or the process ends. Raises BlockingIOError."""
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        since = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
        os.ftruncate(handle, 0)
        os.pwrite(handle, f"process {os.getpid()} on {socket.gethostname()} since {since}".encode(), 0)
    except BlockingIOError:
        holder = os.pread(handle, 200, 0).decode(errors="replace") or "another process"
        os.close(handle)
        text = f"the study is locked by {holder}; wait for it, or choose another folder"
        raise BlockingIOError(errno.EWOULDBLOCK, text, str(path)) from None
    except OSError as error:
        os.close(handle)
        raise OSError(error.errno, error.strerror, str(path)) from None
    return handle
