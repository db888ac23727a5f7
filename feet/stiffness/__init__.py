"""Stiffness from roughness: roughness parameters, features, training data, model and its validation."""
