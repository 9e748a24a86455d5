"""What a study costs over the bare solves, and what a second worker saves."""

from __future__ import annotations

import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import pandas as pd

import trajopt
from trajopt.study import plan
from trajopt.study.run import Options, run


def cases(count: int) -> plan.Plan:
    """Small moves of given time, half of least jerk L2 and half of least peak power."""
    terms = [{"minimize": "jerk", "norm": "l2"}, {"minimize": "power", "norm": "linf"}]
    rows = [
        {"objective.terms": [terms[i % 2]], "move.end.position": f"{100 + i // 2 / 10:g} mm"} for i in range(count)
    ]
    problem = {
        "move": {"time": "0.5 s", "end": {"position": "100 mm"}},
        "limits": {"velocity": ["0 m/s", "0.45 m/s"], "jerk": "100 m/s^3"},
        "load": {"mass": "2 kg"},
        "objective": {"minimize": "jerk", "norm": "l2"},
        "transcription": {"intervals": 40},
    }
    return plan.from_dict({"problem": problem, "case": rows})


def bare(stated: plan.Plan) -> float:
    """Wall time of solving the cases one after the other here, in s. Raises ValueError where one is not solved."""
    problems = [trajopt.from_dict(stated.content(case)) for case in stated.cases]
    trajopt.solve(problems[0])  # loads the solvers
    trajopt.solve(problems[-1])
    since = perf_counter()
    for problem in problems:
        if not trajopt.solve(problem).status.solved:
            raise ValueError(f"{problem}: not solved, nothing to time")
    return perf_counter() - since


def by_study(stated: plan.Plan, workers: int) -> tuple[float, float]:
    """Wall time of the study, with the start of its processes, its store and its table, in s; and the share of it in
    which its workers were solving."""
    with tempfile.TemporaryDirectory() as folder:
        since = perf_counter()
        report = run(stated, Path(folder), Options(workers=workers))
        took = perf_counter() - since
        solving = pd.read_csv(Path(folder) / "timings.csv")["seconds"].sum()
    if not report.status.solved:
        raise ValueError(f"{report.counts}: not all solved, nothing to time")
    return took, float(solving) / (took * workers)


def measured(count: int) -> dict[str, Any]:
    """Times in s of both sides, and their ratios."""
    stated = cases(count)
    row: dict[str, Any] = {"cases": count, "bare": bare(stated)}
    for k in (1, 2):
        row[f"workers_{k}"], row[f"solving_{k}"] = by_study(stated, k)
    return row | {"overhead": row["workers_1"] / row["bare"] - 1, "speed_up": row["workers_1"] / row["workers_2"]}
