"""Least times: ours, checked and certified, against the `ruckig` package in turn, in one process.

python -m bench.least_time                 a Markdown table, and bench.json in the folder given by --output
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any, Final

from ruckig import InputParameter, Result, Ruckig, Trajectory

import trajopt

SNAP: Final = {"velocity": 1.0, "acceleration": 20.0, "jerk": 1000.0, "snap": 1e5}
THIRD: Final = {"velocity": (-1.79, 1.11), "acceleration": (-1.94, 1.52), "jerk": 3.76}
MOVING: Final = {"start": {"velocity": -0.5, "acceleration": 0.8}, "end": {"velocity": 0.54, "acceleration": -0.37}}
S_CURVE: Final = {"velocity": 0.5, "acceleration": 4.905, "jerk": 98.1}


def problem(distance: float, limits: dict[str, Any], start: Any = None, end: Any = None) -> trajopt.Problem:
    """A minimum-time move from 0 to ``distance``."""
    return trajopt.Problem(
        move=trajopt.Move(
            time="free",
            start=trajopt.State(position=0.0, **(start or {})),
            end=trajopt.State(position=distance, **(end or {})),
        ),
        limits=trajopt.Limits(**limits),
        objective=trajopt.Objective(minimize="time"),
    )


CASES: Final[dict[str, trajopt.Problem]] = {
    "third order, rest to rest": problem(0.254, S_CURVE),
    "third order, moving ends": problem(1.04, THIRD, **MOVING),
    "fourth order, short": problem(0.01, SNAP),
    "fourth order, chattering": problem(0.3, SNAP),
}


def by_ruckig(stated: trajopt.Problem) -> Callable[[], float] | None:
    """The peer on the same problem; None at fourth order, which it does not know."""
    if stated.order != 3:
        return None
    given = InputParameter(1)
    for name in ("position", "velocity", "acceleration"):
        for which, state in (("current", stated.move.start), ("target", stated.move.end)):
            setattr(given, f"{which}_{name}", [float(getattr(state, name) or 0.0)])
    velocity, acceleration, jerk = (getattr(stated.limits, name) for name in ("velocity", "acceleration", "jerk"))
    given.min_velocity, given.max_velocity = [velocity.lowest], [velocity.highest]
    given.min_acceleration, given.max_acceleration = [acceleration.lowest], [acceleration.highest]
    given.max_jerk = [jerk.highest]

    def run() -> float:
        trajectory = Trajectory(1)
        if Ruckig(1).calculate(given, trajectory) not in (Result.Working, Result.Finished):
            raise RuntimeError("the peer found no move")
        return float(trajectory.duration)

    return run


def measured(name: str, runs: int) -> dict[str, Any]:
    """Medians in ms of both sides, in turn, and their ratio. Raises ValueError where the two disagree by 1e-9."""
    ours, peer = CASES[name], by_ruckig(CASES[name])
    found = trajopt.solve(ours)
    if not found.status.solved or found.duration is None:
        raise ValueError(f"{name}: {found.status.value}, nothing to time")
    if peer is not None and abs(peer() - found.duration) > 1e-9 * found.duration:
        raise ValueError(f"{name}: {found.duration!r} against {peer()!r}: the comparison is void")
    times: dict[str, list[float]] = {"ours": [], "peer": []}
    for _ in range(runs):
        since = perf_counter()
        trajopt.solve(ours)
        times["ours"].append(perf_counter() - since)
        if peer is not None:
            since = perf_counter()
            peer()
            times["peer"].append(perf_counter() - since)
    row: dict[str, Any] = {"case": name, "runs": runs, "ours_ms": 1e3 * median(times["ours"])}
    if peer is not None:
        row["peer_ms"] = 1e3 * median(times["peer"])
        row["ratio"] = median(a / b for a, b in zip(times["ours"], times["peer"], strict=True))
    return row


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown."""
    lines = ["| least time | ours, checked and certified [ms] | Ruckig [ms] | ratio |", "|---|---|---|---|"]
    for row in rows:
        peer = f"{row['peer_ms']:.4f} | {row['ratio']:.0f}" if "ratio" in row else "- | -"
        lines.append(f"| {row['case']} | {row['ours_ms']:.1f} | {peer} |")
    return "\n".join(lines)


def main() -> None:
    """Print the table, write the JSON."""
    parser = argparse.ArgumentParser(prog="python -m bench.least_time", description=__doc__)
    parser.add_argument("--runs", type=int, default=31, help="timed runs of each side (31)")
    parser.add_argument("--output", type=Path, help="a folder for bench.json")
    options = parser.parse_args()
    rows = [measured(name, options.runs) for name in CASES]
    print(table(rows))
    if options.output is not None:
        options.output.mkdir(parents=True, exist_ok=True)
        (options.output / "bench.json").write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
