"""Planar arms as loads for trajopt: two links by Lagrange, any number by Newton and Euler, pictures."""

from scara.planar import PlanarArm
from scara.two_link import TwoLinkArm

__all__ = ["PlanarArm", "TwoLinkArm"]
