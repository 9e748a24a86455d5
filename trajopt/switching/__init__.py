"""Exact minimum time for chains of integrators, orders one to four: arcs, switching times, and their verdict."""

from trajopt.switching.chain import Arcs, Chain, Impossible, Unresolved
from trajopt.switching.low import feasible_durations
from trajopt.switching.polynomials import Audit, audit
from trajopt.switching.snap import s_curve
from trajopt.switching.solve import shortest

__all__ = ["Arcs", "Audit", "Chain", "Impossible", "Unresolved", "audit", "feasible_durations", "s_curve", "shortest"]
