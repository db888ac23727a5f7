"""Simulated standing: the balance controller, standing trials and push recovery."""
