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

    def __init__(self, terms: Sequence[Term], observed: Observed) -> None:
        """Make room; an `InputError` for a term whose scale has another length than its values."""
        self._observed = observed
        self._terms = [(TERMS[term.name], np.asarray(term.scale), term.clip) for term in terms]
        sizes = [term(observed).size for term, _, _ in self._terms]
        for term, size in zip(terms, sizes, strict=True):
            if isinstance(term.scale, tuple) and len(term.scale) != size:
                raise InputError(
                    f"scale of the term '{term.name}' must have {size} values, got {len(term.scale)}"
                )
        lengths = [size * term.history for size, term in zip(sizes, terms, strict=True)]
        self.values, self._parts, stop = np.zeros(sum(lengths), np.float32), [], 0
        for size, length in zip(sizes, lengths, strict=True):
            start, stop = stop, stop + length
            self._parts.append(self.values[start:stop].reshape(-1, size))
        self._names = [term.name for term in terms]
        self._fresh = True

    def __str__(self) -> str:
        """Return names and lengths of the terms."""
        named = zip(self._names, self._parts, strict=True)
        return ", ".join(
            f"{name} {part.shape[1]}" + (f" x {len(part)}" if len(part) > 1 else "") for name, part in named
        )

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
