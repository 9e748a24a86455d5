"""The formats by name: what each holds, who interpolates it how, and where that is published.

A format is one file of this package with a `Format` at its end; add it to `_all` and it can be written, read back and
verified (see CONTRIBUTING.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import degrees, radians
from typing import Final

from trajopt.errors import BadInput
from trajopt.export.points import Header, Points
from trajopt.fields import nearest


@dataclass(frozen=True)
class Format:
    """A file format of a target.

    ``write`` and ``read`` turn points into the file's bytes and back; ``interpolation`` is what the target does between
    points (a key of `trajopt.export.reconstruct.NEEDS`), by the order of the move and whether points come at a cycle;
    ``carries``: the highest derivative
    in the file. ``tick``: its clock, s; ``equidistant``: one point each cycle; ``rounds``: the positions in the file
    are rounded to encoder counts where those are given, ``counts``: they are whole numbers of them; ``at_rest``: it can
    only start and stop at rest, and counts from the start; ``most``: points of a file.
    """

    name: str
    write: Callable[[Points, Header], bytes]
    read: Callable[[bytes, Header], Points]
    interpolation: Callable[[int, bool], str]
    carries: int
    tick: float | None = None
    equidistant: bool = False
    rounds: bool = False
    counts: bool = False
    at_rest: bool = False
    most: int = 1_000_000


def linear(order: int, cyclic: bool) -> str:
    """Straight lines: also what is assumed where the target's manual does not say."""
    return "linear"


def cubic(order: int, cyclic: bool) -> str:
    """The cubic through position and velocity at both ends: the exact scheme's own position up to third order."""
    return "cubic"


def quintic(order: int, cyclic: bool) -> str:
    """The quintic through position, velocity and acceleration at both ends."""
    return "quintic"


def smooth(order: int, cyclic: bool = False) -> str:
    """Cubic where the acceleration jumps at the nodes, so that it has no one value there; else quintic."""
    return "cubic" if order < 3 else "quintic"


def technical(value: float, rotary: bool) -> float:
    """m as mm, rad as degrees, and so for their derivatives."""
    return degrees(value) if rotary else 1e3 * value


def from_technical(value: float, rotary: bool) -> float:
    """mm as m, degrees as rad."""
    return radians(value) if rotary else 1e-3 * value


def number(value: float) -> str:
    """The shortest decimal text that reads back as the same double; no negative zero."""
    return repr(float(value) + 0.0)


def find(to: str, dialect: str | None = None) -> Format:
    """The format of a name such as ``zaber``, or of a family and a dialect such as ``pvt`` and ``zaber``.

    Raises BadInput with the nearest name.
    """
    families = _families()
    if to in _SHORT:
        family, own = _SHORT[to]
        if dialect not in (None, own) and own is not None:
            raise BadInput(f"dialect: {to} is {own} already; leave --dialect out")
        to, dialect = family, own or dialect
    if to not in families:
        known = (*families, *(name for name in _SHORT))
        raise BadInput(f"to: unknown format {to[:60]!r}{nearest(to, known)}")
    dialects = families[to]
    if dialect is None:
        dialect = next(iter(dialects))
    if dialect not in dialects:
        given = f"unknown dialect {dialect[:60]!r} of {to}"
        raise BadInput(f"dialect: {given}{nearest(dialect, [name for name in dialects if name])}")
    return dialects[dialect]


_SHORT: Final[dict[str, tuple[str, str | None]]] = {
    "zaber": ("pvt", "zaber"),
    "xps": ("pvt", "xps"),
    "galil": ("pvt", "galil"),
    "cam-codesys": ("plcopen", "codesys"),
    "cam-twincat": ("plcopen", "twincat"),
    "cam-text": ("cam", None),
}


def _families() -> dict[str, dict[str, Format]]:
    """Formats by family and dialect, the usual dialect first."""
    from trajopt.export import cam_codesys, cam_text, cam_twincat, csv_table, galil, mat, ros, setpoints, xps, zaber

    return {
        "csv": {"": csv_table.FORMAT},
        "pvt": {"zaber": zaber.FORMAT, "xps": xps.FORMAT, "galil": galil.FORMAT},
        "cam": dict(cam_text.FORMATS),
        "plcopen": {"twincat": cam_twincat.FORMAT, "codesys": cam_codesys.FORMAT},
        "ros": {"": ros.FORMAT},
        "mat": {"": mat.FORMAT},
        "setpoints": {"": setpoints.FORMAT},
    }


def names() -> list[str]:
    """Every ``to`` that `find` knows."""
    return [*_families(), *_SHORT]
