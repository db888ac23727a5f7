"""`Clusters`: ranges of stiffness, the classes of a classifier."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.core.errors import Array, InputError, finite_array, finite_scalar, positive, whole_number
from wbc.core.settings import settings
from wbc.feet.soles.actuator import SOFTEST, STIFFEST


@settings
class Clusters:
    """Neighbouring ranges of stiffness, numbered from 1.

    Attributes:
        edges: Boundaries, ascending from 0 or above, Nm/rad; a stiffness on a boundary belongs to the range above it,
            the last boundary to the last range.
    """

    edges: Annotated[tuple[float, ...], "Nm/rad"]

    def __post_init__(self) -> None:
        if len(self.edges) < 3 or self.edges[0] < 0.0 or (np.diff(self.edges) <= 0.0).any():
            raise InputError(
                f"edges of at least two stiffness clusters must ascend from 0 Nm/rad or above, got {self.edges}"
            )

    @classmethod
    def linear(cls, width: float = 4.0, count: int = 20) -> Clusters:
        """Return ranges of one width from 0, Nm/rad.

        Source: 20 clusters of 4 Nm/rad, the paper, section IV-B.
        """
        step = positive("width of a stiffness cluster (Nm/rad)", width)
        return cls(
            tuple(step * i for i in range(whole_number("number of stiffness clusters", count, low=2) + 1))
        )

    @classmethod
    def logarithmic(cls, low: float = SOFTEST, high: float = STIFFEST, count: int = 10) -> Clusters:
        """Return a range below `low`, then ranges whose boundaries have a fixed ratio up to `high`, Nm/rad.

        Walks depend on the order of magnitude of the stiffness: 40 and 80 Nm/rad hardly differ.
        """
        first = positive("lowest boundary (Nm/rad)", low)
        last = finite_scalar("highest boundary (Nm/rad)", high, low=first, open_low=True)
        return cls(
            (
                0.0,
                *np.geomspace(
                    first, last, whole_number("number of stiffness clusters", count, low=2)
                ).tolist(),
            )
        )

    def __len__(self) -> int:
        return len(self.edges) - 1

    @property
    def centres(self) -> Array:
        """Middle of each range, its command, shape (number of clusters,), Nm/rad.

        The mean of the boundaries where all ranges have one width or the range begins at 0, else the geometric mean.
        """
        low, high = np.array(self.edges[:-1]), np.array(self.edges[1:])
        width = high - low
        linear = (low == 0.0) | np.full(low.shape, np.allclose(width, width[0]))
        return np.asarray(np.where(linear, (low + high) / 2.0, np.sqrt(low * high)))

    def of(self, stiffness: ArrayLike) -> NDArray[np.intp]:
        """Return the number of the range of each stiffness, from 1.

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
