"""Minimum-time commands for linear plants with any poles, and what any command leaves vibrating."""

from trajopt.plant.command import Command
from trajopt.plant.minimum_time import band, time_optimal
from trajopt.plant.plant import Plant
from trajopt.plant.simulate import response
from trajopt.plant.vibration import residual_vibration

__all__ = ["Command", "Plant", "band", "residual_vibration", "response", "time_optimal"]
