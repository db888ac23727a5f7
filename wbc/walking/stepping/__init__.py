"""Free steps, which balance the robot: place and time of each step are decided while the robot goes.

Read `gait` first: it has the order of a tick. A rule for the place or the time of steps goes into `law`; what a robot
does on both feet is in `double_support`, what it does in a step in `single_support`.
"""
