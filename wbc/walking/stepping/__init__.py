"""Walk that balances by its steps: place and time of every step are decided at every tick.

A rule for where or when to step goes into `law`, what the robot does between two steps into `gait`.
"""
