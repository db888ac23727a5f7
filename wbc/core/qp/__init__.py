"""Tasks, contacts and the controller: what becomes one quadratic program (QP), and what solves it.

A new kind of task or contact (a base class) goes here; a task itself goes to `wbc.tasks`.
"""
