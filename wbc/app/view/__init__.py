"""Live view in the browser: page, drawing process and the controls of a run.

    with MeshcatView(plant) as view:  # or a MujocoLoop, or a description and update(state, measurement=…)
        while plant.time < 10.0:
            plant.step(control.command(plant.measure()))
            view.update()

    walk(spec, hooks=[WatchWalk()])     # a simulated walk, with its footsteps

What is drawn lives in `wbc.app.scene`; a new control of the page goes into `wbc.app.view.controls`. Who may
open the page and change the run, see `wbc.app.view.guard` and `wbc.app.view.server`.
"""

from wbc.app.address import PortError, ViewError
from wbc.app.view.meshcat_view import MeshcatView
from wbc.app.view.walk_hook import WatchWalk

__all__ = ["MeshcatView", "PortError", "ViewError", "WatchWalk"]
