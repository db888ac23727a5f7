"""Random numbers of the tour, those of C++: `std::mt19937` with the seed of `std::seed_seq`.

Sources: ISO/IEC 14882, [rand.util.seedseq] and [rand.eng.mers]; M. Matsumoto, T. Nishimura, ACM TOMACS 8(1), 1998.
"""

from __future__ import annotations

import numpy as np

WORD = 0xFFFFFFFF
"""Greatest number of 32 bits."""


def seed_sequence(seeds: tuple[int, ...], count: int) -> list[int]:
    """Return the numbers that `std::seed_seq{seeds…}` generates: 32 bits each."""
    size = len(seeds)
    words = [0x8B8B8B8B] * count
    t = (
        11
        if count >= 623
        else 7
        if count >= 68
        else 5
        if count >= 39
        else 3
        if count >= 7
        else (count - 1) // 2
    )
    p = (count - t) // 2
    q, most = p + t, max(size + 1, count)

    def mixed(factor: int, value: int) -> int:
        return factor * (value ^ (value >> 27)) & WORD

    for k in range(most):
        here, ahead, further = k % count, (k + p) % count, (k + q) % count
        first = mixed(1664525, words[here] ^ words[ahead] ^ words[(k - 1) % count])
        own = size if k == 0 else here + (seeds[k - 1] if k <= size else 0)
        second = (first + own) & WORD
        words[ahead] = (words[ahead] + first) & WORD
        words[further] = (words[further] + second) & WORD
        words[here] = second
    for k in range(most, most + count):
        here, ahead, further = k % count, (k + p) % count, (k + q) % count
        third = mixed(1566083941, (words[here] + words[ahead] + words[(k - 1) % count]) & WORD)
        fourth = (third - here) & WORD
        words[ahead] ^= third
        words[further] ^= fourth
        words[here] = fourth
    return words


class Generator:
    """Draws of one stream of a run."""

    def __init__(self, *seeds: int) -> None:
        """Begin as `std::mt19937` does with `std::seed_seq{seeds…}`."""
        words = seed_sequence(seeds, 624)
        if not words[0] >> 31 and not any(words[1:]):
            words[0] = 1 << 31
        self._bits = np.random.MT19937()
        self._bits.state = {
            "bit_generator": "MT19937",
            "state": {"key": np.array(words, dtype=np.uint32), "pos": 624},
        }

    def word(self) -> int:
        """Return the next number of 32 bits."""
        return int(self._bits.random_raw())

    def unit(self) -> float:
        """Return a number in [0, 1), of 24 bits."""
        return (self.word() >> 8) / 2**24

    def between(self, low: float, high: float) -> float:
        """Return a number in [low, high)."""
        return low + (high - low) * self.unit()

    def below(self, count: int) -> int:
        """Return a whole number in [0, count), each as likely."""
        span = 2**32 // count
        while (drawn := self.word()) >= span * count:
            pass
        return drawn // span
