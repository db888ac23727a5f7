"""Whole-body QP control for humanoids.

Tasks, contacts and limits become one quadratic program (QP) over Pinocchio dynamics. It is solved at every control
tick. A plant simulates the robot in MuJoCo, with rigid, soft or variable-stiffness feet. This package exports the names
that first programs need. They are listed in `__init__.pyi` and imported at their first use. All other names are in
`wbc.tasks`, `wbc.robots`, `wbc.feet`, `wbc.walking`, `wbc.motion`, `wbc.policy`, `wbc.machine`, `wbc.sim` and
`wbc.app`.
"""

import os

import lazy_loader

if os.environ.get("MUJOCO_GL"):
    from wbc.base.drawing import check_opengl

    check_opengl()

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

_ROOMS = ("tasks", "walking", "motion", "policy", "robots", "feet", "ground", "machine", "sim", "app")


def __getattr__(name: str) -> object:
    """Load a public name; another one is an error that names what is meant, in any room."""
    try:
        return _load(name)
    except AttributeError:
        if name in __all__ or name.startswith("_"):
            raise
        from wbc.base.errors import missing_from  # noqa: PLC0415 - for the error alone

        missing_from(__name__, name, [f"{__name__}.{room}" for room in _ROOMS])
