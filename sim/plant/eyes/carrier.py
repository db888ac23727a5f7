"""Carrier of eyes: a plant, as far as its eyes read it."""

from __future__ import annotations

from typing import Protocol

import mujoco

from wbc.core.robot import Robot
from wbc.feet import Foot, FootParts
from wbc.robots.description import RobotDescription
from wbc.sim.plant.physics import PhysicsSettings
from wbc.sim.simulation.machine import Machine
from wbc.sim.terrain.spec import Terrain


class Carrier(Protocol):
    """Attributes of `wbc.Plant` that its eyes read."""

    description: RobotDescription
    robot: Robot
    model: mujoco.MjModel
    data: mujoco.MjData
    seed: int
    machine: Machine
    physics: PhysicsSettings
    foot: Foot
    feet: tuple[FootParts, ...]
    sole_sites: tuple[int, ...]
    terrain: Terrain
    scene: str | None
