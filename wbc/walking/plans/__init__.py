"""Footsteps: plans, their gait, the reach of the legs, and sources that plan them while the robot walks.

A new plan of footsteps goes into `planners`; a planner for a steered robot goes into `sources`.
"""
