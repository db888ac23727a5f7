"""Loops of one's own: somebody else's MuJoCo model and data as a plant of this library.

A new kind of drive goes to `actuators`, a new signal to `mujoco_loop`.
"""
