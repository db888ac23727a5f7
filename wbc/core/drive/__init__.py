"""Drives: one tick of them (`control`), their modes (position, torque, hybrid), the limits of commands, and servos.

Each mode is a `wbc.core.drive.control.DriveControl`.
"""
