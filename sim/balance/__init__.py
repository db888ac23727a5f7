"""Simulated balance: stands, push recovery, and motions that are tracked.

A new kind of experiment on a standing robot goes here, as a module with its spec, its result and one function.
"""
