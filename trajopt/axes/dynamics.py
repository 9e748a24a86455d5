"""What couples axes: the torque that a motion needs at every joint. The interface of an arm, and where arms are."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any, Final, Protocol, runtime_checkable

Joints = Sequence[Any]  # an array a joint, all of one shape, of floats or of expressions of a model


@runtime_checkable
class Dynamics(Protocol):
    """An arm of your own needs this much. All methods work elementwise on arrays of floats and on the expressions of a
    model alike: sums, products, squares, and `trajopt.sin` and `trajopt.cos` (numpy's refuse expressions)."""

    joints: int

    def torque(self, q: Joints, w: Joints, a: Joints) -> Sequence[Any]:
        """The torque (N m) at every joint, from its angles (rad), speeds (rad/s) and accelerations (rad/s²)."""


@runtime_checkable
class Reaching(Protocol):
    """What an arm needs besides when its tip is mentioned in the problem; elementwise, too."""

    def tip(self, q: Joints) -> tuple[Any, Any]:
        """Where the tip is, x and y in m."""

    def tip_velocity(self, q: Joints, w: Joints) -> tuple[Any, Any]:
        """How fast the tip moves, x and y in m/s."""


@runtime_checkable
class Energetic(Protocol):
    """An arm that also knows its energy is checked by the balance of power."""

    def energy(self, q: Joints, w: Joints) -> Any:
        """Kinetic and potential energy, J."""


_HOMES: Final = {"scara": ("scara.two_link", "TwoLinkArm"), "planar": ("scara.planar", "PlanarArm")}
KINDS: Final = tuple(_HOMES)


def pictures() -> Any:
    """The module that draws known arms: ``poses`` and ``tips`` of a solution."""
    return import_module("scara.figures")


def known_arm(kind: str, **numbers: Any) -> Any:
    """The arm of a kind (one of KINDS) with its numbers in SI; imported when it is asked for. Raises BadInput."""
    module, name = _HOMES[kind]
    return getattr(import_module(module), name)(**numbers)
