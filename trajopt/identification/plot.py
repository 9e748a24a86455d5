"""Figures of an identification: the load found over position, the torque left over, the residual of the friction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from trajopt import units
from trajopt.plots import look
from trajopt.plots.look import COLOURS, SMALL, Panels, pretty
from trajopt.profiles.plot import draw_load
from trajopt.quantities import force_along
from trajopt.signals import OnFloats

if TYPE_CHECKING:
    from trajopt.identification import Identified


def plot_identification(found: Identified) -> Panels:
    """Two or three axes: inertia and load, what the torque of each motion exceeds the fit by, residual of friction."""
    count = 2 + (found.friction is not None)
    panels = look.panels(count, 2.8 * count)
    kinds = units.kinds(found.rotary)
    unit = f"{kinds['force'].name} left over [{pretty(kinds['force'].unit)}]"
    scale = draw_load(panels[0], found.fit.load, found.rotary)
    look.title(panels[0], "Identified load")
    for k, motion in enumerate(found.motions):
        q = np.asarray(motion.smooth(motion.time))
        model = force_along(OnFloats(), found.fit.load, q, motion.velocity, motion.acceleration)
        label = motion.name.rpartition("/")[2]
        panels[1].plot(q * scale, motion.force - model, ".", ms=1.5, color=COLOURS[k % 7], label=label)
    panels[1].set_xlabel(f"position [{'deg' if found.rotary else 'm'}]", fontsize=SMALL)
    panels[1].set_ylabel(unit, fontsize=SMALL)
    panels[1].legend(fontsize=SMALL, frameon=False, markerscale=4, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    if found.friction is not None:
        friction = found.friction
        panels[2].plot(friction.time, friction.residual, ".", ms=2.5, color=COLOURS[0])
        panels[2].set_xlabel("time [s]", fontsize=SMALL)
        panels[2].set_ylabel(unit, fontsize=SMALL)
        text = f"viscous friction {friction.viscous:.4g} ± {friction.error:.2g} {pretty(kinds['viscous'].unit)}"
        panels[2].set_title(text, loc="left", fontsize=9)
    return panels
