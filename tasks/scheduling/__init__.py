"""Stiffness scheduling: sets the stiffness of soles before they land.

A new stiffness policy is a class in `policies`, with a line in its register.
"""
