"""Simulated walks: spec in, result out.

What a walk is asked to do is a field of the spec; a new figure goes to `meter` and `result`.
"""
