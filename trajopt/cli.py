"""The command line: ``trajopt solve | synchronise | check | route | problems``."""

from __future__ import annotations

import io
import json
import os
import sys
import tempfile
import traceback
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.exceptions import TyperException

from trajopt.errors import BadInput, InternalError, TrajoptError
from trajopt.verdict import Verdict

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
    as_json: AsJson = False,
) -> None:
    """Solve a problem; exits 0 only with a checked answer."""
    from trajopt import preflight, problem_file
    from trajopt.worker import solve_apart

    _refuse_seconds(seconds)
    problem = problem_file.load(source, [*overrides, *(["transcription.tighten=true"] if tighten else [])])
    _make_folder(output)
    for warning in preflight.warnings(problem):
        print(f"warning: {warning}", file=sys.stderr)
    solution = solve_apart(problem, seconds)
    written = solution.save(output) if output is not None else []
    if as_json:
        compared = solution.comparison() if solution.status.solved else []
        print(json.dumps(solution.sealed(comparison=compared), allow_nan=False))
    else:
        from trajopt.report import print_solution, print_timings

        print_solution(solution)
        if timings:
            print_timings(solution)
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
    from trajopt.axes import synchronise as together
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
def route(source: Source, overrides: Overrides = [], as_json: AsJson = False) -> None:  # noqa: B006
    """Say which model and solver would take a problem, and why, without solving it."""
    from trajopt import problem_file, routing

    chosen = routing.route(problem_file.load(source, overrides))
    print(json.dumps(chosen.to_dict()) if as_json else f"{chosen.model} with {chosen.solver}: {chosen.reason}")


@app.command()
def check(
    result: Annotated[Path, typer.Argument(help="a result.json")],
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
