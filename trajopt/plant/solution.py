"""The frozen solution of a plant's problem: the command, its check, its certificate, and who found it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from trajopt.errors import NoSolution
from trajopt.files import write_atomically
from trajopt.plant.command import Command
from trajopt.plant.exponentials import Floats
from trajopt.plant.problem import PlantProblem
from trajopt.plant.simulate import response
from trajopt.routing import Route
from trajopt.solution import Frozen, seal
from trajopt.verdict import Verdict

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

FORMAT: Final = "trajopt command 1"
_ROWS: Final = 401  # of a frame, besides the switches
_SAMPLES: Final = 21  # of the switching function, an arc of the result file


@dataclass(frozen=True)
class PlantSolution:
    """What `trajopt.solve` returns for a plant. Without a checked command (``status.solved`` is False) it holds no
    numbers.

    ``objective`` and ``duration`` are the least time (s); ``metrics``: the number of switches and, of every oscillatory
    mode, frequency (Hz), damping ratio and residual vibration (per cent of all jumps in step); ``certificate``: lower
    bound, gap and what it bounds; ``audit``: report of the independent check; ``route``, ``timings`` (s), ``message``
    as for moves. ``command`` has ``switches`` (s) and ``levels``.
    """

    status: Verdict
    problem: PlantProblem
    route: Route
    objective: float | None = None
    duration: float | None = None
    metrics: Mapping[str, float] = field(default_factory=dict)
    certificate: Mapping[str, Any] = field(default_factory=dict)
    audit: Mapping[str, Any] = field(default_factory=dict)
    timings: Mapping[str, float] = field(default_factory=dict)
    command: Command | None = None
    message: str = ""

    def __post_init__(self) -> None:
        for name in ("metrics", "certificate", "audit", "timings"):
            object.__setattr__(self, name, Frozen(getattr(self, name)))

    def _found(self) -> Command:
        if self.command is None:
            raise NoSolution(f"{self.status.value}: {self.message or self.status.advice}")
        return self.command

    @property
    def frame(self) -> pd.DataFrame:
        """One row a time (s) on a grid that holds the switches: input from that time on, output, and the switching
        function sigma, which is positive where the input is the largest. Raises NoSolution."""
        import pandas as pd

        command = self._found()
        grid = np.linspace(0.0, command.duration, _ROWS)
        apart = np.min(np.abs(grid[:, None] - np.array([*command.switches, np.inf])), axis=1) > 1e-9 * command.duration
        table = pd.DataFrame(self.at(np.sort([*grid[apart], *command.switches])))
        table.attrs["units"] = {"time": "s"}
        return table

    def at(self, t: Any) -> dict[str, Any]:
        """time, input (from then on), output and sigma at times ``t`` (s) from 0, also after the command, where sigma
        has no meaning and is NaN; the shape of ``t``. Raises NoSolution, ValueError."""
        command, time = self._found(), np.asarray(t, float)
        starts, levels = command.impulses[0], np.array([*command.levels, command.u_ss])
        output = response(self.problem.plant.model, command, time.ravel()).reshape(time.shape)
        after = time > command.duration
        sigma = np.where(after, np.nan, command.sigma(np.where(after, 0.0, time)))
        which = np.searchsorted(starts, time, side="right") - 1
        return {"time": time, "input": levels[which], "output": output, "sigma": sigma}

    def residual_vibration(self, frequency: Any, damping: float = 0.0) -> Floats:
        """What a mode of undamped frequency (Hz, any shape) and damping ratio keeps, in per cent of what all jumps of
        the input would leave in step. Raises NoSolution."""
        return self._found().residual_vibration(2 * pi * np.asarray(frequency, float), damping)

    def plot(self) -> list[Axes]:
        """Stacked axes of input, output and switching function. Raises NoSolution."""
        from trajopt.plant.plot import plot

        return plot(self)

    def plot_vibration(self, frequency: Any = None, damping: float | None = None) -> Axes:
        """Residual vibration over the frequency (Hz) of a mode; see `trajopt.plant.plot`. Raises NoSolution."""
        from trajopt.plant.plot import plot_vibration

        return plot_vibration(self, frequency, damping)

    def comparison(self) -> list[dict[str, Any]]:
        """Empty: no profile of a drive is meant for a plant of any poles. Raises NoSolution."""
        self._found()
        return []

    def csv(self) -> str:
        """The text of command.csv: times of the jumps and the level from each on. Raises NoSolution."""
        command = self._found()
        rows = zip(command.impulses[0], [*command.levels, command.u_ss], strict=True)
        lines = [f"# trajopt {self.problem.hash}", "t [s],u", *(f"{t:.17g},{u:.17g}" for t, u in rows)]
        return "\n".join(lines) + "\n"

    def to_dict(self) -> dict[str, Any]:
        """The result file's content: plain JSON data with the keys of a move's; numbers null without a solution."""
        from trajopt import __version__

        return {
            "format": FORMAT,
            "trajopt": __version__,
            "status": self.status.value,
            "message": self.message,
            "objective": self.objective,
            "duration": self.duration,
            "metrics": dict(self.metrics) or None,
            "certificate": dict(self.certificate) or None,
            "audit": dict(self.audit) or None,
            "explanation": None,
            "prices": [],
            "structure": None if self.command is None else _structure(self.command),
            "route": self.route.to_dict(),
            "timings": dict(self.timings),
            "problem_hash": self.problem.hash,
            "problem": self.problem.canonical(),
            "trajectory": None,
            "command": None if self.command is None else _plain(self.command),
        }

    def sealed(self, **extra: Any) -> dict[str, Any]:
        """`to_dict` with ``extra`` entries and a seal, the SHA-256 of all of it, by which the checker sees an edit."""
        return seal(self.to_dict() | extra)

    def save(self, directory: str | Path) -> list[Path]:
        """Write result.json, command.csv (17 digits), command.png and vibration.png into ``directory``; returns the
        paths. Without a solution only result.json is written. Raises OSError."""
        directory = Path(directory)
        directory.mkdir(parents=True, exist_ok=True)
        pictures: dict[str, Callable[[], Any]] = {
            "command.png": lambda: self.plot()[0],
            "vibration.png": self.plot_vibration,
        }
        for stale in ("command.csv", "trajectory.csv", "trajectory.png", "prices.png", *pictures):  # of another answer
            (directory / stale).unlink(missing_ok=True)
        written = [directory / "result.json"]
        write_atomically(written[0], json.dumps(self.sealed(), indent=1, allow_nan=False).encode())
        if self.command is None:
            return written
        written.append(directory / "command.csv")
        write_atomically(written[-1], self.csv().encode())
        for name, draw in pictures.items():
            figure: Any = draw().figure
            figure.savefig(directory / name, dpi=150)
            written.append(directory / name)
        return written

    def __repr__(self) -> str:
        value = "" if self.duration is None else f", duration={self.duration:.9g}"
        return f"<PlantSolution {self.status.value}{value}>"


def _structure(command: Command) -> dict[str, Any]:
    """The arcs, as for moves."""
    ends = command.impulses[0]
    names = {command.umin: "input.min", command.umax: "input.max"}
    rows = zip(ends, ends[1:], command.levels, strict=False)
    return {"arcs": [{"from": float(a), "to": float(b), "limit": names[u], "top": u} for a, b, u in rows]}


def _plain(command: Command) -> dict[str, Any]:
    """The command for the result file: times of its jumps, the last its end; levels between; samples of sigma."""
    ends = command.impulses[0]
    shares = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    samples = (ends[:-1, None] + np.diff(ends)[:, None] * shares).ravel()
    return {
        "times": ends.tolist(),
        "levels": list(command.levels),
        "final_input": command.u_ss,
        "sigma": {"time": samples.tolist(), "value": command.sigma(samples).tolist()},
    }
