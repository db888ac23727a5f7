"""Free steps, which balance the robot: place and time of each step are decided while the robot goes.

A rule for the place or the time of steps goes into `law`; what a robot does on both feet is in `stand`, what it does in
a step in `gait`.
"""
