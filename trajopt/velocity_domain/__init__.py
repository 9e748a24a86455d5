"""Global optima with speed as the independent variable: certificates and oracles, on plain floats.

Servomotor energy without a jerk limit (``optimum``, ``conditions``), and mechanical power and energy of a mass under a
jerk limit (``least_peak_power`` and its neighbours).
"""

from trajopt.velocity_domain.axis import Axis, Ramp, over_time
from trajopt.velocity_domain.conditions import Conditions, conditions
from trajopt.velocity_domain.limits import Limits
from trajopt.velocity_domain.motor import Servomotor
from trajopt.velocity_domain.power import (
    PowerOptimum,
    least_energy,
    least_peak,
    least_peak_power,
    minimum_time,
    power_within,
)
from trajopt.velocity_domain.search import optimum
from trajopt.velocity_domain.servo import Arc, ServoOptimum, State
from trajopt.velocity_domain.square import SquareOptimum, least_square_power

__all__ = [
    "Arc",
    "Axis",
    "Conditions",
    "Limits",
    "PowerOptimum",
    "Ramp",
    "ServoOptimum",
    "Servomotor",
    "SquareOptimum",
    "State",
    "conditions",
    "least_energy",
    "least_peak",
    "least_peak_power",
    "least_square_power",
    "minimum_time",
    "optimum",
    "over_time",
    "power_within",
]
