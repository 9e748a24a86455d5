"""The checker: recomputes everything a result file claims, knowing nothing of the optimiser that wrote it.

It imports nothing else of trajopt: a slip there must not be repeated here. Its input is plain data as `json.load` gives
it, in SI units. Between nodes every signal of the ``exact`` scheme is a polynomial, so limits are checked at every
instant, by bounds on Bernstein coefficients and halving. Two twins do the same sums: one in floats, vectorised, and
one in rational numbers. The float twin goes first; whatever lies within ten times of its tolerance, or where rounding
could matter, the rational twin decides.

What a load over position makes is a polynomial between the knots of its splines, too. When the axis passes those is
known in floats only, and so the float twin alone decides there.

Imports go one way: report, case, polynomials, splines, reading, the two twins, questions, checking, front; result_file
and laws (of motion, in closed form) beside.

Tolerances, relative: limits 1e-6 (strict 1e-9) of the lesser of the limit and the signal's own peak; boundary and via
positions 1e-6 of the displacement, derivatives 1e-6 of their peak; objective and metrics 1e-6; dynamics 1e-9 per
interval and 1e-6 over the move; times 1e-12.
"""

from trajopt.checker.checking import check, check_file, measure
from trajopt.checker.command import command_bound
from trajopt.checker.report import Check, Report
from trajopt.checker.result_file import CheckerInputError

__all__ = ["Check", "CheckerInputError", "Report", "check", "check_file", "command_bound", "measure"]
