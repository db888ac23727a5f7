"""Stiffness from roughness: a model of nearest neighbours. One of another kind is a policy of `wbc.tasks`."""
