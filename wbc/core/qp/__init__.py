"""The quadratic program (QP) of the controller: tasks, contacts, assembly, solver.

A new kind of task or contact (a base class) goes here; a single task goes into `wbc.tasks`.
"""
