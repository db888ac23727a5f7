"""Defaults derived from a robot model: soles, half-sitting posture, servo gains, inertias."""
