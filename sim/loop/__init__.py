"""Loops of one's own: somebody else's MuJoCo model and data as a plant of this library.

A new kind of drive goes to `actuators`, a new signal to `mujoco_loop`.
"""

from wbc.sim.loop.mujoco_loop import MujocoLoop
from wbc.sim.loop.server import RobotServer, RobotWire
from wbc.sim.loop.shared import SharedPlant

__all__ = ["MujocoLoop", "RobotServer", "RobotWire", "SharedPlant"]
