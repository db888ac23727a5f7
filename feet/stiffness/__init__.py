"""Stiffness from roughness: parameters, features, training data, models, and how well they predict.

A new kind of model is a candidate in `comparison`; what a controller uses is `model.StiffnessModel`.
"""
