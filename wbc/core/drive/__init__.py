"""Drives: the tick of a control (`control`), its modes (position, torque, hybrid), the limits of commands, and servos.

Each mode is a `wbc.core.drive.control.DriveControl`.
"""
