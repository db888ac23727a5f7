"""Planned steps: phases by contact and time, preview control of the ZMP, step adjustment.

walk            walk: who plans the footsteps, contacts, and references of a tick; begin to read here
feet            places, swing and drift of the feet: lift-off, changes of a landing, touch-down
phases          plan as it is now, and the phase that it is in
steered_steps   footsteps of a velocity or to a goal
schedule        supports of a plan, with ZMP and height of the pendulum; pattern: motion of the pendulum over them
preview         preview control, which plans a pattern, and the way over to it from the one before
adjustment      place and time of a landing that catches the DCM
settings        settings, and preview and adjustment of one robot
"""
