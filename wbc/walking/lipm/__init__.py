"""Planned steps: phases by contact and time, preview control of the ZMP, step adjustment.

walk            walk: phases, footsteps and references of a tick; begin to read here
steered_steps   footsteps of a velocity or to a goal
schedule        supports of a plan, with ZMP and height of the pendulum; pattern: motion of the pendulum over them
preview         preview control, which plans a pattern; adjustment: place and time of a landing that catches the DCM
settings        settings, and preview and adjustment of one robot
"""
