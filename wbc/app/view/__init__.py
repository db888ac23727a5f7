"""Live views in the browser or in a window, and the controls of a run.

    with MeshcatView(plant) as view:  # or a MujocoLoop, or a description and update(state, measurement=…)
        while plant.time < 10.0:
            plant.step(control.command(plant.measure()))
            view.update()

    with Workbench(plant, control) as view:  # the same, with controls of everything that the run has
    walk(spec, hooks=[RerunView(speed=1.0)])  # a simulated walk, with its footsteps: a view is a hook

Robot, feet, ground and things are the geoms of one MuJoCo model (`meshes`); everything else is a mark (`marks`,
`walk_marks`). A new control of a run goes into `controls`; a new viewer is a `View` and a line in `VIEWERS`.
"""

from typing import Literal

Viewer = Literal["meshcat", "workbench", "rerun", "mujoco"]
"""Names of the live views: the page of MeshCat shows the run, that of the workbench changes it, that of Rerun keeps it;
mujoco is the window of MuJoCo's viewer."""

VIEWERS = {
    "meshcat": "MeshcatView",
    "workbench": "Workbench",
    "rerun": "RerunView",
    "mujoco": "MujocoView",
}
"""Class of each live view, a name of `wbc.app`, which imports it when a run is shown: some need an extra."""
