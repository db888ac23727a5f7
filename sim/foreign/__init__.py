"""Simulations of somebody else's model or engine: a MuJoCo model of a user, another engine, several robots in one.

A new kind of drive goes to `actuators`; what is noted of a model, to `notes`.
"""
