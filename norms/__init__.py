"""Norms of sampled signals, a file each; a user's own joins them by `register`.

class L4(norms.Norm):
    name = "l4"
    strictly_convex = True

    def measure(self, x, weights, duration):
        return float(weights @ x**4) ** 0.25

    ...
"""

from norms.base import Norm, Rows
from norms.l1 import L1
from norms.l2 import L2
from norms.linf import Linf

__all__ = ["L1", "L2", "Linf", "Norm", "Rows", "get", "names", "register"]

_KNOWN: dict[str, Norm] = {}


def register(norm: Norm) -> None:
    """Make ``norm`` known by its name, so that problem files can ask for it.

    Raises ValueError when the name is empty or taken by another norm.
    """
    if not norm.name or norm.name in _KNOWN:
        raise ValueError(f"a norm needs a name of its own, got {norm.name!r}")
    _KNOWN[norm.name] = norm


def get(norm: str | Norm | None) -> Norm | None:
    """The norm of that name; a norm, or None, is returned as it is. Raises ValueError naming the known ones."""
    if norm is None or isinstance(norm, Norm):
        return norm
    if norm not in _KNOWN:
        raise ValueError(f"unknown norm {norm!r}; one of {', '.join(_KNOWN)}")
    return _KNOWN[norm]


def names() -> tuple[str, ...]:
    """The names of the known norms."""
    return tuple(_KNOWN)


for _norm in (L1(), L2(), Linf()):
    register(_norm)
