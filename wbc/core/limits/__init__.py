"""Limits: rows of the QP that keep joints, torques, links and the centre of mass within bounds.

A new limit is a file here with a subclass of `wbc.core.limits.base.Limit`.
"""
