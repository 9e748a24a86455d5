"""Run a study: what the store has is reused, the rest solved, kept before it is announced, and written as a table."""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

from trajopt import __version__
from trajopt.errors import BadInput, InternalError, MissingSolver
from trajopt.study import export
from trajopt.study.answer import key_of, question, unsolved
from trajopt.study.plan import Case, Plan
from trajopt.study.pool import SOLVE, Done, Limits, Pool, Task
from trajopt.study.store import Kept, Store
from trajopt.verdict import Verdict

_AGAIN: Final = (Verdict.LIMIT, Verdict.CRASHED)  # what more time, more memory or more luck may cure
_NUMBER: Final = re.compile(r"\d[\d.,e+-]*")


class Watch(Protocol):
    """Who wants to hear how a study gets on."""

    def begin(self, total: int, reused: Sequence[str]) -> None:
        """There are so many cases; those that need not be solved have these statuses."""

    def kept(self, statuses: Sequence[str]) -> None:
        """So many more are finished, and on the disk."""


@dataclass(frozen=True)
class Options:
    """How a study is run. ``retry``: solve again what ended in LIMIT or CRASHED; ``fresh``: solve everything again;
    ``scheduler``: address of a Dask scheduler, instead of ``workers`` processes here."""

    workers: int = 0  # as many as there are processors
    scheduler: str | None = None
    limits: Limits = Limits()
    trajectories: bool = False
    fresh: bool = False
    retry: bool = False
    function: str = SOLVE

    @property
    def processes(self) -> int:
        """How many workers there are here."""
        return self.workers or len(os.sched_getaffinity(0))


@dataclass(frozen=True)
class Report:
    """A finished study: its cases, their answers, and the files that were written."""

    plan: Plan
    answers: tuple[dict[str, Any], ...]  # of each case
    reused: int
    stale: int
    written: tuple[Path, ...]

    @property
    def counts(self) -> Counter[str]:
        """How many cases have ended how."""
        return Counter(answer["status"] for answer in self.answers)

    @property
    def status(self) -> Verdict:
        """SOLVED when every case is, else the gravest that there is."""
        return max((Verdict(status) for status in self.counts), key=_gravity)

    def failures(self) -> dict[tuple[str, str], list[Case]]:
        """(status, reason) -> the cases that have no solution for it, the most frequent first. Reasons that differ in
        their numbers alone, or in what follows from them, count as one: that of the first such case is given."""
        found: dict[tuple[str, str], list[Case]] = {}
        first: dict[tuple[str, str], tuple[str, str]] = {}
        for case, answer in zip(self.plan.cases, self.answers, strict=True):
            status, reason = answer["status"], answer["message"]
            if not Verdict(status).solved:
                alike = status, _NUMBER.sub("", reason.partition(";")[0])
                found.setdefault(first.setdefault(alike, (status, reason)), []).append(case)
        return dict(sorted(found.items(), key=lambda item: -len(item[1])))


def _gravity(status: Verdict) -> int:
    return list(Verdict).index(status)


def run(plan: Plan, folder: Path, options: Options = Options(), watch: Watch | None = None) -> Report:
    """Solve what the store in ``folder`` does not have, and write the table beside it.

    Raises OSError when the store is in use or cannot be written, BadInput for a scheduler that cannot be used, and
    MissingSolver. What was finished before is kept, and so it is on KeyboardInterrupt.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with Store(folder) as store:
        export.clear_leftovers(folder)
        if options.fresh:
            store.forget()
        stale = store.edition(case.key for case in plan.solvable)
        wanted, statuses = _wanted(plan, store, options)
        if watch is not None:
            watch.begin(len(plan.cases), statuses)
        if wanted:
            _solve(plan, wanted, store, options, watch)
        answers = _answers(plan, store)
        written = export.write(plan, answers, store, folder)
        return Report(plan, tuple(dict(kept.answer) for kept in answers), len(statuses), stale, tuple(written))


def _wanted(plan: Plan, store: Store, options: Options) -> tuple[list[Case], list[str]]:
    """The cases to solve, and the statuses of the others."""
    known = {kept.key: Verdict(kept.answer["status"]) for kept in store.answers()}
    if options.trajectories:
        with_files = store.with_files()
        known = {key: status for key, status in known.items() if key in with_files or not status.solved}
    if options.retry:
        known = {key: status for key, status in known.items() if status not in _AGAIN}
    wanted = [case for case in plan.solvable if case.key not in known]
    others = [known.get(case.key, Verdict.BAD_INPUT).value for case in plan.cases if case.fault or case.key in known]
    return wanted, others


def _solve(plan: Plan, wanted: Sequence[Case], store: Store, options: Options, watch: Watch | None) -> None:
    """Solve cases and keep their answers, each before it is announced."""
    cases = {case.key: case for case in wanted}
    workers = _workers(options, len(wanted))
    try:
        for batch in workers.answers(_tasks(plan, wanted, options)):
            answers = [_kept(done, cases[done.key]) for done in batch]
            store.add(answers)
            if watch is not None:
                watch.kept([kept.answer["status"] for kept in answers])
    finally:
        workers.close()


class _Workers(Protocol):
    def answers(self, tasks: Iterator[Task]) -> Iterator[list[Done]]: ...
    def close(self) -> None: ...


def _workers(options: Options, count: int) -> _Workers:
    if options.scheduler is None:
        return Pool(min(options.processes, count), options.limits, options.function)
    from trajopt.study.cluster import Cluster

    return Cluster(options.scheduler, options.limits, options.function)


def _tasks(plan: Plan, wanted: Sequence[Case], options: Options) -> Iterator[Task]:
    for case in wanted:
        asked = question(plan.content(case), options.limits.seconds, options.trajectories)
        yield Task(case.key, asked)


def _kept(done: Done, case: Case) -> Kept:
    """An answer to keep. Raises MissingSolver, and InternalError for an answer to another question."""
    answer = json.loads(done.answer)
    if answer.get("stop"):
        raise MissingSolver(answer["message"])
    if answer.get("trajopt", __version__) != __version__:
        raise BadInput(f"--scheduler: workers run trajopt {answer['trajopt']}, this is {__version__}; install the same")
    if "problem" in answer and key_of(answer["problem"]) != case.key:
        raise InternalError(f"{case.where}: the answer is to another problem")
    return Kept(case.key, answer, done.seconds, done.tries, case.overrides)


def _answers(plan: Plan, store: Store) -> list[Kept]:
    """The answer of each case, in order."""
    known = {kept.key: kept for kept in store.answers()}
    return [
        Kept("", unsolved(Verdict.BAD_INPUT, case.fault), 0.0, 0) if case.fault else known[case.key]
        for case in plan.cases
    ]
