"""Stiffness from roughness: parameters of a profile, features of these, and a model of nearest neighbours.

A new feature goes to `features`; a model of another kind is a policy of `wbc.tasks`.
"""
