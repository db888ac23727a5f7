"""Families of grounds by name.

A new ground is a class in a file here, decorated with `@family` and imported in `wbc.sim.terrain`.
"""
