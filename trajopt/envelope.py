"""The torque-speed envelope of a motor: which force it has at which speed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import ValidationInfo

from trajopt.fields import Limit, Section, refuse_unknown, sequence, si
from trajopt.units import shown


class Envelope(Section):
    """Which force a motor has at which speed: piecewise linear from standstill on, the same in all four quadrants.

    ``speed`` (n,) m/s or rad/s, from 0, increasing, none beyond the last; ``force`` (n,) N or N m, not increasing and
    concave, so that the envelope is convex.
    """

    speed: tuple[float, ...]
    force: tuple[float, ...]

    @property
    def limit(self) -> Limit:
        """What holds each of `lines`: plus-minus the force at standstill."""
        return Limit(min=-self.force[0], max=self.force[0])

    @property
    def lines(self) -> list[tuple[float, float]]:
        """(a, b) of the sides: a·|force| + b·|velocity| is at most the force at standstill."""
        sides = []
        points = list(zip(self.speed, self.force, strict=True))
        for (slow, strong), (fast, weak) in zip(points, points[1:], strict=False):
            slope = (strong - weak) / (fast - slow)
            level = strong + slope * slow  # of the line at standstill
            sides.append((self.force[0] / level, slope * self.force[0] / level))
        return [*sides, (0.0, self.force[0] / self.speed[-1])]

    def scaled(self, factor: float) -> Envelope:
        """The envelope with speeds and forces times a factor."""
        return Envelope(speed=tuple(factor * x for x in self.speed), force=tuple(factor * x for x in self.force))


def read_envelope(value: Any, info: ValidationInfo) -> Envelope | None:
    if value is None or isinstance(value, Envelope):
        return value if value is None else _concave(value)
    if not isinstance(value, Mapping):
        raise ValueError(f'must be {{ speed = ["0 rpm", ...], torque = ["2 N m", ...] }}, got {shown(value)}')
    refuse_unknown(value, ("speed", "torque", "force"))
    if "torque" in value and "force" in value:
        raise ValueError("give torque or force, not both")
    column = "force" if "force" in value else "torque"
    for key in ("speed", column):
        if value.get(key) is None:
            raise ValueError(f"{key}: is missing; write a list of speeds, and {column} = a list of as many values")
    speeds = tuple(si(x, "velocity", info) for x in sequence(value["speed"], "speed"))
    forces = tuple(si(x, "force", info) for x in sequence(value[column], column))
    return _concave(Envelope(speed=speeds, force=forces))


def _concave(envelope: Envelope) -> Envelope:
    speed, force = envelope.speed, envelope.force
    if len(speed) != len(force) or len(speed) < 2:
        counts = f"{len(speed)} speeds, {len(force)} torques"
        raise ValueError(f"needs as many torques as speeds, at least two; got {counts}")
    if not np.all(np.isfinite([*speed, *force])):
        raise ValueError("must be finite")
    if speed[0] != 0:
        raise ValueError(f"speed: must start at standstill, 0, got {speed[0]:g}")
    if force[0] <= 0 or min(force) < 0:
        raise ValueError(f"torque: must be > 0 at standstill and nowhere negative, got {min(force):g}")
    steps, changes = np.diff(speed), np.diff(force)
    if np.any(steps <= 0):
        raise ValueError(f"speed: must increase, got {speed[int(np.argmax(steps <= 0)) + 1]:g} after a higher one")
    if np.any(changes > 0):
        at = speed[int(np.argmax(changes > 0)) + 1]
        raise ValueError(f"torque: must not increase with the speed, as it does up to {at:g}")
    bends = np.diff(changes / steps)
    if np.any(bends > 1e-9 * force[0] / speed[-1]):
        at = speed[int(np.argmax(bends)) + 1]
        raise ValueError(f"torque: bends inwards at speed {at:g}; leave that point out, or lower those before it")
    return envelope
