"""Grounds to walk on: named families of rough terrain with one height query for simulation, tests and pictures.

    >>> ground = terrain("stones", amplitude=0.03, seed=1)
    >>> float(ground.height(0.0, 0.0))
    0.0

A new kind of ground goes into `families/`; `add_to_spec` draws a terrain into a MuJoCo model.
"""

from wbc.sim.terrain.families import fields, image, obstacles, patchwork, paving, stairs, stones  # noqa: F401 - registers the families
