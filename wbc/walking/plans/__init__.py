"""Footsteps: plans, their gait, the reach of the legs, and sources that plan them while the robot walks.

gait, footsteps    timings and shape of a step; a plan of steps
swing              the foot in the air
leg, reach         the leg of a robot, what a swing asks of it, and the steps within its reach
check              the check of a plan
sources            who is asked for steps while the robot walks; a planner for a steered robot goes here
planners           plans from a distance, a velocity or a stair; a new one goes here
"""
