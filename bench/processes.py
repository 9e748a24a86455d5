"""What can be measured only in a process of its own: memory, imports, the command line.

python -m bench.processes "jerk L2" 1000      one solve: status, gap, seconds and peak memory as JSON
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median, quantiles
from time import perf_counter
from typing import Any, Final

LONGEST: Final = 60.0  # s


def measured(case: str, intervals: int) -> dict[str, Any]:
    """One solve of a case in a fresh process: ``status``, ``gap``, ``seconds``, ``kilobytes`` beyond those of a small
    solve."""
    command = [sys.executable, "-m", "bench.processes", case, str(intervals)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def compared(row: Any, ours: Sequence[str], theirs: Sequence[str], runs: int) -> Any:
    """Two commands in turn, from start to exit."""
    times = [(_seconds(ours), _seconds(theirs)) for _ in range(runs + 1)][1:]
    ratios = [a / b for a, b in times]
    low, _, high = quantiles(ratios, n=4) if runs > 1 else ratios * 3
    ours_ms, peer_ms = (1e3 * median(side) for side in zip(*times, strict=True))
    return replace(row, ours_ms=ours_ms, peer_ms=peer_ms, ratio=median(ratios), low=low, high=high, runs=runs)


def _seconds(command: Sequence[str]) -> float:
    since = perf_counter()
    subprocess.run(command, capture_output=True, check=True)
    return perf_counter() - since


def _peak() -> int:
    """Peak memory in kB, of this process alone: what getrusage says includes its parent's before the start."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmHWM")).split()[1])


def main() -> None:
    """Solve one case within LONGEST and print what it took."""
    from bench.cases import CASES
    from trajopt.solving import solve

    case, intervals = CASES[sys.argv[1]], int(sys.argv[2])
    solve(case.problem(20))
    before, since = _peak(), perf_counter()
    solution = solve(case.problem(intervals), LONGEST)
    seconds, gap = perf_counter() - since, solution.certificate.get("gap")
    found = {"status": solution.status.value, "gap": float("nan") if gap is None else gap, "seconds": seconds}
    print(json.dumps({**found, "kilobytes": _peak() - before}))


if __name__ == "__main__":
    main()
