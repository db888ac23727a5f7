"""Footsteps: plans, their gait, the reach of the legs, and sources that plan them while the robot walks.

A new way to lay footsteps goes into `planners`, one that a steered robot is asked by into `sources`.
"""
