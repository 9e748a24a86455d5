"""The files of a study, derived from its store: each written beside and renamed, so that none is ever half there."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from trajopt.files import write_atomically
from trajopt.study import rows
from trajopt.study.store import inside

if TYPE_CHECKING:
    import pandas as pd

    from trajopt.study.plan import Plan
    from trajopt.study.store import Kept, Store

TABLE: Final = "study.csv"
PARQUET: Final = "study.parquet"
TIMINGS: Final = "timings.csv"
PICTURE: Final = "study.png"
MOVES: Final = "trajectories"
_RUN_BY_SPREADSHEETS: Final = ("=", "+", "-", "@", "\t", "\r", "\0")  # OWASP ASVS 1.2.10, CWE-1236
_LEFTOVER: Final = re.compile(r"\.(study|timings|case\d+)\.(csv|parquet|png|json)\.\w{8}")


def write(plan: Plan, answers: Sequence[Kept], store: Store, folder: Path) -> list[Path]:
    """Write the table, the timings, the moves that the store has, the picture; returns their paths. Raises OSError."""
    table = rows.table(plan, answers)
    contents = {
        TABLE: as_csv(table),
        PARQUET: _parquet(table),
        TIMINGS: as_csv(rows.timings(plan, answers)),
    }
    if plan.plot is not None:
        from trajopt.study.picture import picture

        contents[PICTURE] = picture(plan, table)
    else:  # one of an earlier edition would show something else
        inside(folder, PICTURE).unlink(missing_ok=True)
    written = []
    for name, content in contents.items():
        written.append(inside(folder, name))
        write_atomically(written[-1], content)
    return written + _write_moves(plan, store, folder)


def as_csv(table: pd.DataFrame) -> bytes:
    """The table as CSV, with an apostrophe before texts that a spreadsheet would run; numbers as they are."""
    safe = table.rename(columns=_quoted)
    for heading in safe.select_dtypes(exclude="number").columns:
        safe[heading] = safe[heading].map(_quoted)
    return safe.to_csv(index=False, lineterminator="\n").encode()


def _quoted(value: Any) -> Any:
    if not isinstance(value, str):
        return value
    safe = f"'{value}" if value.startswith(_RUN_BY_SPREADSHEETS) else value
    return safe.replace("\r", " ")  # which readers take for the end of a row, and pandas does not quote


def _parquet(table: pd.DataFrame) -> bytes:
    buffer = io.BytesIO()
    table.to_parquet(buffer, index=False)
    return buffer.getvalue()


def _write_moves(plan: Plan, store: Store, folder: Path) -> list[Path]:
    """The moves as case<number>.json, for ``trajopt check``, and .csv; those of an earlier edition go."""
    moves = inside(folder, MOVES)
    wanted = dict(_moves(plan, store))
    if moves.is_dir():
        for path in moves.iterdir():
            if re.fullmatch(r"case\d+\.(json|csv)", path.name) and path.name not in wanted:
                path.unlink()
    if not wanted:
        return []
    moves.mkdir(exist_ok=True)
    for name, (key, ending) in wanted.items():
        path, content = inside(moves, name), store.files(key)[ending].encode()
        if not path.is_file() or path.read_bytes() != content:  # to write it again would cost a flush to the disk
            write_atomically(path, content)
    return [moves]


def _moves(plan: Plan, store: Store) -> Iterator[tuple[str, tuple[str, str]]]:
    there = store.with_files()
    digits = len(str(len(plan.cases)))
    for case in plan.solvable:
        if case.key in there:
            for ending in store.files(case.key):
                yield f"case{case.number:0{digits}}{ending}", (case.key, ending)


def clear_leftovers(folder: Path) -> None:
    """Remove what a process that was killed while it wrote has left."""
    for place in (folder, folder / MOVES):
        if place.is_dir() and not place.is_symlink():
            for path in place.iterdir():
                if _LEFTOVER.fullmatch(path.name):
                    path.unlink()
