"""Writing files that are never seen half written."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from trajopt.errors import BadInput


def refuse_folder(path: Path) -> None:
    """See that a file can be named so, before anything is made for it. Raises BadInput for a folder, FileNotFoundError
    for a file in none."""
    if path.is_dir():
        raise BadInput(f"output: {path} is a folder; name a file in it")
    if not path.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such folder; make it first", str(path.parent))


def write_atomically(path: Path, content: bytes, accept: Callable[[Path], None] = lambda written: None) -> None:
    """Write beside, flush to disk, then rename: a reader never sees half a file. Raises OSError.

    ``accept`` may look at what was written before it takes its place; when it raises, nothing is left.
    """
    handle, beside = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        accept(Path(beside))
        os.chmod(beside, 0o644)
        os.replace(beside, path)
    except BaseException:
        Path(beside).unlink(missing_ok=True)
        raise
