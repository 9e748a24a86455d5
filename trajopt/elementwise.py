"""Sine and cosine of whole arrays, of floats or of a model's expressions: what an arm's dynamics are written with."""

from __future__ import annotations

from typing import Any

import numpy as np


def sin(x: Any) -> Any:
    """sin(x), elementwise, of floats or of the expressions of a nonconvex model."""
    return _apply("sin", x)


def cos(x: Any) -> Any:
    """cos(x), elementwise, of floats or of the expressions of a nonconvex model."""
    return _apply("cos", x)


def _apply(name: str, x: Any) -> Any:
    if np.asarray(x).dtype != object:
        return getattr(np, name)(x)
    from trajopt.model_pyomo import ELEMENTWISE

    return ELEMENTWISE[name](x)
