"""Description of the MJCF robot that most cases change."""

from __future__ import annotations

from functools import cache

from mjcf_biped import biped

from wbc.robots import RobotDescription


@cache
def plain() -> RobotDescription:
    """Description of the robot that most cases change."""
    return RobotDescription.from_mjcf(biped())
