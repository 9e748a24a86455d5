"""Pareto fronts between two or three objectives, and how well they are known."""

from trajopt.fronts.front import Front, Point
from trajopt.fronts.tracing import pareto

__all__ = ["Front", "Point", "pareto"]
