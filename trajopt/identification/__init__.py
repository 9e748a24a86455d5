"""Loads from measured motions: what ``trajopt identify`` does (Van Oosterwyck et al.).

motions: positions smoothed, torques as measured · fit: inertia and load pointwise and as one smooth fit, friction ·
plot: the figure.
"""

from trajopt.identification.fit import Fit, Identified, friction_of, identify, joint, pointwise

__all__ = ["Fit", "Identified", "friction_of", "identify", "joint", "pointwise"]
