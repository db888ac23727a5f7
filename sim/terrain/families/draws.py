"""Random draws that are the same on every machine and under every NumPy release."""

from __future__ import annotations

import hashlib

import numpy as np

from wbc.core.errors import Array, whole_number


class Draws:
    """One stream of uniform numbers, fixed by a seed and a key; another key is an independent stream.

    NumPy promises stable streams for its bit generators alone (NEP 19: `Generator` methods may change between
    releases), so the raw 64-bit words of PCG64 are turned into doubles here.
    """

    def __init__(self, seed: int, key: str) -> None:
        """Start the stream.

        Args:
            seed: Zero or a positive integer.
            key: Text that tells a ground from all others of the seed: its family, amplitude and parameters.

        Raises:
            InputError: The seed is not an integer, or negative.
        """
        words = np.frombuffer(hashlib.sha256(key.encode()).digest(), dtype="<u4")
        self._bits = np.random.PCG64(
            np.random.SeedSequence([whole_number("seed", seed, low=0), *words.tolist()])
        )

    def uniform(self, low: float, high: float, count: int) -> Array:
        """Draw `count` numbers from [low, high), shape (count,)."""
        words = self._bits.random_raw(count)
        unit = (np.asarray(words, dtype=np.uint64) >> np.uint64(11)) * 2.0**-53
        return np.asarray(low + (high - low) * unit, dtype=np.float64)
