"""Live views in the browser, and the controls of a run.

    with MeshcatView(plant) as view:  # or a MujocoLoop, or a description and update(state, measurement=…)
        while plant.time < 10.0:
            plant.step(control.command(plant.measure()))
            view.update()

    with Workbench(plant, control) as view:  # the same, with controls of everything that the run has
    walk(spec, hooks=[WatchWalk()])     # a simulated walk, with its footsteps

Robot, feet, ground and things are the geoms of one MuJoCo model (`meshes`); everything else is a mark (`marks`,
`walk_marks`). A new control of a run goes into `controls`.
"""
