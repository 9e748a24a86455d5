"""Pareto fronts between two or three objectives, and how well they are known."""

from trajopt.pareto.front import Front, Point
from trajopt.pareto.tracing import pareto

__all__ = ["Front", "Point", "pareto"]
