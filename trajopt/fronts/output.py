"""A front as a table, as JSON, and as a folder: front.json, front.csv, front.png, and every point with its profile."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import pandas as pd

from trajopt.files import write_atomically
from trajopt.fronts.front import Front, Point

if TYPE_CHECKING:
    from trajopt.problem import Term

FORMAT: Final = "trajopt front 1"
POINTS: Final = "points"  # the folder of the points, each in one of its own, numbered from 001


def frame(front: Front) -> pd.DataFrame:
    """One row a point of the front: the objectives (SI), the same normalised (0 at the best, 1 at the worst anchor),
    what one more unit of the first objective saves of each other, verdict, gap, how it was found, and its mark.

    ``frame.attrs["units"]`` names the unit of each objective.
    """
    columns = [name.replace(" ", "_") for name in front.names]
    table = pd.DataFrame(front.values, columns=pd.Index(columns))
    if front.points:
        table[[f"{name}_normalised" for name in columns]] = front.normalised
    for k, name in enumerate(columns[1:]):
        table[f"{name}_per_{columns[0]}"] = [point.prices[k] for point in front.points]
        table[f"{name}_per_{columns[0]}"] = table[f"{name}_per_{columns[0]}"].astype(float)
    table["status"] = [point.status.value for point in front.points]
    table["gap"] = pd.Series([point.certificate.get("gap") for point in front.points], dtype=float)
    table["found_by"] = [point.kind for point in front.points]
    table["mark"] = [_mark(front, k) for k in range(len(front.points))]
    table.attrs["units"] = dict(zip(columns, front.units, strict=True))
    return table


def _mark(front: Front, k: int) -> str:
    names = [f"least {name}" for name, anchor in zip(front.names, front.anchors, strict=True) if anchor == k]
    return " and ".join([*names, *(["knee"] if front.knee == k else [])])


def to_dict(front: Front) -> dict[str, Any]:
    """Plain JSON data; bounds and values in SI, errors in shares of the ranges between the anchors."""
    from trajopt import __version__

    everyone = [*front.points, *front.dropped]
    return {
        "format": FORMAT,
        "trajopt": __version__,
        "status": front.status.value,
        "message": front.message,
        "objectives": [_objective(front, k, term) for k, term in enumerate(front.terms)],
        "error": front.error,
        "asked": front.asked,
        "convex": front.convex,
        "blends": list(front.blends),
        "ideal": list(front.ideal),
        "nadir": list(front.nadir),
        "anchors": list(front.anchors),
        "knee": front.knee,
        "hypervolume": front.hypervolume,
        "solves": front.solves,
        "unsolved": [{"status": s.status.value, "message": s.message} for s in front.unsolved],
        "points": [_point(front, k, point) for k, point in enumerate(everyone)],
        "planes": [{"weights": list(plane.weights), "value": plane.value} for plane in front.planes],
        "corners": [[None if x == float("inf") else x for x in corner] for corner in front.corners],
        "timings": dict(front.timings),
    }


def _objective(front: Front, k: int, term: Term) -> dict[str, Any]:
    norm = None if term.norm is None else term.norm.name
    return {"name": front.names[k], "minimize": term.minimize, "norm": norm, "unit": front.units[k]}


def _point(front: Front, k: int, point: Point) -> dict[str, Any]:
    return {
        "result": f"{POINTS}/{k + 1:03}/result.json",
        "status": point.status.value,
        "values": list(point.values),
        "on_front": k < len(front.points),
        "found_by": point.kind,
        "weights": None if point.weights is None else list(point.weights),
        "prices": list(point.prices),
        "lower_bound": point.certificate.get("lower_bound"),
        "gap": point.certificate.get("gap"),
    }


def save(front: Front, directory: Path) -> list[Path]:
    """Write everything into ``directory``, the points of an earlier front there replaced. Raises OSError."""
    directory.mkdir(parents=True, exist_ok=True)
    written = [directory / "front.json", directory / "front.csv"]
    written[0].unlink(missing_ok=True)
    folder = directory / POINTS
    for stale in sorted(folder.glob("[0-9][0-9][0-9]")):
        shutil.rmtree(stale)
    for k, point in enumerate([*front.points, *front.dropped]):
        point.solution.save_data(folder / f"{k + 1:03}")
    write_atomically(written[1], _csv(front).encode())
    if front.points:
        figure: Any = front.plot().figure
        figure.savefig(directory / "front.png", dpi=150)
        written.append(directory / "front.png")
    write_atomically(written[0], json.dumps(front.sealed(), indent=1, allow_nan=False).encode())
    return [*written, folder] if front.points else written


def _csv(front: Front) -> str:
    """The frame with units in the header and 17 digits."""
    table = frame(front)
    units = table.attrs["units"]
    table = table.rename(columns={name: f"{name} [{unit}]" for name, unit in units.items()})
    text: str = table.to_csv(index=False, float_format="%.17g")
    return text
