"""Planned steps: phases by contact and time, preview control of the ZMP, step adjustment.

`source` is what a control follows, `walk` puts the parts together. A rule for when feet lift or land goes into `walk`;
a pattern generator: beside `preview`.
"""
