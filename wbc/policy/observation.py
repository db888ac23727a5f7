"""Observation of a policy: what its network sees, in the order of its description."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wbc.base.errors import InputError
from wbc.policy.description import Term
from wbc.policy.terms import TERMS, Observed


class Observation:
    """Observation of a policy: its terms, bounded and scaled, each with those of the last ticks of the policy.

    Attributes:
        values: Values of the last ticks, shape (width,).
    """

    def __init__(self, terms: Sequence[Term], observed: Observed, width: int) -> None:
        """Make room for the values that a network takes, `width` in all.

        Raises:
            InputError: A term whose scale has another length than its values, or terms of another width together.
        """
        self._observed = observed
        self._terms = [(TERMS[term.name], np.asarray(term.scale), term.clip) for term in terms]
        sizes = [term(observed).size for term, _, _ in self._terms]
        for term, size in zip(terms, sizes, strict=True):
            if isinstance(term.scale, tuple) and len(term.scale) != size:
                raise InputError(
                    f"scale of the term '{term.name}' must have {size} values, got {len(term.scale)}"
                )
        lengths = [size * term.history for size, term in zip(sizes, terms, strict=True)]
        if sum(lengths) != width:  # before room is made: a history may be long
            named = ", ".join(
                f"{term.name} {size}" + (f" x {term.history}" if term.history > 1 else "")
                for term, size in zip(terms, sizes, strict=True)
            )
            raise InputError(
                f"the network has observations of {width} values, and the description of {sum(lengths)}: {named}"
            )
        self.values, self._parts, stop = np.zeros(width, np.float32), [], 0
        for size, length in zip(sizes, lengths, strict=True):
            start, stop = stop, stop + length
            self._parts.append(self.values[start:stop].reshape(-1, size))
        self._fresh = True

    def reset(self) -> None:
        """Forget what was seen: the next terms fill their whole history."""
        self._fresh = True

    def take(self) -> NDArray[np.float32]:
        """Read all terms, and return a copy of the values."""
        for part, (term, scale, clip) in zip(self._parts, self._terms, strict=True):
            values = term(self._observed)
            if clip is not None:
                values = np.clip(values, -clip, clip)
            values = values * scale
            if self._fresh:
                part[:] = values
            else:
                part[:-1] = part[1:]
                part[-1] = values
        self._fresh = False
        return self.values.copy()
