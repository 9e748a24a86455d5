"""The frozen solution of a plant's problem: the command, its check, its certificate, and who found it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np

from trajopt.answer import Answer
from trajopt.plant.command import Command
from trajopt.plant.exponentials import Floats
from trajopt.plant.problem import PlantProblem
from trajopt.plant.simulate import response

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

_ROWS: Final = 401  # of a frame, besides the switches
_SAMPLES: Final = 21  # of the switching function, an arc of the result file


@dataclass(frozen=True, repr=False)
class PlantSolution(Answer):
    """What `trajopt.solve` returns for a plant. Without a checked command (``status.solved`` is False) it holds no
    numbers.

    ``objective`` and ``duration`` are the least time (s); ``metrics``: the number of switches and, of every oscillatory
    mode, frequency (Hz), damping ratio and residual vibration (per cent of all jumps in step); ``certificate``: lower
    bound, gap and what it bounds; ``audit``: report of the independent check; ``route``, ``timings`` (s), ``message``
    as for moves. ``command`` has ``switches`` (s) and ``levels``.
    """

    TABLE: ClassVar[str] = "command.csv"
    FORMAT: ClassVar[str] = "trajopt command 1"

    problem: PlantProblem
    command: Command | None = None

    def _found(self) -> Command:
        if self.command is None:
            raise self.refusal
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
        return super().to_dict() | {
            "structure": None if self.command is None else _structure(self.command),
            "command": None if self.command is None else _plain(self.command),
        }


    def _pictures(self) -> dict[str, Callable[[], Any]]:
        return {"command.png": lambda: self.plot()[0].figure, "vibration.png": lambda: self.plot_vibration().figure}


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
