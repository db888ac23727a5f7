"""Foot designs: rigid, soft and variable-stiffness soles, fitted under an ankle and built into a MuJoCo model.

A new foot is a subclass of `Foot` in a file here and one line in `catalog`; code that needs MuJoCo goes to `..._mjcf`.
"""
