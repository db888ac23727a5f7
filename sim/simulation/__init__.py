"""The `Simulation` of a robot, whoever simulates it: state, sensors, pushes, step, reset and hold.

`wbc.Plant` (MuJoCo with our feet), a MuJoCo model of a user and other engines derive from it: they say how the robot is
put somewhere, advanced, and read. A new sensor error goes to `sensors`, a new property of the machine to `machine`.
"""
