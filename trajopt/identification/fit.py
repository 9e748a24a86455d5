"""Identification of a mechanism: inertia and load torque over position from motions, friction from a measured one.

Torque is T = F(q) + ½ J'(q) v² + J(q) a (Van Oosterwyck et al. eq. 1): at one position [1, v²/2, a]·[F, J', J] = T, so
that three motions through it (a slow one, one of constant speed, one that speeds up) give all three pointwise. Better
is one smooth fit of all samples, in which J' is the slope of J. Velocity and acceleration come from a polynomial
through the measured positions, whose degree the residual chooses: differences of samples would amplify their noise.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from trajopt import units
from trajopt.curve import DEGREE, LEAST, Curve
from trajopt.errors import BadInput
from trajopt.files import write_atomically
from trajopt.identification.motions import Motion, bayes
from trajopt.mesh import Floats
from trajopt.problem import Load
from trajopt.quantities import force_along
from trajopt.signals import OnFloats

_STRETCHES: Final = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96)  # of the splines of a joint fit
_SINGULAR: Final = 1e8  # condition of the three equations at a position


@dataclass(frozen=True)
class Friction:
    """``viscous`` N s/m or N m s, its standard error, and the ``residual`` (n,) of the torque at ``time``."""

    viscous: float
    error: float
    degree: int
    time: Floats
    residual: Floats


def friction_of(load: Load, motion: Motion) -> Friction:
    """μ = <v, r>/<v, v> with r what the torque exceeds that of a load without friction; its error is that of least
    squares with independent noise. Raises BadInput for a motion that leaves the table of the load, or stands still."""
    position, v = np.asarray(motion.smooth(motion.time)), motion.velocity
    for name, curve in load.curves.items():
        low, high = curve.span
        if np.min(position) < low - 1e-3 * (high - low) or np.max(position) > high + 1e-3 * (high - low):
            raise BadInput(f"{motion.name}: leaves the table of the load's {name}, {low:.6g} to {high:.6g}; shorten it")
    rest = load.model_copy(update={"viscous": 0.0})
    excess = motion.force - np.asarray(force_along(OnFloats(), rest, position, v, motion.acceleration))
    square = float(v @ v)
    if square == 0.0:
        raise BadInput(f"{motion.name}: stands still, which tells nothing of viscous friction")
    viscous = float(v @ excess) / square
    residual = excess - viscous * v
    error = float(np.sqrt(residual @ residual / (len(v) - 1) / square))
    return Friction(viscous, error, motion.smooth.degree(), motion.time, residual)


def pointwise(motions: Sequence[Motion], at: Floats) -> tuple[Floats, Floats, Floats]:
    """(F, J', J) at positions, from the three equations there, least squares where there are more motions.

    Raises BadInput for fewer than three motions, one that turns back, and motions too alike to tell the three apart.
    """
    if len(motions) < 3:
        raise BadInput(f"motions: {len(motions)} give fewer equations than unknowns at a position; record three")
    rows, values = [], []
    for motion in motions:
        place = np.asarray(motion.smooth(motion.time))
        order = np.sign(place[-1] - place[0]) or 1.0
        if np.any(order * np.diff(place) <= 0):
            raise BadInput(f"{motion.name}: turns back or rests; cut it to where the position only grows")
        when = _passed(motion, at)
        v, a = motion.smooth.deriv()(when), motion.smooth.deriv(2)(when)
        rows.append(np.stack([np.ones_like(v), v**2 / 2, a], axis=1))
        values.append(_through(motion, when))
    system, torque = np.stack(rows, axis=1), np.stack(values, axis=1)
    scale = np.max(np.abs(system), axis=(0, 1))
    scale[scale == 0] = 1.0
    worst = float(np.max(np.linalg.cond(system / scale)))
    if not worst < _SINGULAR:
        raise BadInput("motions: too alike to tell inertia, its slope and load apart; vary speed and acceleration")
    found = np.stack([np.linalg.lstsq(a, b, rcond=None)[0] for a, b in zip(system / scale, torque, strict=True)])
    return found[:, 0] / scale[0], found[:, 1] / scale[1], found[:, 2] / scale[2]


def _passed(motion: Motion, at: Floats) -> Floats:
    """The times at which a motion passes positions, by Newton's method from a table."""
    place = np.asarray(motion.smooth(motion.time))
    order = 1 if place[-1] > place[0] else -1
    low, high = min(place[0], place[-1]), max(place[0], place[-1])
    slack = 1e-9 * (high - low)
    if np.min(at) < low - slack or np.max(at) > high + slack:
        raise BadInput(f"{motion.name}: runs from {low:.6g} to {high:.6g} only; all motions must cover the same range")
    when = np.interp(at, place[::order], motion.time[::order])
    for _ in range(20):
        speed = motion.smooth.deriv()(when)
        step = np.divide(motion.smooth(when) - at, speed, out=np.zeros_like(when), where=speed != 0)
        when = np.clip(when - step, motion.time[0], motion.time[-1])
    return np.asarray(when)


def _through(motion: Motion, when: Floats) -> Floats:
    """The torque at times between samples: the quintic spline through them."""
    from scipy.interpolate import make_interp_spline

    return np.asarray(make_interp_spline(motion.time, motion.force, k=DEGREE)(when))


@dataclass(frozen=True)
class Fit:
    """A joint fit: load (F and J as curves, J' the slope), the torque left over (RMS), and stretches of its splines."""

    load: Load
    residual: float
    stretches: int


def joint(motions: Sequence[Motion], rows: int = 181) -> Fit:
    """One smooth load for all samples of all motions by linear least squares; Bayes' criterion chooses how many
    stretches its quintic splines have. Raises BadInput where the samples do not determine it."""
    places = [np.asarray(motion.smooth(motion.time)) for motion in motions]
    low, high = max(float(np.min(q)) for q in places), min(float(np.max(q)) for q in places)
    if not low < high:
        raise BadInput("motions: have no range of positions in common")
    q, v, a, torque = (np.concatenate(x) for x in (
        places, [m.velocity for m in motions], [m.acceleration for m in motions], [m.force for m in motions]
    ))  # fmt: skip
    inside = (q >= low) & (q <= high)
    best: tuple[float, Fit] | None = None
    for stretches in _STRETCHES:
        if 6 * (stretches + DEGREE) > np.count_nonzero(inside):
            break
        found = _fit(q[inside], v[inside], a[inside], torque[inside], (low, high), stretches, rows)
        if found is None:
            break
        load, residual, unknowns = found
        size = float(np.std(torque[inside])) or 1.0
        score = bayes((residual / size) ** 2, int(np.count_nonzero(inside)), unknowns)
        if best is None or score < best[0]:
            best = score, Fit(load, residual, stretches)
        elif stretches > 2 * best[1].stretches:
            break
    if best is None:
        raise BadInput("motions: do not determine inertia and load; record three of different speed and acceleration")
    return best[1]


def _fit(
    q: Floats, v: Floats, a: Floats, torque: Floats, span: tuple[float, float], stretches: int, rows: int
) -> tuple[Load, float, int] | None:
    """The load, the RMS left over and the number of unknowns; None where they are not determined."""
    from scipy.interpolate import BSpline
    from scipy.linalg import lstsq

    inner = np.linspace(*span, stretches + 1)
    knots = np.concatenate([np.full(DEGREE, span[0]), inner, np.full(DEGREE, span[1])])
    count = len(knots) - DEGREE - 1
    values = BSpline.design_matrix(np.clip(q, *span), knots, DEGREE).toarray()
    slopes = np.asarray(BSpline(knots, np.eye(count), DEGREE).derivative()(q))
    system = np.hstack([values, slopes * (v**2 / 2)[:, None] + values * a[:, None]])
    scale = np.linalg.norm(system, axis=0)
    if np.any(scale == 0):
        return None
    found, _, rank, _ = lstsq(system / scale, torque, cond=1e-12, lapack_driver="gelsy")
    if rank < 2 * count:
        return None
    left = system @ (found / scale) - torque
    force, inertia = (BSpline(knots, part, DEGREE) for part in np.split(found / scale, 2))
    at = np.linspace(*span, max(rows, 4 * stretches + 1))
    if np.min(inertia(at)) <= 0:
        return None
    load = Load(inertia=Curve(position=at, value=inertia(at)), force=Curve(position=at, value=force(at)))
    return load, float(np.sqrt(np.mean(left**2))), 2 * count


@dataclass(frozen=True)
class Identified:
    """What was found: the joint fit, the friction where it was asked for, and how the pointwise solution differs."""

    fit: Fit
    motions: tuple[Motion, ...]
    friction: Friction | None = None
    differs: float | None = None  # RMS over positions of the pointwise inertia from the fit, of the largest

    @property
    def rotary(self) -> bool:
        """Whether positions are angles."""
        return self.motions[0].rotary

    def to_dict(self) -> dict[str, Any]:
        """Plain data in SI."""
        friction = self.friction
        return {
            "status": "IDENTIFIED",
            "rows": len(self.fit.load.curves["inertia"].position),
            "span": list(self.fit.load.curves["inertia"].span),
            "residual_rms": self.fit.residual,
            "stretches": self.fit.stretches,
            "pointwise_differs": self.differs,
            "degrees": {motion.name: motion.smooth.degree() for motion in self.motions},
            "viscous": None if friction is None else friction.viscous,
            "viscous_standard_error": None if friction is None else friction.error,
            "viscous_residual_rms": None if friction is None else float(np.sqrt(np.mean(friction.residual**2))),
        }

    def sentences(self) -> list[str]:
        """What there is to say, with units."""
        kinds, curve = units.kinds(self.rotary), self.fit.load.curves["inertia"]
        low, high = min(curve.value), max(curve.value)
        unit = kinds["force"].unit
        lines = [
            f"{kinds['inertia'].name} from {low:.6g} to {high:.6g} {kinds['inertia'].unit} over"
            f" {curve.span[0]:.6g} to {curve.span[1]:.6g} {kinds['position'].unit}",
            f"left over: {self.fit.residual:.3g} {unit} RMS, with splines of {self.fit.stretches} stretches",
        ]
        if self.differs is not None:
            name, share = kinds["inertia"].name, 100 * self.differs
            lines.append(f"solved point by point, the {name} differs by {share:.2g} % RMS")
        if self.friction is not None:
            found, left = self.friction, float(np.sqrt(np.mean(self.friction.residual**2)))
            lines.append(
                f"viscous friction {found.viscous:.6g} ± {found.error:.2g} {kinds['viscous'].unit} (one standard error;"
                f" left over {left:.3g} {unit} RMS, positions smoothed by degree {found.degree})"
            )
        return lines

    def table(self) -> str:
        """The load as CSV for ``[load]``: position, inertia, torque."""
        kinds = units.kinds(self.rotary)
        inertia, force = self.fit.load.curves["inertia"], self.fit.load.curves["force"]
        header = f"q [{kinds['position'].unit}],J [{kinds['inertia'].unit}],F [{kinds['force'].unit}]"
        rows = zip(inertia.position, inertia.value, force.value, strict=True)
        return "\n".join([header, *(",".join(f"{x:.17g}" for x in row) for row in rows)]) + "\n"

    def save(self, directory: str | Path) -> list[Path]:
        """Write load.csv, identification.json and identification.png. Raises OSError."""
        from trajopt.identification.plot import plot_identification

        directory = Path(directory)
        directory.mkdir(parents=True, exist_ok=True)
        names = ("load.csv", "identification.json", "identification.png")
        written = [directory / name for name in names]
        write_atomically(written[0], self.table().encode())
        write_atomically(written[1], json.dumps(self.to_dict(), indent=1, allow_nan=False).encode())
        figure: Any = plot_identification(self)[0].figure
        figure.savefig(written[2], dpi=150)
        return written


def identify(paths: Sequence[Path], friction: Path | None = None, rows: int = 181) -> Identified:
    """The load from the motions in CSV files, and the friction from a measured one. Raises BadInput."""
    if not LEAST <= rows <= 10_000:
        raise BadInput(f"--rows: must be {LEAST} to 10000, got {rows}")
    motions = tuple(Motion.read(path) for path in paths)
    measured = None if friction is None else Motion.read(friction)
    if len({motion.rotary for motion in (*motions, *(() if measured is None else (measured,)))}) > 1:
        raise BadInput("motions: some positions are angles, some are lengths")
    fit = joint(motions, rows)
    differs = None
    curve = fit.load.curves["inertia"]
    if len(motions) >= 3:
        at = np.linspace(*curve.span, 100)[1:-1]
        with suppress(BadInput):  # motions that turn back, or rest, serve the joint fit alone
            differs = float(np.sqrt(np.mean((pointwise(motions, at)[2] - curve.at(at)) ** 2)) / max(curve.value))
    return Identified(fit, motions, None if measured is None else friction_of(fit.load, measured), differs)
