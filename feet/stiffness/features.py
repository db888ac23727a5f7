"""Features of stiffness models: powers of roughness parameters, and the selection of independent ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import qr, svd

from wbc.core.errors import Array, InputError, choose, finite_array, finite_scalar
from wbc.core.settings import settings
from wbc.feet.stiffness.roughness import PARAMETERS

PAPER_FEATURES = ("Sp", "P", "P^2", "Sku^3", "P^3", "Sp^3")
"""Features of the paper, section IV-B."""

WINDOW_FEATURES = ("sqrt(Sz)", "sqrt(P)", "Ssk", "Sku", "lines")
"""Features for the short profile of one swing, chosen here: without powers, which give rare bumps too much weight."""

LINES = "lines"
"""1 / (1 − K): effective number of lines in the spectrum; 2 for one wave, the number of samples for white noise."""

_BASES = (*PARAMETERS, LINES)
_SIGNED = ("Ssk",)


@settings
class FeatureSet:
    """Features computed from roughness parameters.

    A feature is a parameter ("Sp"), one of its powers ("Sp^3"), its square root ("sqrt(P)") or "lines", which is
    1 / (1 − K).

    Attributes:
        names: The features.
    """

    names: tuple[str, ...]

    def __post_init__(self) -> None:
        if not self.names:
            raise InputError("at least one feature is needed")
        if len(set(self.names)) != len(self.names):
            raise InputError(f"features must be named once each, got {', '.join(self.names)}")
        for name in self.names:
            _parse(name)

    @cached_property
    def _base_and_power(self) -> tuple[NDArray[np.intp], Array]:
        parsed = [_parse(name) for name in self.names]
        return np.array([base for base, _ in parsed]), np.array([power for _, power in parsed])

    def __call__(self, values: ArrayLike) -> Array:
        """Return the features, shape (…, n), of roughness parameters in the order of `PARAMETERS`, shape (…, 10).

        Raises `InputError` for a wrong shape, NaN or infinity.
        """
        given = finite_array("roughness parameters", values)
        if given.ndim < 1 or given.shape[-1] != len(PARAMETERS):
            raise InputError(
                f"roughness parameters must have shape (…, {len(PARAMETERS)}), got {given.shape}"
            )
        base, power = self._base_and_power
        # K of a real profile is below 1 − 1 / samples; the floor is for values of K that no profile has.
        lines = 1.0 / np.maximum(1.0 - given[..., -1:], 1e-6)
        return np.asarray(np.concatenate([given, lines], axis=-1)[..., base] ** power)


def _parse(name: str) -> tuple[int, float]:
    """Return the index of the parameter among parameters and lines, and its power."""
    base, power = name, 1.0
    if name.startswith("sqrt(") and name.endswith(")"):
        base, power = name[5:-1], 0.5
        if base in _SIGNED:
            raise InputError(f"feature '{name}': {base} can be negative and has no square root")
    elif "^" in name:
        base, _, text = name.partition("^")
        if not text.isdigit() or int(text) < 2:
            raise InputError(
                f"feature '{name}': the power must be a whole number of at least 2, got '{text}'"
            )
        power = float(text)
    return _BASES.index(choose("roughness parameter", base, _BASES)), power


def power_names(powers: Sequence[int] = (1, 2, 3)) -> tuple[str, ...]:
    """Return the names of the parameters and their powers, in order of the powers."""
    return tuple(name if p == 1 else f"{name}^{p}" for p in powers for name in PARAMETERS)


@dataclass(frozen=True)
class Selection:
    """Result of a feature selection.

    Attributes:
        kept: Selected features, the most independent first.
        candidates: All features that were offered.
        constant: Features without variance, left out.
        twins: Pairs (left out, kept) of features that are the same up to a factor, such as M = Sq^2.
        singular_values: Singular values of the scaled matrix of the other features, the largest first.
        condition: Condition number of that matrix; infinite where the features depend on each other.
        kept_condition: Condition number of the matrix of the selected features.
        diagonal: |R| of the pivoted QR for the selected features: the independent part of each.
    """

    kept: tuple[str, ...]
    candidates: tuple[str, ...]
    constant: tuple[str, ...]
    twins: tuple[tuple[str, str], ...]
    singular_values: tuple[float, ...]
    condition: float
    kept_condition: float
    diagonal: tuple[float, ...]


def select_features(values: ArrayLike, *, powers: Sequence[int] = (1, 2, 3), bound: float = 5.0) -> Selection:
    """Select features by rank and pivoted QR, as in the paper's section IV-B.

    The columns are scaled to a mean of 0 and a deviation of 1, because a QR with pivoting takes the longest column
    first and the parameters differ in magnitude. The rank is the number of singular values within `bound` of the
    largest. QR with column pivoting then orders the columns: next is always the one with the largest part that the
    columns before it do not explain. The first `rank` columns are selected. Of equally long columns, the one with the
    largest share in the first singular vector is first, so the selection depends neither on units nor on the order of
    the profiles. The best stiffness is not used.

    Args:
        values: Roughness parameters of the profiles, shape (n, 10).
        powers: Powers of the parameters that are offered.
        bound: Largest condition number. On windows of this library's grounds 5 selects 6 of 30 columns, as many as the
            paper.

    Raises:
        InputError: Fewer than two profiles, wrong shape, NaN, or no feature that varies.

    Source: Golub & Van Loan, Matrix Computations, sections 5.4.2 (column pivoting) and 5.5.7 (subset selection).
    """
    finite_scalar("condition number", bound, low=1.0)
    given = finite_array("roughness parameters", values)
    if given.ndim != 2 or given.shape[0] < 2:
        raise InputError(
            f"roughness parameters of two profiles or more are needed, shape (n, 10), got {given.shape}"
        )
    candidates = power_names(powers)
    matrix = FeatureSet(candidates)(given)
    varies = matrix.std(axis=0) > 1e-12 * np.abs(matrix).max(axis=0)
    if not varies.any():
        raise InputError(f"nothing changes over the {given.shape[0]} profiles: no feature can be selected")
    constant = tuple(n for n, v in zip(candidates, varies, strict=True) if not v)
    names = [n for n, v in zip(candidates, varies, strict=True) if v]
    matrix = matrix[:, varies]
    names, scaled, twins = _without_twins(names, (matrix - matrix.mean(axis=0)) / matrix.std(axis=0))
    _, sigma, vt = svd(scaled, full_matrices=False)
    sigma = np.where(sigma > sigma[0] * max(scaled.shape) * np.finfo(float).eps, sigma, 0.0)
    rank = int((sigma * bound >= sigma[0]).sum())
    # Scaled columns are equally long: without this, rounding would choose the first pivot.
    tie_break = 1.0 + 1e-9 * np.abs(vt[0]) / np.abs(vt[0]).max()
    _, r, order = qr(scaled * tie_break, mode="economic", pivoting=True)
    kept = order[:rank]
    kept_sigma = svd(scaled[:, kept], compute_uv=False)
    return Selection(
        kept=tuple(names[i] for i in kept),
        candidates=candidates,
        constant=constant,
        twins=twins,
        singular_values=tuple(sigma.tolist()),
        condition=float(sigma[0] / sigma[-1]) if sigma[-1] > 0.0 else float("inf"),
        kept_condition=float(kept_sigma[0] / kept_sigma[-1]) if kept_sigma[-1] > 0.0 else float("inf"),
        diagonal=tuple(np.abs(np.diag(r))[:rank].tolist()),
    )


def _without_twins(names: list[str], matrix: Array) -> tuple[list[str], Array, tuple[tuple[str, str], ...]]:
    """Return the first of all columns that are multiples of each other: rounding would choose between them."""
    unit = matrix / np.linalg.norm(matrix, axis=0)
    same = np.abs(unit.T @ unit) > 1.0 - 1e-12
    first = np.argmax(same, axis=0)
    twins = tuple((names[j], names[i]) for j, i in enumerate(first) if i != j)
    keep = [j for j, i in enumerate(first) if i == j]
    return [names[j] for j in keep], matrix[:, keep], twins
