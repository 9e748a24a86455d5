"""What drives offer, and Chebyshev profiles, beside the best possible move: what ``trajopt profiles`` does.

laws: trapezoid, quintic, septic, and how any of them is measured · chebyshev: the families and their search (Van
Oosterwyck et al.) · compare: all beside the free profile · plot: the figures.
"""

from trajopt.profiles.compare import Profiles, compare_profiles

__all__ = ["Profiles", "compare_profiles"]
