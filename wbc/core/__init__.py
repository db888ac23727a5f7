"""Core: robot model, contacts, limits, the QP and its controller, estimation, and the values that all rooms share.

The QP is in `qp`, its limits in `limits`, the observer in `estimation`; what several rooms share is a file here.
"""
