"""Trained policies beside the QP: descriptions, observations, networks, and the control that runs them.

    description → observation (terms, references) → network → joints (targets) → control (arms, filter, drives) → guard

A new term of an observation goes into `wbc.policy.terms`, another way in which files describe policies into
`wbc.policy.description`.
"""

from wbc.policy.contacts import FootContacts
from wbc.policy.control import PolicyControl
from wbc.policy.description import PolicyDescription, Term
from wbc.policy.filter import PolicyFilter
from wbc.policy.guard import PolicyGuard
from wbc.policy.network import Network, OnnxNetwork
from wbc.policy.references import HeightScan, Tracked
from wbc.policy.terms import TERMS, Observed

__all__ = [
    "TERMS",
    "FootContacts",
    "HeightScan",
    "Network",
    "Observed",
    "OnnxNetwork",
    "PolicyControl",
    "PolicyDescription",
    "PolicyFilter",
    "PolicyGuard",
    "Term",
    "Tracked",
]
