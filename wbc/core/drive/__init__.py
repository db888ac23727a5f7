"""Modes in which drives are commanded (position, torque, hybrid), and the servos in them.

Each mode is a `wbc.core.control.DriveControl`.
"""
