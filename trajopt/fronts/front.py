"""The frozen front: its points with their certificates, what bounds it from outside, and how well it is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt.answer import seal
from trajopt.fronts.geometry import Outside
from trajopt.fronts.objectives import friendly, unit
from trajopt.fronts.scalarise import Plane
from trajopt.mesh import Floats
from trajopt.problem import Problem, Term
from trajopt.solution import Solution
from trajopt.verdict import Verdict

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from trajopt.fronts.explore import Explorer


@dataclass(frozen=True)
class Point:
    """A point of a front: a checked ``solution`` and its ``values`` of the objectives, SI.

    ``kind``: anchor, weights, epsilon or time, for how it was found; ``weights``: of the half-plane that touches the
    front here, SI; ``prices``: what one more unit of the first objective saves of each other (SI), None where that is
    not known or the front ends.
    """

    solution: Solution
    values: tuple[float, ...]
    kind: str
    weights: tuple[float, ...] | None = None
    ceilings: tuple[float | None, ...] | None = None

    @property
    def prices(self) -> tuple[float | None, ...]:
        """One for each objective after the first."""
        if self.weights is None:
            return (None,) * (len(self.values) - 1)
        first = self.weights[0]
        return tuple(first / other if first > 0 and other > 0 else None for other in self.weights[1:])

    @property
    def status(self) -> Verdict:
        """The verdict of the solution."""
        return self.solution.status

    @property
    def certificate(self) -> Mapping[str, Any]:
        """Lower bound and gap of what was minimised to find it."""
        return self.solution.certificate


@dataclass(frozen=True)
class Front:
    """What `trajopt.pareto` returns.

    ``points``: the nondominated ones, by the first objective; ``dropped``: dominated ones; ``unsolved``: solutions
    without a move. ``planes`` and ``corners`` bound the front from outside (see `trajopt.fronts.geometry`), SI.
    ``error``: how well the front is known, in shares of the ranges between the anchors, None where no bound is known;
    ``asked``: how well it should be. ``blends``: how many moves between each two neighbours were measured to know it.
    ``status``: SOLVED when every point is solved and the asked error is certified, else UNDECIDED, and ``message`` says
    which is lacking.
    """

    problem: Problem
    terms: tuple[Term, ...]
    status: Verdict
    message: str
    points: tuple[Point, ...]
    dropped: tuple[Point, ...] = ()
    unsolved: tuple[Solution, ...] = ()
    planes: tuple[Plane, ...] = ()
    corners: tuple[tuple[float, ...], ...] = ()
    convex: bool = False
    blends: tuple[int, ...] = ()
    error: float | None = None
    asked: float | None = None
    ideal: tuple[float, ...] = ()
    nadir: tuple[float, ...] = ()
    solves: int = 0
    timings: Mapping[str, float] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """The objectives for people: ``peak power``."""
        return tuple(friendly(term, self.problem) for term in self.terms)

    @property
    def units(self) -> tuple[str, ...]:
        """Their units."""
        return tuple(unit(term, self.problem) for term in self.terms)

    @property
    def values(self) -> Floats:
        """(n, m) of the points, SI."""
        return np.array([point.values for point in self.points]).reshape(len(self.points), len(self.terms))

    @property
    def normalised(self) -> Floats:
        """(n, m): 0 at the best and 1 at the worst anchor in every objective."""
        normalised: Floats = (self.values - np.array(self.ideal)) / ranges(self.ideal, self.nadir)
        return normalised

    @property
    def anchors(self) -> tuple[int, ...]:
        """For each objective the point that is best in it."""
        return tuple(int(k) for k in np.argmin(self.values, axis=0)) if self.points else ()

    @property
    def knee(self) -> int | None:
        """The point farthest inside the line, or plane, through the anchors, normalised; None where none is inside."""
        if len(self.points) <= len(self.terms):
            return None
        y = self.normalised
        try:
            normal = np.linalg.solve(y[list(self.anchors)], np.ones(len(self.terms)))
        except np.linalg.LinAlgError:
            return None
        inwards = 1 - y @ normal
        best = int(np.argmax(inwards))
        return best if inwards[best] > 1e-9 else None

    @property
    def hypervolume(self) -> float:
        """The share of the box between the best and the worst values that the points dominate (moocore)."""
        from moocore import hypervolume

        return float(hypervolume(self.normalised, ref=np.ones(len(self.terms)))) if self.points else 0.0

    def distance(self, reference: Any) -> float:
        """IGD+ (moocore) from ``reference``, an (n, m) array of values in SI: how far, on average and normalised, this
        front is behind it."""
        from moocore import igd_plus

        size = ranges(self.ideal, self.nadir)
        return float(igd_plus(self.normalised, (np.asarray(reference, dtype=float) - self.ideal) / size))

    @property
    def frame(self) -> pd.DataFrame:
        """One row a point; see `trajopt.fronts.output.frame`."""
        from trajopt.fronts.output import frame

        return frame(self)

    def plot(self) -> Axes:
        """The front with its certified band, anchors and knee (see `trajopt.fronts.plot`)."""
        from trajopt.fronts.plot import plot_front

        return plot_front(self)

    def explore(self) -> Explorer:
        """A page on which a slider or a click shows each point's move, prices and limits; a notebook shows it,
        ``.save("front.html")`` writes it. Raises ValueError for a front without points, MissingPackage without plotly.
        """
        from trajopt.fronts.explore import explore

        return explore(self)

    def to_dict(self) -> dict[str, Any]:
        """The content of front.json, without its seal."""
        from trajopt.fronts.output import to_dict

        return to_dict(self)

    def sealed(self) -> dict[str, Any]:
        """`to_dict` with its seal (see `trajopt.Solution.sealed`)."""
        return seal(self.to_dict())

    def save(self, directory: str | Path) -> list[Path]:
        """Write front.json, front.csv, front.png and a folder a point with its result and profile; returns the paths.
        Raises OSError."""
        from trajopt.fronts.output import save

        return save(self, Path(directory))

    def __repr__(self) -> str:
        known = "" if self.error is None else f", known within {100 * self.error:.2g} %"
        return f"<Front {self.status.value}: {len(self.points)} points of {' and '.join(self.names)}{known}>"


def outside(
    planes: Sequence[Plane],
    corners: Sequence[tuple[float, ...]],
    ideal: Sequence[float] | Floats,
    nadir: Sequence[float] | Floats,
) -> Outside:
    """What bounds a front from outside, normalised."""
    low, size = np.array(ideal), ranges(ideal, nadir)
    weights = np.array([plane.weights for plane in planes]).reshape(-1, len(low)) * size
    values = np.array([plane.value for plane in planes]) - weights @ (low / size)
    total = np.sum(weights, axis=1)
    far = (np.array(corners).reshape(-1, len(low)) - low) / size
    return Outside(weights / total[:, None], values / total, far)


def ranges(ideal: Sequence[float] | Floats, nadir: Sequence[float] | Floats) -> Floats:
    """(m,) what every objective is divided by: its range between the anchors or, where they agree, its own size."""
    low, high = np.array(ideal), np.array(nadir)
    size = np.maximum(np.abs(high), 1e-300)
    found: Floats = np.where(high - low > 1e-6 * size, high - low, size)
    return found
