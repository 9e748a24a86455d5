"""How a study gets on, on standard error: a bar on a terminal, else a plain line now and then."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Sequence
from typing import Any, Final, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

EVERY: Final = 10.0  # s between plain lines


class Watcher:
    """Rate, verdicts and remaining time of a study; a context manager."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._total = self._reused = 0
        self._since = self._said = time.monotonic()
        console = Console(stderr=True)
        self._bar = _bar(console) if console.is_terminal else None
        self._task = TaskID(0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def begin(self, total: int, reused: Sequence[str]) -> None:
        """See `trajopt.study.run.Watch`."""
        self._total, self._reused = total, len(reused)
        self._since = self._said = time.monotonic()
        self._counts.update(reused)
        if self._bar is not None:
            self._bar.start()
            self._task = self._bar.add_task("", total=total, completed=len(reused), rate="", verdicts="")
        else:
            kept = f", {len(reused)} of them need no solving" if reused else ""
            self._say(f"{total} cases{kept}")

    def kept(self, statuses: Sequence[str]) -> None:
        """See `trajopt.study.run.Watch`."""
        self._counts.update(statuses)
        done = sum(self._counts.values())
        if self._bar is not None:
            self._bar.update(self._task, completed=done, rate=f"{self._rate(done):.3g}/s", verdicts=self._verdicts())
        elif done == self._total or time.monotonic() - self._said >= EVERY:
            self._said = time.monotonic()
            left = (self._total - done) / max(self._rate(done), 1e-9)
            rest = f", {_duration(left)} left" if done < self._total else ""
            self._say(f"{done} of {self._total}, {self._rate(done):.3g}/s{rest}: {self._verdicts()}")

    def _rate(self, done: int) -> float:
        return (done - self._reused) / max(time.monotonic() - self._since, 1e-6)

    def _verdicts(self) -> str:
        return ", ".join(f"{count} {status}" for status, count in self._counts.most_common())

    def _say(self, line: str) -> None:
        print(f"study: {line}", file=sys.stderr, flush=True)


def _bar(console: Console) -> Progress:
    columns: tuple[Any, ...] = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}"),
                                TimeRemainingColumn(), TextColumn("{task.fields[verdicts]}"))  # fmt: skip
    return Progress(*columns, console=console)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02} min" if hours else f"{minutes} min {rest:02} s" if minutes else f"{rest} s"
