"""Published numbers of Clemen & Rupp 2023 (Tables II and III, section IV-F) and independent recomputations of them.

The absolute values were recomputed independently; ratios refer to the smallest energy and
the smallest peak power of the whole study (Euler scheme, N = 200, plain sums as norms).
"""

from __future__ import annotations

from typing import Final, NamedTuple

SMALLEST_ENERGY: Final = 0.811147924  # J
SMALLEST_PEAK_POWER: Final = 1.681929422  # W
STEP: Final = 0.005  # s


class Entry(NamedTuple):
    """One minimisation: what and by which norm, its value, and energy and peak power over the smallest ones."""

    minimize: str
    norm: str | None
    value: float
    energy: float
    power: float
    printed_energy: str = ""  # Table II
    printed_power: str = ""  # Table III


# L1 of velocity is not here: every feasible move is optimal, its printed 1.17 and 2.37 are an interior-point accident.
EULER: Final = (
    Entry("velocity", "l2", 3.74916116, 1.1715, 5.4455, "1.17", "5.45"),
    Entry("velocity", "linf", 0.284806587, 1.0000, 5.1299, "1.00", "5.13"),
    Entry("acceleration", "l1", 113.922635, 1.0000, 5.1299, "1.00", "5.13"),
    Entry("acceleration", "l2", 12.652999, 1.8482, 1.4072, "1.85", "1.41"),
    Entry("acceleration", "linf", 1.03917021, 3.0821, 3.0631, "3.08", "3.06"),
    Entry("jerk", "l1", 831.33617, 3.0821, 3.0631, "3.08", "3.06"),
    Entry("jerk", "l2", 96.3922477, 2.7964, 2.5909, "2.80", "2.59"),
    Entry("jerk", "linf", 8.26322366, 3.0821, 3.3302, "3.08", "3.33"),
    Entry("power", "l1", 162.2295848, 1.0000, 5.1299, "1.00", "5.13"),
    Entry("energy", None, 0.811147924, 1.0000, 5.1299, "1.00", "5.13"),
    Entry("power", "l2", 19.25478057, 1.3907, 1.7726, "1.39", "1.77"),  # sqrt(1.85373288/dt)
    Entry("power", "linf", 1.681929422, 1.9606, 1.0000, "1.96", "1.00"),
    Entry("time", None, 0.659965523, 3.0820, 11.2108, "3.08", "11.2"),
)
DISTANCE_SUM: Final = 50.8  # Σ v over the nodes, D/dt: the only determined number of L1 of velocity


class Exact(NamedTuple):
    """The same study by the exact scheme; None where energy or peak power are not determined by the optimum."""

    minimize: str
    norm: str | None
    value: float  # in the paper's plain sums
    energy: float | None
    power: float | None


EXACT: Final = (
    # The energy of L2 of velocity is listed as 1.1870, but ripple at the end of the ramp moves it at no cost: answers
    # whose objectives agree to 1e-9 have 1.187 (OSQP), 1.210 (Clarabel) and 1.235 (Ipopt).
    Exact("velocity", "l2", 3.74880648, None, 5.1637),
    Exact("velocity", "linf", 0.284782161, None, None),
    Exact("acceleration", "l1", 113.922635, 1.0000, 4.8615),
    Exact("acceleration", "l2", 12.652999, 1.8482, 1.3948),
    Exact("jerk", "l1", 831.33617, 3.0821, 3.0470),
    Exact("jerk", "l2", 96.3922477, 2.7964, 2.5681),
    Exact("power", "l1", 162.2295848, 1.0000, 4.8614),
    Exact("energy", None, 0.811147924, 1.0000, 4.8614),
    Exact("power", "l2", 19.27318204, 1.3936, 1.6554),  # sqrt(1.85727772/dt)
    Exact("power", "linf", 1.68200675, 1.9609, 1.0000),
)

# Limits held at the nodes only; ours also hold between them, which costs a little where the velocity limit is active.
EXACT_AT_NODES: Final = (
    Exact("acceleration", "linf", 1.03915702, None, None),
    Exact("jerk", "linf", 8.26255755, None, None),
    Exact("time", None, 0.659962816, None, None),
)
# ... and what they become once the velocity limit holds between the nodes as well.
EXACT_BETWEEN_NODES: Final = {"acceleration": 1.0391702128, "jerk": 8.26322366, "time": 0.659965523}

# Fig. 6: 0.5·energy + 0.5·peak power, raw SI.
EQUAL_WEIGHTS: Final = {
    "euler": (1.219247, 1.815879),  # J, W
    "exact": (1.222303, 1.814183),
}
EQUAL_WEIGHTS_PRINTED: Final = ("1.50", "1.08")  # section IV-F, over the smallest energy and peak power
