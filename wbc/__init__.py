"""Whole-body QP control for humanoids.

Tasks, contacts and limits become one quadratic program (QP) over Pinocchio dynamics, solved at every control tick; a
MuJoCo plant with rigid, soft or variable-stiffness feet stands in for the machine. The names of first programs are
listed in `__init__.pyi` and loaded when they are used; everything else is in `wbc.tasks`, `wbc.robots`, `wbc.feet`,
`wbc.walking`, `wbc.motion`, `wbc.machine`, `wbc.sim` and `wbc.app`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
