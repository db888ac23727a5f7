"""Footsteps: plans, gait, reach of the legs, and the schedule and phases in which feet land.

A new source of footsteps goes into `planners`; a new rule for when feet lift or land into `phases`.
"""
