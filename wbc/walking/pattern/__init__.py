"""Reference motion: preview control of the ZMP, swing foot and support height.

A new pattern generator is a file here that hands out CoM, DCM and ZMP references.
"""
