"""``trajopt study``: read the plan, run it under Ctrl-C, say what came of it."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from trajopt.errors import BadInput
from trajopt.study import plan as plans
from trajopt.study import run as running
from trajopt.study import summary
from trajopt.study.pool import Limits
from trajopt.study.progress import Watcher
from trajopt.verdict import Verdict


def options(
    workers: int, scheduler: str | None, seconds: float, memory: float, trajectories: bool, fresh: bool, retry: bool
) -> running.Options:
    """The options as stated on the command line. Raises BadInput."""
    if not 0 <= workers <= 1000:
        raise BadInput(f"--workers must be 0 (one a processor) to 1000, got {workers}")
    if not 0.5 <= memory <= 1e5:
        raise BadInput(f"--memory must be 0.5 to 1e5 GiB, got {memory:g}; the solvers alone take a third of a GiB")
    limits = Limits(seconds, int(memory * (1 << 30)))
    return running.Options(workers, scheduler, limits, trajectories, fresh, retry)


def run(source: str, folder: Path, chosen: running.Options, keep_going: bool, yes: bool, as_json: bool) -> int:
    """Run the study and print its summary; returns the exit code. Raises what `trajopt.study.run.run` does, and
    KeyboardInterrupt."""
    plan = _load(source, keep_going, yes)
    with _interruptible(), Watcher() as watcher:
        report = running.run(plan, folder, chosen, watcher)
    if as_json:
        print(json.dumps(summary.to_dict(report), allow_nan=False))
    else:
        summary.show(report)
    return 0 if all(Verdict(status).solved for status in report.counts) else 3


def _load(source: str, keep_going: bool, yes: bool) -> plans.Plan:
    """The plan; on a terminal, many cases are asked about. Raises BadInput."""
    try:
        return plans.load(source, keep_going, yes)
    except plans.TooMany as error:
        if not sys.stdin.isatty():
            raise
        import typer

        if not typer.confirm(f"{error}: go on?", err=True):
            raise
    return plans.load(source, keep_going, many=True)


@contextmanager
def _interruptible() -> Iterator[None]:
    """The first Ctrl-C unwinds, so that workers are ended and the store closed; a second one ends us at once."""

    def first(*_: Any) -> None:
        signal.signal(signal.SIGINT, lambda *_: os._exit(Verdict.INTERRUPTED.exit_code))
        print("study: stopping; what is finished is kept, and the same command resumes", file=sys.stderr, flush=True)
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, first)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
