"""Remarks on how a robot was read and derived."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

UNMODELLED = "not in the controller's model: "
"""Beginning of a note on a force that the controller does not know of."""


@dataclass
class Notes:
    """Remarks on how a robot was read and derived, one line each.

    Attributes:
        derived: Values that were derived, and what was left out.
        doubtful: What is doubtful, or in the file and not in the description, such as a force.
    """

    derived: list[str] = field(default_factory=list)
    doubtful: list[str] = field(default_factory=list)


def listed(names: Sequence[str]) -> str:
    """Return the first of some names, and how many more there are."""
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
