"""The frozen solution: plain floats, their check, their certificate, and who found them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trajopt.errors import NoSolution
from trajopt.files import write_atomically
from trajopt.problem import Problem
from trajopt.routing import Route
from trajopt.trajectory import Trajectory
from trajopt.verdict import Verdict

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from trajopt.export import Report

FORMAT = "trajopt result 1"


class Frozen(dict[str, Any]):
    """A mapping that is not changed once made."""

    def _refuse(self, *_: Any, **__: Any) -> Any:
        raise TypeError("a solution is frozen; copy it to a dict first")

    __setitem__ = __delitem__ = update = pop = popitem = clear = setdefault = __ior__ = _refuse

    def __reduce__(self) -> Any:
        return Frozen, (dict(self),)


@dataclass(frozen=True)
class Solution:
    """What `trajopt.solve` returns. Without a checked trajectory (``status.solved`` is False) it holds no numbers.

    ``objective`` SI; ``duration`` s; ``metrics`` SI by name; ``certificate``: lower bound, gap and what it bounds;
    ``audit``: report of the independent check; ``prices``: what each limit costs (see `trajopt.prices`);
    ``structure``: the arcs of a minimum time (see `trajopt.switching_times`); ``explanation`` of an impossible move
    (see `trajopt.explain`); ``route``: model, solver, reason; ``timings`` s.
    """

    status: Verdict
    problem: Problem
    route: Route
    objective: float | None = None
    duration: float | None = None
    metrics: Mapping[str, float] = field(default_factory=dict)
    certificate: Mapping[str, Any] = field(default_factory=dict)
    audit: Mapping[str, Any] = field(default_factory=dict)
    explanation: Mapping[str, Any] = field(default_factory=dict)
    prices: Sequence[Mapping[str, Any]] = ()
    structure: Mapping[str, Any] = field(default_factory=dict)
    timings: Mapping[str, float] = field(default_factory=dict)
    trajectory: Trajectory | None = None
    message: str = ""

    def __post_init__(self) -> None:
        for name in ("metrics", "certificate", "audit", "explanation", "structure", "timings"):
            object.__setattr__(self, name, Frozen(getattr(self, name)))
        object.__setattr__(self, "prices", tuple(Frozen(row) for row in self.prices))

    def _moved(self) -> Trajectory:
        if self.trajectory is None:
            raise NoSolution(f"{self.status.value}: {self.message or self.status.advice}")
        return self.trajectory

    @property
    def frame(self) -> pd.DataFrame:
        """One row a node: time (s), position, velocity, … (m or rad, and per s), force (N, N m), power (W), and with a
        motor current (A), voltage (V) and electrical power (W).

        The top derivative is the value on the interval that starts at the node; the last row repeats it (exact) or
        is 0 (euler). ``frame.attrs["units"]`` names the unit of each column. Raises NoSolution.
        """
        from trajopt.table import frame

        return frame(self._moved())

    def csv(self) -> str:
        """The text of trajectory.csv. Raises NoSolution."""
        from trajopt.table import csv

        return csv(self)

    def sampled(self, period: float) -> pd.DataFrame:
        """The set-points of a controller: time (s), position, velocity, … at every ``period`` (s) and at the end.

        They are values of the move itself, so that all limits hold at them. Raises NoSolution, and ValueError for a
        period that is not positive or longer than the move.
        """
        import numpy as np
        import pandas as pd

        duration = self._moved().duration
        if not 0 < period <= duration:
            raise ValueError(f"period: must be > 0 and at most the duration of {duration:g} s, got {period!r}")
        count = int(duration / period * (1 + 1e-12))
        time = np.minimum(period * np.arange(count + 1), duration)
        time = time if duration - time[-1] <= 1e-9 * period else np.append(time, duration)
        return pd.DataFrame({"time": time, **self.at(time)})

    def at(self, t: Any) -> dict[str, Any]:
        """Position and its derivatives at times ``t`` (s), by the exact interpolant. Raises NoSolution, ValueError."""
        return self._moved().at(t)

    def plot(self) -> list[Axes]:
        """Stacked axes of position, velocity, …, power, current with their limits (see `trajopt.plot`). Raises
        NoSolution."""
        from trajopt.plot import plot

        self._moved()
        return plot(self)

    def plot_prices(self) -> Axes:
        """Bars of what each limit, and the time, costs (see `prices`). Raises NoSolution."""
        from trajopt.plot import plot_prices

        return plot_prices(self)

    def comparison(self) -> list[dict[str, Any]]:
        """What the optimum saves against trapezoid, S-curve and quintic of the same duration, where a load pays for the
        objective; see `trajopt.comparison`. Raises NoSolution."""
        from trajopt.comparison import compare_with_profiles

        self._moved()
        assert self.objective is not None
        return compare_with_profiles(self.problem, self.objective)

    def residual_vibration(self, frequency: Any, damping: float = 0.0) -> Any:
        """The amplitude (m or rad) left in modes of natural frequencies in Hz and a damping ratio that hang on the
        axis; the shape of ``frequency``, one-dimensional. Raises NoSolution."""
        from trajopt.vibration import residual

        return residual(self._moved(), frequency, damping)

    def plot_vibration(self, frequency: Any = None, damping: float | None = None) -> Axes:
        """Residual vibration over the frequency of a mode; see `trajopt.plot.plot_vibration`. Raises NoSolution."""
        from trajopt.plot import plot_vibration

        return plot_vibration(self, frequency, damping)

    def plot_torque_speed(self) -> Axes:
        """The path in the torque-speed plane, within its limits (see `trajopt.plot_plane`). Raises NoSolution, and
        BadInput without a load."""
        from trajopt.plot_plane import plot_torque_speed

        return plot_torque_speed(self)

    def plot_arcs(self) -> list[Axes]:
        """When a minimum-time move runs on which limit (see `trajopt.plot_arcs`). Raises NoSolution."""
        from trajopt.plot_arcs import plot_arcs

        return plot_arcs(self)

    def export(self, path: str | Path, to: str, **options: Any) -> Report:
        """Write the move for a drive or controller, verified as the target interpolates it; the formats and options are
        those of `trajopt.export.export`. Raises NoSolution, BadInput, trajopt.export.Refused, OSError."""
        from trajopt.export import export

        return export(self, path, to, **options)

    def to_dict(self) -> dict[str, Any]:
        """The result file's content: plain JSON data, numbers null where there is no solution."""
        problem = self.problem.canonical()
        return {
            "format": FORMAT,
            "trajopt": _version(),
            "status": self.status.value,
            "message": self.message,
            "objective": self.objective,
            "duration": self.duration,
            "metrics": dict(self.metrics) or None,
            "certificate": dict(self.certificate) or None,
            "audit": dict(self.audit) or None,
            "explanation": dict(self.explanation) or None,
            "prices": [dict(price) for price in self.prices],
            "structure": dict(self.structure) or None,
            "route": self.route.to_dict(),
            "timings": dict(self.timings),
            "problem_hash": self.problem.hash,
            "problem": problem,
            "trajectory": None if self.trajectory is None else self.trajectory.to_dict(),
        }

    def sealed(self, **extra: Any) -> dict[str, Any]:
        """`to_dict` with ``extra`` entries and a seal, the SHA-256 of all of it, by which the checker sees an edit."""
        return seal(self.to_dict() | extra)

    def save(self, directory: str | Path) -> list[Path]:
        """Write result.json, trajectory.csv, trajectory.png, prices.png and, where there is something to show, arcs.png
        and vibration.png into ``directory``; returns the paths.

        Without a solution only result.json is written. Raises OSError.
        """
        directory = Path(directory)
        directory.mkdir(parents=True, exist_ok=True)
        pictures: dict[str, Callable[[], Any]] = {
            "trajectory.png": lambda: self.plot()[0],
            "prices.png": self.plot_prices,
            "vibration.png": self.plot_vibration,
            "arcs.png": lambda: self.plot_arcs()[0],
        }
        for stale in pictures:  # of another answer
            (directory / stale).unlink(missing_ok=True)
        written = self.save_data(directory)
        if self.trajectory is None:
            return written
        if not self.problem.vibration:
            del pictures["vibration.png"]
        if self.route.model != "arcs":
            del pictures["arcs.png"]
        for name, draw in pictures.items():
            figure: Any = draw().figure
            figure.savefig(directory / name, dpi=150)
            written.append(directory / name)
        return written

    def save_data(self, directory: Path) -> list[Path]:
        """Write result.json and, with a solution, trajectory.csv into ``directory``; returns the paths. Raises
        OSError."""
        directory.mkdir(parents=True, exist_ok=True)
        written = [directory / "result.json", directory / "trajectory.csv"]
        written[1].unlink(missing_ok=True)
        write_atomically(written[0], json.dumps(self.sealed(), indent=1, allow_nan=False).encode())
        if self.trajectory is None:
            return written[:1]
        write_atomically(written[1], self.csv().encode())
        return written

    def __repr__(self) -> str:
        value = "" if self.objective is None else f", objective={self.objective:.9g}, duration={self.duration:.9g}"
        return f"<Solution {self.status.value}{value}>"


def seal(data: dict[str, Any]) -> dict[str, Any]:
    """The content of a result file with its seal."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return data | {"seal": hashlib.sha256(text.encode()).hexdigest()}


def _version() -> str:
    from trajopt import __version__

    return __version__
