"""The DCM stabilizer: feedback, wrench distribution, foot admittance, step adjustment and their gains.

A new feedback law or filter is a file here, with its gains in `gains`.
"""
