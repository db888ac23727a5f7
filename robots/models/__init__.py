"""Built-in robots, a function each that returns its `RobotDescription`.

A new one is a module here and a line in `wbc.robots.registry`.
"""
