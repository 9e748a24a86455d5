"""The frozen solution of a problem of several axes: the motion, its check, its certificate, and who found it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from trajopt.answer import Answer
from trajopt.axes.arm import ArmSection
from trajopt.axes.dynamics import pictures as known_pictures
from trajopt.axes.motion import Motion
from trajopt.axes.problem import AxesProblem

if TYPE_CHECKING:
    import pandas as pd

    from trajopt.plots.trajectories import Panels


@dataclass(frozen=True, repr=False)
class AxesSolution(Answer):
    """What `trajopt.solve` returns for several axes. Without a checked motion (``status.solved`` is False) it holds no
    numbers.

    ``metrics`` by axis: ``shoulder.peak_power``; ``certificate`` of coupled axes: how many of the ``starts`` were
    ``feasible``, the ``optima`` they led to on the coarse mesh, how many are ``distinct``, and their ``spread``.
    """

    FORMAT: ClassVar[str] = "trajopt axes 1"

    problem: AxesProblem
    motion: Motion | None = None

    def moved(self) -> Motion:
        """The motion. Raises NoSolution."""
        if self.motion is None:
            raise self.refusal
        return self.motion

    @property
    def frame(self) -> pd.DataFrame:
        """One row a node of any axis: time (s), and of every axis ``name.position``, ``name.velocity``, … with force
        and power where there is a load, and the tip's x, y, vx, vy where there is an arm that knows it.
        ``frame.attrs["units"]`` names the units. Raises NoSolution."""
        from trajopt.axes.table import frame

        return frame(self.moved())

    def at(self, t: Any) -> dict[str, Any]:
        """By axis, position and its derivatives at times ``t`` (s), exactly. Raises NoSolution, ValueError."""
        return self.moved().at(t)

    def plot(self) -> Panels:
        """Stacked panels of all axes with their limits, a colour an axis (see `trajopt.axes.plot`). Raises
        NoSolution."""
        from trajopt.axes.plot import plot

        return plot(self)

    def animate(self, path: str | Path, frames: int = 60, slower: float = 3.0) -> Path:
        """Write the arm in motion as a GIF, ``slower`` than it is; returns the path.

        Raises NoSolution, OSError, and BadInput without an arm of links.
        """
        found: Path = known_pictures().animate(self, path, frames, slower)
        return found

    def comparison(self) -> list[dict[str, Any]]:
        """Empty: no profile of a drive is meant for several axes at once. Raises NoSolution."""
        self.moved()
        return []

    def to_dict(self) -> dict[str, Any]:
        """The result file's content: plain JSON data with the keys of a move's; numbers null without a solution."""
        return super().to_dict() | {
            "axes": None if self.motion is None else _plain(self.motion),
            "release": None if self.motion is None else self.motion.release,
        }

    def csv(self) -> str:
        """The text of trajectory.csv: the frame with 17 digits. Raises NoSolution."""
        table = self.frame
        header = ",".join(f"{name} [{unit}]" for name, unit in table.attrs["units"].items())
        rows = [",".join(f"{x:.17g}" for x in row) for row in table.to_numpy()]
        return "\n".join([f"# trajopt {self.problem.hash}", header, *rows]) + "\n"

    def _pictures(self) -> dict[str, Callable[[], Any]]:
        pictures: dict[str, Callable[[], Any]] = {"motion.png": lambda: self.plot().figure}
        if isinstance(self.problem.arm, ArmSection):
            draw = known_pictures()
            pictures |= {"poses.png": lambda: draw.poses(self).figure, "tip.png": lambda: draw.tips(self).figure}
        return pictures


def _plain(motion: Motion) -> list[dict[str, Any]]:
    """The trajectories for the result file; of an arm of the user's own also its torques at the nodes."""
    found: list[dict[str, Any]] = []
    own = isinstance(motion.problem.canonical().get("arm", {}).get("name"), str)
    for axis, trajectory in zip(motion.problem.axes, motion.axes, strict=True):
        plain = {"name": axis.name, "trajectory": trajectory.to_dict()}
        nodes = trajectory.signal("force").nodes if own else None
        found.append(plain | ({} if nodes is None else {"torque": nodes.tolist()}))
    return found
