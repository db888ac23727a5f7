"""DCM stabilizer: feedback, wrench distribution, admittances, lean, bias estimator and their gains.

A new feedback law or filter is a file here, with its gains in `gains`.
"""
