"""Minimum-time commands for linear plants with any poles, and what any command leaves vibrating."""

from trajopt.plant.command import Command
from trajopt.plant.minimum_time import band, time_optimal
from trajopt.plant.plant import Plant
from trajopt.plant.simulate import response
from trajopt.plant.vibration import (
    mode_derivative_weights,
    mode_pole,
    mode_weights,
    profile_vibration,
    residual_amplitude,
    residual_vibration,
    start_weights,
)

__all__ = [
    "Command",
    "Plant",
    "band",
    "mode_derivative_weights",
    "mode_pole",
    "mode_weights",
    "profile_vibration",
    "residual_amplitude",
    "residual_vibration",
    "response",
    "start_weights",
    "time_optimal",
]
