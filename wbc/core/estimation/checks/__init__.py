"""Checks of measurements: of each reading by itself, in every tick, and of sensors against each other.

`wbc.core.drive.sensing` has their order in a tick. A new check is a file here.
"""
