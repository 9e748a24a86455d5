"""Every benchmark in one run: ours, checked and certified, and a peer in turn; medians of ratios.

python -m bench.run                     all of it, as a Markdown table; bench.json beside it in --output
python -m bench.run power growth        some groups
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from statistics import median, quantiles
from time import perf_counter
from typing import Any, Final

import numpy as np

import trajopt
from bench import processes, study
from bench.cases import CASES, LEAST_TIMES, Case
from bench.peers import bare_clarabel, casadi_mechanics, casadi_opti, pyomo_ipopt, rockit_ocp, ruckig_profile

AGREE: Final = 1e-5  # relative: optima further apart void a comparison


@dataclass(frozen=True)
class Row:
    """One comparison: medians in ms, the median ratio of ours to theirs with its quartiles; ``note`` says what else."""

    group: str
    case: str
    intervals: int
    peer: str
    ours_ms: float | None = None
    peer_ms: float | None = None
    ratio: float | None = None
    low: float | None = None
    high: float | None = None
    runs: int = 0
    note: str = ""


@dataclass(frozen=True)
class Plan:
    """How much is run: the mesh sizes of each group and the runs of each side, on small and on large meshes."""

    small: int
    sizes: tuple[int, ...]  # of cold solves against a peer
    growth: tuple[int, ...]
    runs: int
    few: int


FULL: Final = Plan(200, (50, 200, 1000, 5000), (1000, 5000, 20_000, 100_000), 9, 1)
SMOKE: Final = Plan(20, (20, 24), (20, 40), 1, 1)


def compared(
    row: Row, ours: Callable[[], float], theirs: Callable[[], float], runs: int, agree: float = AGREE, parts: int = 1
) -> Row:
    """Both in turn, after a first run of each that must agree: else the comparison is void, and says so. Ours does what
    theirs does ``parts`` times."""
    try:
        here, there = ours(), theirs()
        if abs(here - there) > agree * abs(there):
            return replace(row, note=f"void: {here!r} against {there!r}")
        times = np.array([[_timed(ours) / parts, _timed(theirs)] for _ in range(runs)])
    except (RuntimeError, ValueError) as error:
        return replace(row, note=f"void: {str(error).strip().splitlines()[-1][:90]}")
    ratios = (times[:, 0] / times[:, 1]).tolist()
    low, _, high = quantiles(ratios, n=4) if runs > 1 else ratios * 3
    return replace(
        row,
        ours_ms=1e3 * median(times[:, 0]),
        peer_ms=1e3 * median(times[:, 1]),
        ratio=median(ratios),
        low=low,
        high=high,
        runs=runs,
    )


def _ended(run: Callable[[], Any]) -> Callable[[], float]:
    """A run whose value is not compared: the peer does a part of what ours does."""

    def ended() -> float:
        run()
        return 1.0

    return ended


def _timed(run: Callable[[], Any]) -> float:
    since = perf_counter()
    run()
    return perf_counter() - since


def ours(problem: trajopt.Problem) -> float:
    """The objective of a solve from the statement to the checked, certified answer. Raises ValueError without one."""
    solution = trajopt.solve(problem)
    if not solution.status.solved or solution.objective is None:
        raise ValueError(f"ours: {solution.status.value}: {solution.message}")
    return float(solution.objective)


def single(plan: Plan, convex: bool) -> Iterator[Row]:
    """Cold solves and re-solves at other distances against Opti, and against the bare Clarabel runs within ours."""
    group = "convex" if convex else "power"
    for case in (case for case in CASES.values() if case.convex is convex):
        for n in plan.sizes:
            runs, problem = plan.runs if n <= plan.small else plan.few, case.problem(n)
            row = Row(group, f"{case.name}, cold", n, "CasADi Opti, Ipopt")
            yield compared(row, partial(ours, problem), partial(casadi_opti.cold, case, n), runs)
            if n != plan.small:
                continue
            yield _again(group, case, n, runs)
            bare = bare_clarabel.alone(problem)
            if not (count := bare()):  # in closed form
                continue
            row = Row(group, case.name, n, f"bare Clarabel, the same {count} programs")
            yield compared(row, _ended(partial(ours, problem)), _ended(bare), runs)


def _again(group: str, case: Case, n: int, runs: int) -> Row:
    """A sweep over distances: theirs starts from the last answer."""
    peer = casadi_opti.Opti(case, n)
    first = [True]

    def sweep(solve: Callable[[float], float]) -> Callable[[], float]:
        places = iter(np.tile(case.distance * np.array([1.0, 0.99, 0.98, 0.97]), 100).tolist())
        return lambda: solve(next(places))

    def theirs(distance: float) -> float:
        warm, first[0] = not first[0], False
        return peer.solve(distance, warm=warm)

    row = Row(group, f"{case.name}, re-solved", n, "CasADi Opti, Ipopt")
    return compared(row, sweep(lambda d: ours(case.problem(n, d))), sweep(theirs), runs)


def convex(plan: Plan) -> Iterator[Row]:
    yield from single(plan, True)


def power(plan: Plan) -> Iterator[Row]:
    yield from single(plan, False)


def others(plan: Plan) -> Iterator[Row]:
    """rockit, and the paper's way: a Pyomo model anew for every weight."""
    n, runs = plan.small, max(plan.runs // 2, 1)
    jerk, mixture = CASES["jerk L2"].problem(n), CASES["energy and power Linf"].problem(n)
    row = Row("others", "jerk L2, cold", n, "rockit")
    yield compared(row, lambda: ours(jerk), lambda: rockit_ocp.least_jerk(n), runs)
    row = Row("others", "energy and power Linf, a weight", n, "Pyomo, Ipopt")
    yield compared(row, lambda: ours(mixture), lambda: pyomo_ipopt.mixture(0.5, 0.5, n), runs)


def front(plan: Plan) -> Iterator[Row]:
    """Fig. 7 of Clemen & Rupp: a front of 51 weights, by us in one sweep, the paper's way by a model for each."""
    n, count = plan.small, 51 if plan is FULL else 3
    problem = CASES["energy"].problem(n)
    weights = np.arange(1, count - 1) / (count - 1)

    def sweep() -> float:
        found = trajopt.pareto(problem, "energy,peak_power", points=count)
        if found.status is not trajopt.Verdict.SOLVED:
            raise ValueError(f"ours: {found.status.value}: {found.message}")
        return float(len(found.points) > 1)

    def by_hand() -> float:
        for w in (1e-3, *weights, 1 - 1e-3):
            pyomo_ipopt.mixture(float(w), float(1 - w), n)
        return 1.0

    row = Row("front", f"energy and peak power, {count} points", n, "Pyomo, Ipopt, a model a weight")
    yield compared(row, sweep, by_hand, max(plan.runs // 3, 1))


def mechanics(plan: Plan) -> Iterator[Row]:
    """What is nonlinear by itself: a throw (a start of ten, ours with the coarse mesh, the choice and the checks), a
    crank (ours from three starts) and a servomotor (ours with its optimum in continuous time)."""
    n, starts = plan.small, 10 if plan is FULL else 1
    runs = max(plan.runs // 3, 1)
    throw = trajopt.load("scara_throw", [f"transcription.intervals={n}", f"search.starts={starts}"])
    row = Row("mechanics", "SCARA throw, a start", n, "CasADi Opti, Ipopt")
    yield compared(row, partial(ours, throw), partial(casadi_mechanics.throw, throw), runs, parts=starts)
    crank = trajopt.load("slider_crank", [f"transcription.intervals={n}"])
    row = Row("mechanics", "crank, RMS torque", n, "CasADi Opti, Ipopt")
    yield compared(row, partial(ours, crank), partial(casadi_mechanics.crank, n), runs)
    motor = trajopt.load("servomotor_case_2", [f"transcription.intervals={n}"])
    row = Row("mechanics", "servomotor, electrical energy", n, "CasADi Opti, Ipopt")
    yield compared(row, partial(ours, motor), partial(casadi_mechanics.servomotor, motor, n), runs)


def studies(plan: Plan) -> Iterator[Row]:
    """What a study costs over the bare solves of its cases, and what a second worker saves."""
    count = 1000 if plan is FULL else 4
    try:
        found = study.measured(count)
    except ValueError as error:
        yield Row("studies", f"{count} small cases, one worker", 40, "the bare solves", note=f"void: {str(error)[:90]}")
        return
    ours_ms, bare_ms = 1e3 * found["workers_1"], 1e3 * found["bare"]
    note = f"two workers: {found['speed_up']:.2f} times as fast"
    yield Row("studies", f"{found['cases']} small cases, one worker", 40, "the bare solves", ours_ms, bare_ms,
              ours_ms / bare_ms, ours_ms / bare_ms, ours_ms / bare_ms, 1, note)  # fmt: skip


def least_time(plan: Plan) -> Iterator[Row]:
    """Minimum time of chains, against Ruckig where it knows them, and of the two-mass plant."""
    for name, problem in LEAST_TIMES.items():
        peer = ruckig_profile.least_time(problem)
        if peer is not None:
            row = Row("least time", name, 0, "Ruckig")
            yield compared(row, partial(ours, problem), peer, 3 * plan.runs, agree=1e-9)
        else:
            yield alone("least time", name, 0, problem, plan.runs)
    yield alone("least time", "two masses and a spring", 0, trajopt.load("two_masses_and_a_spring"), plan.runs)


def alone(group: str, name: str, n: int, problem: Any, runs: int) -> Row:
    """Ours without a peer. Raises ValueError where it is not solved."""
    found = trajopt.solve(problem)
    if not found.status.solved:
        raise ValueError(f"{name}: {found.status.value}, nothing to time")
    seconds = median(_timed(lambda: trajopt.solve(problem)) for _ in range(runs))
    return Row(group, name, n, "-", 1e3 * seconds, runs=runs)


def growth(plan: Plan) -> Iterator[Row]:
    """How cost and memory grow with the intervals: each size in a process of its own."""
    for case in (case for case in CASES.values() if case.convex):
        found = [processes.measured(case.name, n) for n in plan.growth]
        for n, run in zip(plan.growth, found, strict=True):
            note = f"{run['status']}, gap {run['gap']:.1e}, {run['kilobytes'] / n:.1f} kB an interval"
            yield Row("growth", case.name, n, "-", 1e3 * run["seconds"], runs=1, note=note)
        solved = [(n, run["seconds"]) for n, run in zip(plan.growth, found, strict=True) if run["status"] == "SOLVED"]
        size, cost = np.log(np.array(solved, dtype=float).reshape(-1, 2)).T
        slope = np.polyfit(size, cost, 1)[0] if len(solved) > 1 else np.nan
        note = f"{slope:.2f} over the {len(solved)} of {len(found)} that are solved"
        yield Row("growth", f"{case.name}, exponent", 0, "-", note=note)


def start_up(plan: Plan) -> Iterator[Row]:
    """Imports and the command line, from start to exit."""
    python = [sys.executable, "-c"]
    runs = max(plan.runs // 2, 1)
    row = Row("start-up", "import trajopt", 0, "import numpy")
    yield processes.compared(row, [*python, "import trajopt"], [*python, "import numpy"], runs)
    row = Row("start-up", "trajopt solve, N = 200", 0, "import cvxpy")
    command = [sys.executable, "-m", "trajopt", "solve", "clemen_rupp_jerk_l2", "--set", "move.end.position=0.32 m"]
    yield processes.compared(row, command, [*python, "import cvxpy"], runs)


GROUPS: Final[dict[str, Callable[[Plan], Iterator[Row]]]] = {
    "convex": convex,
    "power": power,
    "others": others,
    "front": front,
    "mechanics": mechanics,
    "studies": studies,
    "least-time": least_time,
    "growth": growth,
    "start-up": start_up,
}


def table(rows: list[Row]) -> str:
    """Markdown."""
    lines = ["| what | N | ours [ms] | peer | peer [ms] | ratio (quartiles) | |", "|---|---|---|---|---|---|---|"]
    for row in rows:
        ours_ms, peer_ms = ("" if x is None else f"{x:.4g}" for x in (row.ours_ms, row.peer_ms))
        ratio = "" if row.ratio is None else f"{row.ratio:.3g} ({row.low:.3g} to {row.high:.3g})"
        what, n = f"{row.group}: {row.case}", row.intervals or ""
        lines.append(f"| {what} | {n} | {ours_ms} | {row.peer} | {peer_ms} | {ratio} | {row.note} |")
    return "\n".join(lines)


def main() -> None:
    """Print the table, write the JSON."""
    parser = argparse.ArgumentParser(prog="python -m bench.run", description=__doc__)
    parser.add_argument("groups", nargs="*", choices=[[], *GROUPS], help="which groups (all)")
    parser.add_argument("--smoke", action="store_true", help="small meshes, one run each")
    parser.add_argument("--output", type=Path, help="a folder for bench.json")
    options = parser.parse_args()
    plan, rows = SMOKE if options.smoke else FULL, []
    print(table([]))
    for group in options.groups or GROUPS:
        for row in GROUPS[group](plan):
            rows.append(row)
            print(table([row]).splitlines()[-1], flush=True)
    if options.output is not None:
        options.output.mkdir(parents=True, exist_ok=True)
        (options.output / "bench.json").write_text(json.dumps([asdict(row) for row in rows], indent=1))


if __name__ == "__main__":
    main()
