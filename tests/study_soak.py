"""The long campaigns of studies, for tests/soak.py: ten thousand cases with poison in them, and two hundred kills."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import psutil

from tests.study_faults import HEAD, kills
from trajopt.study import plan
from trajopt.study.pool import Limits
from trajopt.study.run import Options, Report, run

POISON: Final = ("crash", "leave", "eat", "hang")
SMALL: Final[dict[str, Any]] = {
    "move": {"time": "1 s", "end": {"position": "100 mm"}},
    "objective": {"minimize": "jerk", "norm": "linf"},
    "transcription": {"intervals": 100},
}


def cases(count: int, spoilt: bool) -> plan.Plan:
    """Small moves of different lengths, 41 or more; when spoilt, 3 % are impossible and 20 are poison."""
    rows: list[dict[str, Any]] = [{"move.end.position": f"{100 + i / 100:g} mm"} for i in range(count)]
    if spoilt:
        for i in range(0, count, 33):
            rows[i]["limits.velocity"] = "50 mm/s"
        for k in range(20):
            rows[(2 * k + 1) * count // 40 + 1]["title"] = f"{POISON[k % 4]} {k}"
    return plan.from_dict({"problem": SMALL, "case": rows}, many=True)


class Memory:
    """The memory of all our processes as the study gets on, in bytes."""

    def __init__(self) -> None:
        self.seen: list[int] = []
        self._looked = 0.0

    def begin(self, total: int, reused: Sequence[str]) -> None:
        """Nothing to see yet."""

    def kept(self, statuses: Sequence[str]) -> None:
        """Look once a second."""
        if time.monotonic() - self._looked > 1:
            self._looked = time.monotonic()
            family = [psutil.Process(), *psutil.Process().children(recursive=True)]
            self.seen.append(sum(_memory(process) for process in family))


def _memory(process: psutil.Process) -> int:
    try:
        return int(process.memory_info().rss)
    except psutil.NoSuchProcess:
        return 0


def poison(count: int, workers: int) -> dict[str, Any]:
    """A clean run and a spoilt one: what went wrong, and how times and memory compare."""
    options = Options(workers=workers, limits=Limits(1.0, 3 << 30), function="tests.study_faults:poisoned")
    memory, took, reports = Memory(), [], []
    for spoilt in (False, True):
        with tempfile.TemporaryDirectory() as folder:
            stated, since = cases(count, spoilt), time.monotonic()
            reports.append(run(stated, Path(folder), options, memory if spoilt else None))
            took.append(time.monotonic() - since)
    middle = sorted(memory.seen)[len(memory.seen) // 2]
    figures = {"clean_s": took[0], "spoilt_s": took[1], "ratio": took[1] / took[0]}
    last = memory.seen[-1] / middle
    return {"count": count, "faults": dict(enumerate(_faults(*reports))), "last_to_median_memory": last, **figures}


def _faults(clean: Report, spoilt: Report) -> list[str]:
    """Cases that did not end as they had to."""
    found = [f"clean: {case.where} {a['status']}" for case, a in zip(clean.plan.cases, clean.answers, strict=True)
             if a["status"] != "SOLVED"]  # fmt: skip
    for case, answer in zip(spoilt.plan.cases, spoilt.answers, strict=True):
        given = dict(case.overrides)
        kind = given.get("title", "").partition(" ")[0]
        harmless = "IMPOSSIBLE" if "limits.velocity" in given else "SOLVED"
        wanted = "LIMIT" if kind == "hang" else "CRASHED" if kind else harmless
        if answer["status"] != wanted:
            found.append(f"{case.where}: {answer['status']} instead of {wanted}: {answer['message']}")
    return found


def killed(count: int) -> dict[str, Any]:
    """``count`` kills in rounds of ten: what was lost, or came out otherwise than without."""
    faults: dict[int, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "study.toml"
        study.write_text(HEAD + f"[{', '.join(repr(f'{i + 1} m/s') for i in range(300))}]\n")
        calm = kills(study, Path(folder) / "calm", 0, 0)
        for seed in range(-(-count // 10)):
            found = kills(study, Path(folder) / str(seed), 10, seed)
            if found["lost"] or found["files"] != calm["files"]:
                faults[seed] = f"lost {found['lost']}" if found["lost"] else "another table"
    return {"count": -(-count // 10) * 10, "faults": faults}
