"""Features of a stiffness model: roughness parameters and powers of them."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.core.errors import Array, InputError, choose, finite_array
from wbc.feet.stiffness.roughness import PARAMETERS

PAPER_FEATURES = ("Sp", "P", "P^2", "Sku^3", "P^3", "Sp^3")
"""Features of the paper, section IV-B."""

LINES = "lines"
"""1 / (1 − K): effective number of lines in the spectrum; 2 for one wave, the number of samples for white noise."""

_BASES = (*PARAMETERS, LINES)


class FeatureSet:
    """Features computed from roughness parameters.

    A feature is a parameter ("Sp"), one of its powers ("Sp^3"), its square root ("sqrt(P)") or "lines", which is
    1 / (1 − K).
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        """Read the names; `InputError` for none, one that is named twice, or one that is no feature."""
        if not names or len(set(names)) < len(names):
            raise InputError(
                f"features must be named once each, at least one, got {', '.join(names) or 'none'}"
            )
        base, power = zip(*map(_parse, names), strict=True)
        self._base: NDArray[np.intp] = np.array(base)
        self._power: Array = np.array(power)

    def __call__(self, values: ArrayLike) -> Array:
        """Return the features, shape (…, n), of roughness parameters in the order of `PARAMETERS`, shape (…, 10)."""
        given = finite_array("roughness parameters", values)
        if given.ndim < 1 or given.shape[-1] != len(PARAMETERS):
            raise InputError(
                f"roughness parameters must have shape (…, {len(PARAMETERS)}), got {given.shape}"
            )
        # K of a real profile is below 1 − 1 / samples; the floor is for values of K that no profile has.
        lines = 1.0 / np.maximum(1.0 - given[..., -1:], 1e-6)
        return np.asarray(np.concatenate([given, lines], axis=-1)[..., self._base] ** self._power)


def _parse(name: str) -> tuple[int, float]:
    """Return the index of the parameter among parameters and lines, and its power."""
    found = re.fullmatch(r"sqrt\((?P<root>\w+)\)|(?P<base>\w+)(\^(?P<power>[2-9]))?", name)
    if found is None or found["root"] == "Ssk":  # which can be negative
        raise InputError(
            f"feature '{name}' must be a parameter, a power such as 'Sp^3' or a root such as 'sqrt(P)'"
        )
    base = choose("roughness parameter", found["root"] or found["base"], _BASES)
    return _BASES.index(base), 0.5 if found["root"] else float(found["power"] or 1.0)
