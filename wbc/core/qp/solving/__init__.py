"""Solving of a tick's quadratic program (QP): its problem, the ladder of solvers, and the solution.

The problem comes from `wbc.core.qp.assembly`; nothing here knows of tasks or contacts.
"""
