"""Sensing of the ground by a swinging foot: range sensor, scan and profile, and the roughness of a profile.

A new sensor is a file here; its place in a MuJoCo model is added in `wbc.feet.soles`.
"""
