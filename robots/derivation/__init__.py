"""Rules that complete a robot description from its model: soles, posture, servo gains, torque limits, inertias.

A new rule is a function of plain values here, called by `RobotDescription.from_urdf`.
"""
