"""Estimation of a robot's state from its sensors.

A new estimator is a file here.
"""
