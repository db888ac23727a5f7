"""The MuJoCo plant: robot, feet and ground as one simulation with drives, sensors and pushes.

A new sensor error goes to `sensors`, a new setting of the physics to `settings`.
"""
