"""Bins of stiffness: what a classifier chooses between, and what each choice commands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.core.errors import Array, InputError, finite_array, finite_scalar, positive


@dataclass(frozen=True)
class Clusters:
    """Neighbouring ranges of stiffness, numbered from 1.

    Attributes:
        edges: Boundaries, ascending from 0 or above, Nm/rad; a stiffness on a boundary belongs to the range above it,
            the last boundary to the last range.
    """

    edges: tuple[float, ...]

    def __post_init__(self) -> None:
        edges = finite_array("edges of the stiffness clusters (Nm/rad)", self.edges)
        if edges.ndim != 1 or edges.size < 3 or edges[0] < 0.0 or (np.diff(edges) <= 0.0).any():
            raise InputError(
                f"edges of at least two stiffness clusters must ascend from 0 Nm/rad or above, got {self.edges}"
            )
        object.__setattr__(self, "edges", tuple(edges.tolist()))

    @classmethod
    def linear(cls, width: float = 4.0, count: int = 20) -> Clusters:
        """Ranges of one width from 0, Nm/rad.

        Source: 20 clusters of 4 Nm/rad, the paper, section IV-B.
        """
        step = positive("width of a stiffness cluster (Nm/rad)", width)
        return cls(tuple(step * i for i in range(_count(count) + 1)))

    @classmethod
    def logarithmic(cls, low: float = 1.0, high: float = 80.0, count: int = 8) -> Clusters:
        """One range below `low`, then ranges whose boundaries have a fixed ratio up to `high`, Nm/rad.

        A walk depends on the order of magnitude of the stiffness: 40 and 80 Nm/rad can hardly be told apart.
        """
        first = positive("lowest boundary (Nm/rad)", low)
        last = finite_scalar("highest boundary (Nm/rad)", high, low=first, open_low=True)
        return cls((0.0, *np.geomspace(first, last, _count(count)).tolist()))

    def __len__(self) -> int:
        return len(self.edges) - 1

    @property
    def centres(self) -> Array:
        """Mean of the boundaries of each range, the stiffness that it commands, shape (number of clusters,), Nm/rad."""
        edges = np.array(self.edges)
        return np.asarray((edges[:-1] + edges[1:]) / 2.0)

    def of(self, stiffness: ArrayLike) -> NDArray[np.intp]:
        """Number of the range of each stiffness, from 1.

        Args:
            stiffness: Nm/rad, any shape.

        Raises:
            InputError: Not finite, or outside all ranges.
        """
        k = finite_array("stiffness (Nm/rad)", stiffness)
        if k.size and (k.min() < self.edges[0] or k.max() > self.edges[-1]):
            raise InputError(
                f"stiffness must lie in the clusters' [{self.edges[0]:g}, {self.edges[-1]:g}] Nm/rad, "
                f"got {k.min():g} to {k.max():g}"
            )
        return np.minimum(np.searchsorted(self.edges, k, side="right"), len(self)).astype(np.intp)


def _count(count: int) -> int:
    if isinstance(count, bool) or int(count) != count or count < 2:
        raise InputError(f"number of stiffness clusters must be a whole number of at least 2, got {count!r}")
    return int(count)
