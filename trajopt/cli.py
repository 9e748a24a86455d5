"""The command line: ``trajopt solve | study | pareto | profiles | identify | check | export | …``, and more."""

from __future__ import annotations

import io
import json
import os
import sys
import tempfile
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer
from typer.exceptions import TyperException

from trajopt.errors import BadInput, InternalError, TrajoptError
from trajopt.verdict import Verdict

if TYPE_CHECKING:
    from trajopt.axes.solution import AxesSolution

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help=("Servo trajectories by direct transcription: optimal, checked and certified."),
)

Source = Annotated[str, typer.Argument(metavar="FILE", help="a problem file, or the name of a ready-made problem")]
Overrides = Annotated[
    list[str], typer.Option("--set", metavar="KEY=VALUE", help='override a dotted key, e.g. move.end.position="0.3 m"')
]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object and nothing else")]


@app.command()
def solve(
    source: Source,
    overrides: Overrides = [],  # noqa: B006 (typer reads the default)
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="write CSV, JSON and PNG into this folder")
    ] = None,
    seconds: Annotated[float | None, typer.Option("--seconds", help="wall-time limit, s")] = None,
    tighten: Annotated[bool, typer.Option("--tighten", help="tighten the bound on power and energy")] = False,
    timings: Annotated[bool, typer.Option("--timings", help="say where the time went")] = False,
    animate: Annotated[bool, typer.Option("--animate", help="write the arm in motion as well, motion.gif")] = False,
    as_json: AsJson = False,
) -> None:
    """Solve a problem; exits 0 only with a checked answer."""
    from trajopt.worker import Apart

    _refuse_seconds(seconds)
    with Apart() as child:
        from trajopt import preflight, problem_file, report

        problem = problem_file.load(source, [*overrides, *(["transcription.tighten=true"] if tighten else [])])
        if animate and (output is None or getattr(problem, "arm", None) is None):
            missing = output is None
            need = "needs a folder to write into; give --output" if missing else "this problem has no arm to draw"
            raise BadInput(f"--animate: {need}")
        _make_folder(output)
        for warning in preflight.warnings(problem):
            print(f"warning: {warning}", file=sys.stderr)
        solution = child.solve(problem, seconds)
    written = solution.save(output) if output is not None else []
    if animate and solution.status.solved:
        written.append(cast("AxesSolution", solution).animate(cast(Path, output) / "motion.gif"))
    if as_json:
        compared = solution.comparison() if solution.status.solved else []
        print(json.dumps(solution.sealed(comparison=compared), allow_nan=False))
    else:
        report.print_solution(solution)
        if timings:
            report.print_timings(solution)
        for path in written:
            print(f"wrote {path}")
    raise typer.Exit(solution.status.exit_code)


@app.command()
def synchronise(
    sources: Annotated[list[str], typer.Argument(metavar="FILE...", help="a problem an axis")],
    output: Annotated[Path | None, typer.Option("-o", "--output", help="write a folder an axis into this one")] = None,
    seconds: Annotated[float | None, typer.Option("--seconds", help="wall-time limit of each solve, s")] = None,
    as_json: AsJson = False,
) -> None:
    """Move several axes together: the slowest sets the time, the others take the smoothest move within it."""
    from trajopt import problem_file
    from trajopt.axes.synchronise import synchronise as together
    from trajopt.worker import solve_apart

    _refuse_seconds(seconds)
    _make_folder(output)
    solutions = together([problem_file.load(source) for source in sources], seconds, solve_apart)
    if output is not None:
        for k, (source, solution) in enumerate(zip(sources, solutions, strict=True), start=1):
            solution.save(output / f"axis{k}_{Path(source).stem}")
    worst = max((solution.status for solution in solutions), key=lambda status: status.exit_code)
    if as_json:
        axes = [solution.to_dict() for solution in solutions]
        shared = max((s.duration for s in solutions if s.duration is not None), default=None)
        print(json.dumps({"status": worst.value, "duration": shared, "axes": axes}, allow_nan=False))
    else:
        from trajopt.report import print_solution

        for solution in solutions:
            print_solution(solution)
    raise typer.Exit(worst.exit_code)


@app.command()
def study(
    source: Annotated[str, typer.Argument(metavar="STUDY", help="a study file, or the name of a ready-made study")],
    output: Annotated[Path, typer.Option("-o", "--output", help="folder for the store and the table")],
    workers: Annotated[int, typer.Option("--workers", help="processes; 0: one a processor")] = 0,
    scheduler: Annotated[str | None, typer.Option("--scheduler", help="address of a Dask scheduler instead")] = None,
    seconds: Annotated[float, typer.Option("--seconds", help="wall-time limit of each case, s")] = 600.0,
    memory: Annotated[float, typer.Option("--memory", help="memory limit of each process, GiB")] = 4.0,
    trajectories: Annotated[bool, typer.Option("--trajectories", help="write the move of each case, too")] = False,
    keep_going: Annotated[bool, typer.Option("--keep-going", help="do without the cases that cannot be meant")] = False,
    resume: Annotated[bool, typer.Option("--resume/--fresh", help="go on, or solve everything again")] = True,
    retry: Annotated[bool, typer.Option("--retry", help="solve again what ended in LIMIT or CRASHED")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="more than 10,000 cases are meant")] = False,
    as_json: AsJson = False,
) -> None:
    """Solve a study's cases; run again, it resumes. Exits 0 when every case is solved."""
    from trajopt.study import command

    _refuse_seconds(seconds)
    options = command.options(workers, scheduler, seconds, memory, trajectories, not resume, retry)
    raise typer.Exit(command.run(source, output, options, keep_going, yes, as_json))


@app.command()
def pareto(
    source: Source,
    objectives: Annotated[
        str, typer.Option("--objectives", metavar="A,B[,C]", help="such as energy,peak_power or time,energy")
    ],
    points: Annotated[int | None, typer.Option("--points", help="so many points, evenly placed")] = None,
    error: Annotated[
        str | None, typer.Option("--error", metavar="SHARE", help="refine until known within, such as 0.5% (default)")
    ] = None,
    method: Annotated[str, typer.Option("--method", help="weights (eq. 26) or epsilon (ceilings)")] = "weights",
    output: Annotated[Path | None, typer.Option("-o", "--output", help="write the front into this folder")] = None,
    explore: Annotated[
        bool, typer.Option("--explore", help="write front.html as well, a page to click through the points")
    ] = False,
    workers: Annotated[int, typer.Option("--workers", help="processes that solve at once")] = 1,
    overrides: Overrides = [],  # noqa: B006 (typer reads the default)
    as_json: AsJson = False,
) -> None:
    """Trace the Pareto front between two or three objectives; exits 0 only when it is solved and known as asked."""
    from trajopt import problem_file
    from trajopt.fronts import command

    problem = problem_file.load(source, overrides)
    asked = {"points": points, "error": command.read_error(error), "method": method}
    search = command.ready(problem, objectives, workers, asked)
    if explore and output is None:
        raise BadInput("--explore: needs a folder to write into; give --output")
    _make_folder(output)
    front = command.run(search, workers, output)
    if explore and output is not None and front.points:
        front.explore().save(output / "front.html")
    if as_json:
        print(json.dumps(front.sealed(), allow_nan=False))
    else:
        command.print_front(front)
        if output is not None:
            print(f"wrote {output}")
    raise typer.Exit(front.status.exit_code)


@app.command()
def profiles(
    source: Source,
    overrides: Overrides = [],  # noqa: B006
    degree: Annotated[list[int], typer.Option("--degree", help="of a Chebyshev profile; may be given again")] = [9],  # noqa: B006
    ends: Annotated[str, typer.Option("--ends", help="JF: jerk free at the ends, J0: zero there")] = "JF",
    box: Annotated[bool, typer.Option("--box", help="search the whole box of coefficients, too")] = False,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="write CSV, JSON and PNG into this folder")
    ] = None,
    seconds: Annotated[float | None, typer.Option("--seconds", help="wall-time limit of the free profile, s")] = None,
    as_json: AsJson = False,
) -> None:
    """Compare the profiles that drives offer, and Chebyshev profiles, with the best possible move."""
    from trajopt import problem_file
    from trajopt.problem import Problem
    from trajopt.profiles import compare_profiles
    from trajopt.worker import solve_apart

    _refuse_seconds(seconds)
    problem = problem_file.load(source, overrides)
    if not isinstance(problem, Problem):
        raise BadInput(f"{source}: profiles are laid on a [move], and this is a [plant]")
    _make_folder(output)
    wanted: Any = ends
    found = compare_profiles(problem, degree, wanted, box, lambda free: solve_apart(free, seconds))
    written = found.save(output) if output is not None else []
    if as_json:
        print(json.dumps(found.to_dict(), allow_nan=False))
    else:
        print("\n".join([*found.sentences(), *(f"wrote {path}" for path in written)]))
    raise typer.Exit(found.best.status.exit_code)


@app.command()
def identify(
    motions: Annotated[
        list[Path], typer.Argument(metavar="CSV...", help="motions: time, position, torque, with units")
    ],
    friction: Annotated[
        Path | None, typer.Option("--friction", help="a measured motion, for the viscous friction")
    ] = None,
    rows: Annotated[int, typer.Option("--rows", help="of the table to write")] = 181,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="write load.csv and more into this folder")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find the inertia and the load torque over position from motions, and the friction from a measured one."""
    from trajopt.identification import identify as find

    _make_folder(output)
    found = find(motions, friction, rows)
    written = found.save(output) if output is not None else []
    if as_json:
        print(json.dumps(found.to_dict(), allow_nan=False))
    else:
        print("\n".join([*found.sentences(), *(f"wrote {path}" for path in written)]))


@app.command()
def route(source: Source, overrides: Overrides = [], as_json: AsJson = False) -> None:  # noqa: B006
    """Say which model and solver would take a problem, and why, without solving it."""
    from trajopt import problem_file, routing

    chosen = routing.route(problem_file.load(source, overrides))
    print(json.dumps(chosen.to_dict()) if as_json else f"{chosen.model} with {chosen.solver}: {chosen.reason}")


@app.command()
def check(
    result: Annotated[Path, typer.Argument(help="a result.json, or a front.json")],
    problem: Annotated[str | None, typer.Option("--problem", help="the problem it must belong to")] = None,
    strict: Annotated[bool, typer.Option("--strict", help="limits to 1e-9, in rational arithmetic")] = False,
    as_json: AsJson = False,
) -> None:
    """Check a written result without the optimiser; exits 0 when it passes."""
    from trajopt import checker

    stated = None
    if problem is not None:
        from trajopt import problem_file

        stated = problem_file.load(problem).canonical()
    try:
        report = checker.check_file(result, stated, strict=strict)
    except checker.CheckerInputError as error:
        raise BadInput(str(error)) from None
    print(json.dumps(report.to_dict()) if as_json else report.summary())
    raise typer.Exit(0 if report.passed else 3)


@app.command()
def export(
    result: Annotated[Path, typer.Argument(help="a result.json, or the folder of one")],
    to: Annotated[str, typer.Option("--to", help="csv, ros, pvt, cam, plcopen, mat, setpoints or a dialect's name")],
    output: Annotated[Path, typer.Option("-o", "--output", help="the file to write")],
    dialect: Annotated[str | None, typer.Option("--dialect", help="of pvt, cam or plcopen")] = None,
    cycle: Annotated[str | None, typer.Option("--cycle", help='a point every "1 ms"; else at the nodes')] = None,
    resolution: Annotated[
        str | None, typer.Option("--resolution", help='of the encoder: "0.1 um" or "10000 counts/mm"')
    ] = None,
    drive_cycle: Annotated[
        str | None, typer.Option("--drive-cycle", help="of the drive, where it interpolates finer than the points")
    ] = None,
    interpolation: Annotated[
        str | None, typer.Option("--interpolation", help="hold, linear, cubic, quintic or spline, if not the usual one")
    ] = None,
    name: Annotated[str, typer.Option("--name", help="of the axis, in the file")] = "axis",
    allow: Annotated[bool, typer.Option("--allow", help="leave a file that breaks limits on the machine")] = False,
    as_json: AsJson = False,
) -> None:
    """Write a checked result for a drive or controller, verified as that will interpolate it."""
    from trajopt import stored
    from trajopt.export import Refused
    from trajopt.export.printing import print_report

    solution, refused = stored.read_result(result), False
    try:
        report = solution.export(
            output, to, dialect=dialect, cycle=cycle, resolution=resolution, drive_cycle=drive_cycle,
            interpolation=interpolation, name=name, allow=allow,
        )  # fmt: skip
    except Refused as refusal:
        report, refused = refusal.report, True
    if as_json:
        print(json.dumps(report.to_dict(), allow_nan=False))
    else:
        print_report(report)
    for message in report.messages:
        print(f"{'refused' if refused else 'warning'}: {message}", file=sys.stderr)
    raise typer.Exit(3 if refused else 0)


@app.command()
def plot(
    results: Annotated[list[Path], typer.Argument(metavar="RESULT...", help="result.json files, or their folders")],
    output: Annotated[Path, typer.Option("-o", "--output", help="the picture: .png, .pdf or .svg")],
    kind: Annotated[
        str | None,
        typer.Option("--kind", help="trajectory, compare, prices, arcs, vibration or torque-speed"),
    ] = None,
    labels: Annotated[list[str], typer.Option("--label", help="a name for each, in a comparison")] = [],  # noqa: B006
) -> None:
    """Draw written results again: one, or several in comparison."""
    from trajopt.plots.redraw import redraw

    redraw(results, output, kind, labels)
    print(f"wrote {output}")


@app.command()
def problems(as_json: AsJson = False) -> None:
    """List the ready-made problems."""
    from trajopt import problem_file

    known = {name: problem_file.load(path) for name, path in problem_file.ready_made().items()}
    if as_json:
        print(json.dumps({name: {"title": p.title, "source": p.source, "moral": p.moral} for name, p in known.items()}))
        return
    width = max(len(name) for name in known)
    for name, p in known.items():
        print(f"{name:{width}}  {p.title}")


def _make_folder(output: Path | None) -> None:
    """Make the output folder and see that it can be written, before anything is solved for it. Raises OSError."""
    if output is None:
        return
    output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=output):
        pass


def _refuse_seconds(seconds: float | None) -> None:
    if seconds is not None and not 0.1 <= seconds <= 1e6:
        raise BadInput(f"--seconds must be 0.1 to 1e6, got {seconds:g}")


def main(arguments: list[str] | None = None) -> None:
    """Run the command line. Every failure is one line on stderr, and an exit code (see `trajopt.verdict`)."""
    words = sys.argv[1:] if arguments is None else arguments
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal without these letters shows others
            stream.reconfigure(errors="replace")
    try:
        code = app(args=words, prog_name="trajopt", standalone_mode=False)
        sys.stdout.flush()
    except (KeyboardInterrupt, typer.Abort):
        _fail("INTERRUPTED", "stopped by the user", 130, words)
    except TyperException as error:
        usage = error.format_message() if hasattr(error, "format_message") else str(error)
        _fail("BAD_INPUT", f"{usage} (see trajopt --help)", 2, words)
    except InternalError as error:
        _fail("CRASHED", f"a bug in trajopt: {error}; the traceback is in {_keep(error)}", 70, words)
    except TrajoptError as error:
        _fail("BAD_INPUT" if error.exit_code == 2 else "UNDECIDED", str(error), error.exit_code, words)
    except OSError as error:
        if error.filename is None:  # standard output is gone or full: nothing more can be said there
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        _fail("UNDECIDED", f"{error.filename or 'standard output'}: {error.strerror or error}", 4, words)
    except Exception as error:
        _fail("CRASHED", f"a bug in trajopt: {error!r}; the traceback is in {_keep(error)}", 70, words)
    else:
        if code == Verdict.INTERRUPTED.exit_code:  # typer turns Ctrl-C into this
            _fail("INTERRUPTED", "stopped by the user", code, words)
        sys.exit(code if isinstance(code, int) else 0)


def _fail(status: str, message: str, code: int, words: list[str]) -> None:
    print(f"trajopt: {' '.join(message.split())}", file=sys.stderr)
    if "--json" in words:
        print(json.dumps({"status": status, "message": message}))
    sys.stdout.flush()
    sys.exit(code)


def _keep(error: BaseException) -> str:
    handle, path = tempfile.mkstemp(prefix="trajopt-bug-", suffix=".txt")
    with os.fdopen(handle, "w") as file:
        notes: list[Any] = getattr(error, "__notes__", [])
        file.write("".join([*traceback.format_exception(error), *map(str, notes)]))
    return path
