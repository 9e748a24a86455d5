"""What the tests of studies need: small plans, and answers that crash, hang or eat memory where the title asks for it.

python -m tests.study_faults STUDY.toml FOLDER      a run of invented answers that says what it has kept, to be killed
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import trajopt
from trajopt.study import answer, plan, pool
from trajopt.study.run import Options, run
from trajopt.study.store import NAME

STILL: dict[str, Any] = {  # a move of no length: solved and checked in two milliseconds, without a solver
    "move": {"time": "1 s", "end": {"position": "0 m"}},
    "objective": {"minimize": "jerk", "norm": "l2"},
    "transcription": {"intervals": 8},
}


HEAD = """
[problem]
move = { time = "1 s", end = { position = "0 m" } }
objective = { minimize = "jerk", norm = "l2" }
transcription = { intervals = 8 }
[grid]
"limits.velocity" = """  # the same as a study file, for a list of limits


def stills(count: int, **titles: str) -> plan.Plan:
    """``count`` cases without length; ``case3="crash"`` titles case 3, which `poisoned` then obeys."""
    rows = [{"limits.velocity": f"{i} m/s", "title": titles.get(f"case{i}", "")} for i in range(1, count + 1)]
    return plan.from_dict({"problem": STILL, "case": rows})


def poisoned(asked: str) -> str:
    """`trajopt.study.answer.solve`, but for titles that name a way to go wrong."""
    title = json.loads(asked)["problem"].get("title", "")
    if title.startswith("crash"):
        os.kill(os.getpid(), signal.SIGSEGV)
    if title.startswith("leave"):
        os._exit(3)
    if title.startswith("hang"):
        time.sleep(3600)
    if title.startswith("eat"):
        _eat()
    return answer.solve(asked)


def _eat() -> None:
    kept = []
    while True:
        kept.append(np.empty(1 << 26))


def invented(asked: str) -> str:
    """An answer without solving: numbers made of the velocity limit; a few milliseconds, as if it were work."""
    problem = trajopt.from_dict(json.loads(asked)["problem"])
    assert isinstance(problem, trajopt.Problem) and problem.limits.velocity is not None
    time.sleep(0.004)
    top = problem.limits.velocity.highest
    known = {"problem": problem.hash, "trajopt": trajopt.__version__, "rotary": False, "minimised": "jerk l2"}
    if int(top) % 10 == 7:
        return json.dumps(answer.unsolved(trajopt.Verdict.IMPOSSIBLE, f"{top:g} is not to our taste") | known)
    numbers = {"objective": top / 3, "duration": 1.0, "lower_bound": top / 3, "gap": 0.0, "metrics": {"energy": top}}
    files = {"files": {".json": "{}", ".csv": "t [s]\n"}} if json.loads(asked)["trajectory"] else {}
    return json.dumps(answer.unsolved(trajopt.Verdict.SOLVED, "") | known | numbers | files)


def slow(asked: str) -> str:
    """An invented answer that takes a while."""
    time.sleep(0.2)
    return invented(asked)


class Talker:
    """Says on standard output what is kept, as soon as it is told."""

    def begin(self, total: int, reused: Sequence[str]) -> None:
        print("reused", len(reused), flush=True)

    def kept(self, statuses: Sequence[str]) -> None:
        print("kept", len(statuses), flush=True)


def main() -> None:
    """Run the study in the first argument into the second with invented answers, and say when it is finished."""
    pool.PRELOAD.clear()
    options = Options(workers=2, function="tests.study_faults:invented", trajectories=True)
    run(plan.load(sys.argv[1]), Path(sys.argv[2]), options, Talker())
    print("finished", flush=True)


def files(folder: Path) -> dict[str, bytes]:
    """What a study has written that must not depend on how it came about."""
    found = [path for path in sorted(folder.rglob("*")) if path.is_file() and not path.name.startswith(NAME)]
    return {str(p.relative_to(folder)): p.read_bytes() for p in found if p.name not in ("study.lock", "timings.csv")}


def kills(study: Path, folder: Path, count: int, seed: int) -> dict[str, Any]:
    """Run a study with invented answers, kill it ``count`` times at random, every other time a worker first, and let it
    finish: the announced cases that a later run did not find, and the files."""
    draw, announced, lost = random.Random(seed), 0, 0
    line = [sys.executable, "-m", "tests.study_faults", str(study), str(folder)]
    for _ in range(count):
        running = subprocess.Popen(line, stdout=subprocess.PIPE, text=True)
        assert running.stdout is not None
        said = [running.stdout.readline() for _ in range(draw.choice((0, 1, 2)))]  # before it looks, before it has any
        time.sleep(draw.uniform(0.0, 0.8))
        if draw.random() < 0.5:
            _kill_a_worker(running.pid, draw)
            time.sleep(draw.uniform(0.0, 0.3))
        running.kill()
        found, kept = _said("".join(said) + running.communicate()[0])
        lost += max(announced - found, 0) if found is not None else 0
        announced = max(announced, found or 0) + kept
    found, _ = _said(subprocess.run(line, capture_output=True, text=True, check=True).stdout)
    assert found is not None
    return {"lost": lost + max(announced - found, 0), "announced": announced, "files": files(folder)}


def _said(text: str) -> tuple[int | None, int]:
    """How many cases a run has found finished, and how many it has announced."""
    words = [line.split() for line in text.split("\n")[:-1]]
    found = [int(word[1]) for word in words if word[0] == "reused"]
    return (found[0] if found else None), sum(int(word[1]) for word in words if word[0] == "kept")


def _kill_a_worker(parent: int, draw: random.Random) -> None:
    import psutil

    for child in draw.sample(found := psutil.Process(parent).children(recursive=True), len(found)):
        if child.ppid() != parent:  # a fork of the server
            child.kill()
            return


if __name__ == "__main__":
    main()
