"""Paper: its experiments as studies, its Bayesian optimisation, and what setting a stiffness by the ground can win.

A new experiment is a function in `experiments` with one line in the catalog.
"""
