"""Scheduling of sole stiffness: the stiffness-scheduling task and its policies. A new policy goes to `policies`."""
