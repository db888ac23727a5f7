"""Limits: rows of the QP that keep joints, torques, links and the centre of mass within bounds.

A new limit is a file here with a subclass of `wbc.core.limits.base.Limit`.

Five files hold collisions. `obstacles` has the shapes of links and of the world. `pairs` puts them into one geometry,
and finds which links can touch at all. `separation` bounds distances of pairs that are not measured in this tick, and
tells which pairs must be. `collision` measures those, and has a row for the nearest points of each pair that is near.
`facing` adds the corners of faces that look at each other, because the nearest points of flat faces jump.
"""
