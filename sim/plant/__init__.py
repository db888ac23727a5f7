"""The MuJoCo plant: robot, feet and ground in one model, and any robot in MuJoCo (`mujoco_robot`).

A new setting of the physics goes to `physics`; grounds and bodies around the robot enter by `model.surround`.
"""
