"""Core: robot model, contacts, limits, the QP and its controller, estimation, drives.

The QP is in `qp`, its limits in `limits`, the observer in `estimation`, the tick of the drives in `drive`. The
values that all rooms share, such as `Robot`, `Measurement` and `Command`, are files here.
"""
