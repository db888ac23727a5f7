"""Trials: one base of runs, of specs and of results, used by stands, walks, motions and studies.

A part that any trial can have, such as pushes, goes here. A new kind of experiment goes into a room of its own.
"""
