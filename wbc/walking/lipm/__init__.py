"""Planned steps: phases by contact and time, preview control of the ZMP, step adjustment.

`walk` connects the parts. A rule for the times of lift-off and touch-down goes
into `walk`, a pattern generator into a file beside `preview`.
"""
