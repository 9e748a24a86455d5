"""The frozen solution: plain floats, their check, their certificate, and who found them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from trajopt.answer import Answer, Frozen
from trajopt.problem import Problem
from trajopt.trajectory import Trajectory

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from trajopt.export import Report


@dataclass(frozen=True, repr=False)
class Solution(Answer):
    """What `trajopt.solve` returns. Without a checked trajectory (``status.solved`` is False) it holds no numbers.

    See `trajopt.answer.Answer`; ``prices``: what each limit costs (see `trajopt.prices`); ``structure``: the arcs of a
    minimum time (see `trajopt.switching_times`); ``explanation`` of an impossible move (see `trajopt.explain`).
    """

    FORMAT: ClassVar[str] = "trajopt result 1"

    problem: Problem
    prices: Sequence[Mapping[str, Any]] = ()
    structure: Mapping[str, Any] = field(default_factory=dict)
    trajectory: Trajectory | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "structure", Frozen(self.structure))
        object.__setattr__(self, "prices", tuple(Frozen(row) for row in self.prices))

    def _moved(self) -> Trajectory:
        if self.trajectory is None:
            raise self.refusal
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
        """Stacked axes of position, velocity, …, power, current with their limits (see `trajopt.plots.trajectories`).
        Raises NoSolution."""
        from trajopt.plots.trajectories import plot

        self._moved()
        return plot(self)

    def plot_prices(self) -> Axes:
        """Bars of what each limit, and the time, costs (see `prices`). Raises NoSolution."""
        from trajopt.plots.trajectories import plot_prices

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
        """Residual vibration over the frequency of a mode; see `trajopt.plots.trajectories`. Raises NoSolution."""
        from trajopt.plots.trajectories import plot_vibration

        return plot_vibration(self, frequency, damping)

    def plot_torque_speed(self) -> Axes:
        """The path in the torque-speed plane, within its limits (see `trajopt.plots.plane`). Raises NoSolution, and
        BadInput without a load."""
        from trajopt.plots.plane import plot_torque_speed

        return plot_torque_speed(self)

    def plot_arcs(self) -> list[Axes]:
        """When a minimum-time move runs on which limit (see `trajopt.plots.arcs`). Raises NoSolution."""
        from trajopt.plots.arcs import plot_arcs

        return plot_arcs(self)

    def export(self, path: str | Path, to: str, **options: Any) -> Report:
        """Write the move for a drive or controller, verified as the target interpolates it; the formats and options are
        those of `trajopt.export.export`. Raises NoSolution, BadInput, trajopt.export.Refused, OSError."""
        from trajopt.export import export

        return export(self, path, to, **options)

    def to_dict(self) -> dict[str, Any]:
        """The result file's content: plain JSON data, numbers null where there is no solution."""
        return super().to_dict() | {
            "prices": [dict(price) for price in self.prices],
            "structure": dict(self.structure) or None,
            "trajectory": None if self.trajectory is None else self.trajectory.to_dict(),
        }

    def _pictures(self) -> dict[str, Callable[[], Any]]:
        """trajectory.png, prices.png and, where there is something to show, arcs.png and vibration.png."""
        pictures: dict[str, Callable[[], Any]] = {
            "trajectory.png": lambda: self.plot()[0].figure,
            "prices.png": lambda: self.plot_prices().figure,
        }
        if self.problem.vibration:
            pictures["vibration.png"] = lambda: self.plot_vibration().figure
        if self.route.model == "arcs":
            pictures["arcs.png"] = lambda: self.plot_arcs()[0].figure
        return pictures
