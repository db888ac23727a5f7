"""Remarks on how a robot was read and derived."""

from __future__ import annotations

from collections.abc import Sequence

UNMODELLED = "not in the controller's model: "
"""Beginning of a note on a force that the controller does not know of."""


def listed(names: Sequence[str]) -> str:
    """Return the first of some names, and how many more there are."""
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
