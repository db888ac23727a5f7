"""Live views in the browser, and the controls of a run.

    with MeshcatView(plant) as view:  # or a MujocoLoop, or a description and update(state, measurement=…)
        while plant.time < 10.0:
            plant.step(control.command(plant.measure()))
            view.update()

    with Workbench(plant, control) as view:  # the same, with controls of everything that the run has
    walk(spec, hooks=[WatchWalk()])     # a simulated walk, with its footsteps
    walk(spec, hooks=[RepeatWalk(interventions_of("walk.arrow"))])  # once more, with what was changed from the page

What is drawn lives in `wbc.app.scene`; a new control of a run goes into `wbc.app.view.controls`. Who may open a page
and change the run, see `wbc.app.view.guard`. Names are loaded when they are used: the process that serves a page needs
no simulator.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wbc.app.address import PortError, ViewError
    from wbc.app.view.controls import LiveControls, RepeatWalk, interventions_of
    from wbc.app.view.meshcat_view import MeshcatView
    from wbc.app.view.walk_hook import WatchWalk, open_view
    from wbc.app.view.workbench import Workbench

__all__ = [
    "LiveControls",
    "MeshcatView",
    "PortError",
    "RepeatWalk",
    "ViewError",
    "WatchWalk",
    "Workbench",
    "interventions_of",
    "open_view",
]


_MODULES = {
    "wbc.app.address": ("PortError", "ViewError"),
    "wbc.app.view.controls": ("LiveControls", "RepeatWalk", "interventions_of"),
    "wbc.app.view.meshcat_view": ("MeshcatView",),
    "wbc.app.view.walk_hook": ("WatchWalk", "open_view"),
    "wbc.app.view.workbench": ("Workbench",),  # needs an extra
}


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names:
            return getattr(importlib.import_module(module), name)
    raise AttributeError(f"module 'wbc.app.view' has no attribute '{name}'")
