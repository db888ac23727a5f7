"""Servos in the drives of a robot, and hybrid control: torques with the machine's own servos around them."""
