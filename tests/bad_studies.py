"""Bad study files as data: what is wrong, and the words that the one-line refusal must contain."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

BASE: Final = 'problem = "clemen_rupp_jerk_l2"\n'
GRID: Final = BASE + "[grid]\n"
TABLE: Final = BASE + 'table = "cases.csv"\n'


@dataclass(frozen=True)
class Bad:
    name: str
    study: str
    words: tuple[str, ...]
    table: bytes | None = None


def write(bad: Bad, folder: Path) -> Path:
    """Write the files of a case; returns the study's path."""
    if bad.table is not None:
        (folder / "cases.csv").write_bytes(bad.table)
    (folder / "study.toml").write_text(bad.study)
    return folder / "study.toml"


CASES: Final = (
    Bad("nothing", "", ("problem: give one problem",)),
    Bad("both", BASE + 'problems = ["a.toml"]\n', ("problem: give one problem",)),
    Bad("nothing-varies", BASE, ("nothing varies", "[grid]")),
    Bad("unknown-key", BASE + "gird = {}\n", ("gird: unknown key", "did you mean 'grid'")),
    Bad("no-toml", "problem = \n", ("study.toml", "not a TOML file")),
    Bad("no-such-problem", 'problem = "clemen_rup"\n[grid]\na = ["1 s"]\n', ("clemen_rup", "ready-made problem")),
    Bad("no-such-file", 'problem = "nix.toml"\n[grid]\nmove.time = ["1 s"]\n', ("nix.toml", "cannot be read")),
    Bad("number-for-a-problem", 'problem = 3\n[grid]\nmove.time = ["1 s"]\n', ("problem", "ready-made problem's name")),
    Bad("empty-axis", GRID + "move.time = []\n", ("grid", "move.time: is empty", "at least one value")),
    Bad("no-list", GRID + 'move.time = "1 s"\n', ("grid", "move.time: must be a list of values", "got '1 s'")),
    Bad("unknown-override", GRID + 'limits.velcity = ["1 m/s"]\n', ("limits.velcity: unknown key", "case 1")),
    Bad("unknown-section", GRID + 'limit.velocity = ["1 m/s"]\n', ("limit: unknown key", "'limits'")),
    Bad("empty-part", GRID + '"move..time" = ["1 s"]\n', ("move..time", "write key=value")),
    Bad("deep-key", GRID + f'"{".".join("a" * 70)}" = ["1 s"]\n', ("write key=value",)),
    Bad("no-unit", GRID + "move.time = [1.0]\n", ("move.time", "has no unit", "case 1")),
    Bad("wrong-unit", GRID + 'move.time = ["1 kg"]\n', ("move.time", "is in kg")),
    Bad("unknown-norm", GRID + 'objective.norm = ["l3"]\n', ("objective.norm", "l3", "l1, l2, linf")),
    Bad("same-value", GRID + 'move.time = ["1 s", "2 s", "1000 ms"]\n', ("case 3", "as case 1", "1000 ms")),
    Bad("into-a-value", GRID + 'move.time.x = ["1 s"]\n', ("move.time is not a section",)),
    Bad("grid-and-case", GRID + 'move.time = ["1 s"]\n[[case]]\nmove.time = "2 s"\n', ("grid.move.time", "as well")),
    Bad("case-and-table", TABLE + '[[case]]\nmove.time = "2 s"\n', ("here or in the table",), b"move.time\n1 s\n"),
    Bad("name-no-text", BASE + '[[case]]\nname = 3\nmove.time = "2 s"\n', ("case 1: name must be one line of text",)),
    Bad("plot-unknown", GRID + 'move.time = ["1 s"]\n[plot]\nx = "move.tim"\ny = "a"\n', ("move.tim", "'move.time'")),
    Bad("plot-no-y", GRID + 'move.time = ["1 s"]\n[plot]\nx = "move.time"\n', ("plot.y: is missing",)),
    Bad("no-table", TABLE, ("cases.csv", "cannot be read")),
    Bad("empty-table", TABLE, ("cases.csv", "has no rows"), b""),
    Bad("header-alone", TABLE, ("cases.csv", "has no rows"), b"move.time\n"),
    Bad("short-row", TABLE, ("cases.csv, line 3: has 1 cells, the header 2",), b"move.time,title\n1 s,a\n2 s\n"),
    Bad("long-row", TABLE, ("cases.csv, line 2: has 3 cells, the header 1",), b"move.time\n1 s,a,b\n"),
    Bad("no-heading", TABLE, ("line 1: an empty heading",), b"move.time,\n1 s,a\n"),
    Bad("semicolons", TABLE, ("line 1", "write commas between cells"), b"move.time;limits.jerk\n1 s;2 m/s^3\n"),
    Bad("heading-twice", TABLE, ("line 1", "'move.time' is there twice"), b"move.time,move.time\n1 s,2 s\n"),
    Bad("open-quote", TABLE, ("cases.csv", "line 2"), b'move.time\n"1 s\n'),
    Bad("duplicate-rows", TABLE, ("line 4: states the same problem as", "line 2"), b"move.time\n1 s\n2 s\n1 s\n"),
    Bad("bad-cell", TABLE, ("cases.csv, line 2", "move.time", "is not a number"), b"move.time\nfast\n"),
    Bad("broken-list", TABLE, ("line 2", "no TOML list"), b"limits.velocity\n[0 m/s\n"),
    Bad("bom", TABLE, ("cases.csv", "without a byte order mark"), b"\xef\xbb\xbfmove.time\n1 s\n"),
    Bad("nul", TABLE, ("cases.csv", "NUL"), b"move.time\n1 \0s\n"),
    Bad("utf-16", TABLE, ("cases.csv", "plain UTF-8"), "move.time\n1 s\n".encode("utf-16")),
    Bad("latin", TABLE, ("cases.csv", "not UTF-8"), b"name,move.time\n\xe9,1 s\n"),
    Bad("huge", TABLE, ("cases.csv", "larger than 10 MB"), b"move.time\n" + b"1 s\n" * 2_600_000),
    Bad("name-of-two-lines", TABLE, ("line 3", "name must be one line"), b'name,move.time\n"a\nb",1 s\n'),
)  # fmt: skip
