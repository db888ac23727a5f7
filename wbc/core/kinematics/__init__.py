"""Inverse kinematics: the tasks, contacts and limits of a controller, at first order.

`inverse` holds what a user calls, `assembly` the QP of a step and strict priorities, `reach` the search for a
configuration.
"""
