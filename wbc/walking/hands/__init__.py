"""Hands that press on things: the state of each, and what their forces do to the balance."""
