"""The long random test: thousands of specs over processes, a table of verdicts, and every failure by its seed.

python -m tests.soak --specs 20000 --seed 1 --workers 2
python -m tests.soak --seeds 1000000:1020000  the same specs
python -m tests.soak --seeds 17 --show        one spec again, and what was made of it

Every record is written to a journal as it comes, one JSON line each. The same command goes on where a run was stopped,
by Ctrl-C, SIGTERM or ``--seconds``, and its summary counts every spec ever judged; ``--afresh`` forgets them.
Of the impossible moves every fifth is explained, and a cure of it tried: see `tests.campaign`.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict
from itertools import islice
from pathlib import Path
from typing import Any, Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from tests import study_soak, test_plant_random, test_switching
from tests.campaign import Record, draw, judge, remarks, shrunk

STORE: Final = Path(__file__).parents[1] / ".soak"
SPECS: Final = 20_000
PLANTS: Final = 300
CHAINS: Final = 200_000
SNAPS: Final = 20
_BATCH: Final = 500  # chains a task
CASES: Final = 10_000
KILLS: Final = 200
STAGES: Final = {
    "plants": "linear plants, not solved and proven",
    "chains": "least times, unlike Ruckig's",
    "snaps": "hundreds of fourth-order moves with moving ends, not proven to a millionth",
    "studies": "cases of a study with poison in it, ended otherwise than they had to",
    "kills": "kills of a study, in rounds that lost something",
}
MOST_OPEN: Final = 0.01  # of the fourth-order moves with moving ends
MOST_UNDECIDED: Final = 1e-3  # of well-posed convex specs
PATIENCE: Final = 600.0  # s for one spec and those that wait before it: beyond, its worker hangs
_LOOK: Final = 60.0  # s between looks for one that hangs
EXPLAINED: Final = 5  # of so many impossible moves, one
_RECYCLE: Final = 400  # specs a worker judges: solvers leak


def main(arguments: list[str] | None = None) -> int:
    """Run the campaign; 1 when anything is fatal, 130 when it was stopped."""
    options = _options(arguments)
    seeds = options.seeds or range(options.seed * 1_000_000, options.seed * 1_000_000 + options.specs)
    console = Console(stderr=True)
    if options.show:
        shown = [_shown(seed, console, options.shrink) for seed in seeds]
        summary = summarise(shown, sum(record.seconds for record in shown))
        _print(summary, console)
        return int(_is_wrong(summary))
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    journal = Journal(STORE / f"{min(seeds)}_{max(seeds) + 1}.jsonl", options.afresh)
    stopped = _judge_all(seeds, options, journal, console)
    summary = summarise([r for r in journal.records if r.seed in set(seeds)], journal.seconds)
    if not options.seeds and not stopped and summary["specs"] == len(seeds):
        summary["plants"] = _stage(test_plant_random.fault, options.plants, options.workers)
        batches = -(-options.chains // _BATCH)
        summary["snaps"] = _stage(test_switching.snap_fault, options.snaps, options.workers)
        summary["chains"] = _stage(test_switching.fault, batches, options.workers) | {"count": batches * _BATCH}
        if options.cases:
            summary["studies"] = study_soak.poison(options.cases, options.workers)
        if options.kills:
            summary["kills"] = study_soak.killed(options.kills)
    _print(summary, console)
    path = journal.path.with_suffix(".json")
    path.write_text(json.dumps(summary, indent=1))
    console.print(f"written: {path}")
    return 130 if stopped else int(_is_wrong(summary))


def _is_wrong(summary: dict[str, Any]) -> bool:
    faults = any(summary.get(stage, {}).get("faults") for stage in STAGES if stage != "snaps")
    snaps = summary.get("snaps", {"count": 0, "faults": {}})  # an open bracket is said, not hidden; few may be open
    faults |= sum(text.count(";") + 1 for text in snaps["faults"].values()) > MOST_OPEN * 100 * snaps["count"]
    return summary["fatal"] > 0 or summary["undecided_share"] > MOST_UNDECIDED or faults


class Journal:
    """The records of a range of seeds, kept in a file of JSON lines; a run that ends leaves a line with its seconds."""

    def __init__(self, path: Path, afresh: bool = False) -> None:
        path.parent.mkdir(exist_ok=True)
        if afresh:
            path.unlink(missing_ok=True)
        lines = path.read_text().splitlines(keepends=True) if path.exists() else []
        if lines and not lines[-1].endswith("\n"):  # a killed run left it so
            path.write_text("".join(lines[:-1]))
            lines.pop()
        found = [json.loads(line) for line in lines]
        self.path = path
        self.records = [Record(**x) for x in found if "seed" in x]
        self.seconds = float(sum(x["ran"] for x in found if "ran" in x))
        self._file = path.open("a")

    def add(self, record: Record) -> None:
        """Keep a record."""
        self.records.append(record)
        self._write(asdict(record))

    def ran(self, seconds: float) -> None:
        """Keep how long a run took."""
        self.seconds += seconds
        self._write({"ran": seconds})

    def _write(self, line: dict[str, Any]) -> None:
        self._file.write(json.dumps(line) + "\n")
        self._file.flush()


def _judge_all(seeds: Sequence[int], options: argparse.Namespace, journal: Journal, console: Console) -> bool:
    """Judge the seeds that the journal lacks; whether that was stopped by a signal."""
    since = time.monotonic()
    done = {record.seed for record in journal.records}
    left = [seed for seed in seeds if seed not in done]
    try:
        for record in _watched(_run(left, options.workers, since + options.seconds), len(left), console):
            journal.add(record)
    except KeyboardInterrupt:
        return True
    finally:
        journal.ran(time.monotonic() - since)
    return False


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__.splitlines()[0])
    parser.add_argument("--specs", type=int, default=SPECS, help="how many specs (20000)")
    parser.add_argument(
        "--seed", type=int, default=1, help="which campaign (1): its specs have seeds from SEED million on"
    )
    parser.add_argument("--workers", type=int, default=min(os.cpu_count() or 1, 8), help="processes")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop submitting after so long")
    parser.add_argument("--plants", type=int, default=PLANTS, help="how many linear plants after the specs (300)")
    parser.add_argument("--snaps", type=int, default=SNAPS, help="hundreds of fourth-order moves with moving ends (20)")
    parser.add_argument("--chains", type=int, default=CHAINS, help="how many least times against Ruckig's (200000)")
    parser.add_argument("--cases", type=int, default=CASES, help="how many cases of a study with poison in it (10000)")
    parser.add_argument("--kills", type=int, default=KILLS, help="how many kills of a study (200)")
    parser.add_argument("--seeds", nargs="+", default=[], help="only the specs of these seeds, or of FROM:TO")
    parser.add_argument("--afresh", action="store_true", help="judge again what the journal has")
    parser.add_argument("--show", action="store_true", help="print each spec, judged here with every comparison")
    parser.add_argument(
        "--shrink", action="store_true", help="with --show: simplify what fails as far as it still does"
    )
    options = parser.parse_args(arguments)
    options.seeds = [seed for text in options.seeds for seed in _span(text)]
    return options


def _span(text: str) -> range:
    first, colon, end = text.partition(":")
    return range(int(first), int(end) if colon else int(first) + 1)


def _stage(fault: Callable[[int], str], count: int, workers: int) -> dict[str, Any]:
    """How many seeds were tried of a stage beside the campaign, and what is wrong with them, by seed."""
    pool = _pool(workers)
    try:
        found = {seed: pool.submit(fault, seed) for seed in range(count)}
        return {"count": count, "faults": {seed: text for seed, future in found.items() if (text := _outcome(future))}}
    finally:
        _end(pool)


def _outcome(future: Future[str]) -> str:
    try:
        return future.result(timeout=PATIENCE)
    except (BrokenProcessPool, TimeoutError) as error:
        return f"crash: the process died or hung ({type(error).__name__})"


def work(seed: int) -> Record:
    """Draw and judge one spec, in a worker."""
    return judge(draw(seed), explained=seed % EXPLAINED == 0)


def _quiet() -> None:
    for interrupt in (signal.SIGINT, signal.SIGTERM):  # the parent decides
        signal.signal(interrupt, signal.SIG_IGN)


def _pool(workers: int) -> ProcessPoolExecutor:
    for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(threads, "1")  # the workers inherit it
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, mp_context=context, initializer=_quiet, max_tasks_per_child=_RECYCLE)


def _run(seeds: Iterable[int], workers: int, deadline: float) -> Iterator[Record]:
    """The records as they come. Specs in flight when a worker dies are judged again, each in a process of its own."""
    waiting, suspects = iter(seeds), []
    pool = _pool(workers)
    flying: dict[Future[Record], tuple[int, float]] = {}  # seed, and since when
    try:
        while True:
            room = 3 * workers - len(flying) if time.monotonic() < deadline else 0
            for seed in islice(waiting, room):
                flying[pool.submit(work, seed)] = seed, time.monotonic()
            if not flying:
                break
            done, _ = wait(flying, timeout=_LOOK, return_when=FIRST_COMPLETED)
            try:
                for future in done:
                    record = future.result()
                    del flying[future]
                    yield record
                if any(since < time.monotonic() - PATIENCE for _, since in flying.values()):
                    raise BrokenProcessPool("no answer")
            except BrokenProcessPool:
                suspects += [seed for seed, _ in flying.values()]
                flying = {}
                _end(pool)
                pool = _pool(workers)
    finally:
        _end(pool)
    for seed in suspects:
        yield _alone(seed)


def _end(pool: ProcessPoolExecutor) -> None:
    processes = list((pool._processes or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.kill()


def _alone(seed: int) -> Record:
    pool = _pool(1)
    try:
        return pool.submit(work, seed).result(timeout=PATIENCE)
    except (BrokenProcessPool, TimeoutError) as error:
        return Record(seed, "CRASHED", failures=[f"crash: the process died or hung ({type(error).__name__})"])
    finally:
        _end(pool)


def _watched(records: Iterable[Record], count: int, console: Console) -> Iterator[Record]:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    fatal = 0
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("0 fatal", total=count)
        for record in records:
            for failure in record.failures:
                progress.console.print(f"seed {record.seed} {record.status}: {failure}", highlight=False, markup=False)
            fatal += bool(record.failures)
            progress.update(task, advance=1, description=f"{fatal} fatal")
            yield record


def _shown(seed: int, console: Console, shrink: bool) -> Record:
    spec = draw(seed)
    console.print_json(json.dumps(spec.to_dict()))
    record = judge(spec, thorough=True)
    console.print_json(json.dumps(asdict(record)))
    if shrink and remarks(record):
        console.print("shrunk to")
        console.print_json(json.dumps(shrunk(spec).to_dict()))
    return record


def summarise(records: list[Record], seconds: float) -> dict[str, Any]:
    """Counts and failures, plain data."""
    counts = Counter(count for record in records for count in record.counts)
    convex = sum(record.convex and record.status != "REFUSED" for record in records)
    undecided = sum(n for count, n in counts.items() if count.endswith("well-posed"))
    return {
        "specs": len(records),
        "solves": sum(record.solves for record in records),
        "seconds": seconds,
        "verdicts": dict(Counter(record.status or "EXCEPTION" for record in records).most_common()),
        "counts": dict(counts.most_common()),
        "convex": convex,
        "undecided_share": undecided / max(convex, 1),
        "fatal": sum(bool(record.failures) for record in records),
        "failures": [{"seed": r.seed, "status": r.status, "why": r.failures} for r in records if r.failures],
        "noted": [
            {"seed": r.seed, "counts": r.counts, "message": r.message[:400]}
            for r in records if any(count != "not strict" for count in r.counts)
        ],
        "slowest": [[r.seed, round(r.seconds, 1)] for r in sorted(records, key=lambda r: -r.seconds)[:10]],
    }  # fmt: skip


def _print(summary: dict[str, Any], console: Console) -> None:
    table = Table(title=f"{summary['specs']} specs, {summary['solves']} solves in {summary['seconds']:.0f} s")
    table.add_column("verdict or remark")
    table.add_column("specs", justify="right")
    for name, count in (*summary["verdicts"].items(), *summary["counts"].items()):
        table.add_row(name, str(count))
    table.add_row("undecided, of well-posed convex", f"{100 * summary['undecided_share']:.3g} %")
    table.add_row("fatal", str(summary["fatal"]))
    console.print(table)
    for failure in summary["failures"]:
        for why in failure["why"]:
            console.print(f"seed {failure['seed']} {failure['status']}: {why}", highlight=False, markup=False)
    for stage, words in STAGES.items():
        if stage in summary:
            faults = summary[stage]["faults"]
            console.print(f"{summary[stage]['count']} {words}: {len(faults)}")
            for seed, fault in faults.items():
                console.print(f"{stage} {seed}: {fault}", highlight=False, markup=False)


if __name__ == "__main__":
    sys.exit(main())
