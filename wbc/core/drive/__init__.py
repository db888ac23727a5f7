"""Drives: the tick of a control (`control`), from estimate (`sensing`) over modes and `failures` to the `gate`; servos.

Each mode is a `wbc.core.drive.control.DriveControl`.
"""
