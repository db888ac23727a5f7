"""Roughness of ground profiles: the ten parameters of the paper's Table III, for many profiles at once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solveh_banded

from wbc.base.checked import checked
from wbc.base.errors import InputError, choose
from wbc.base.numbers import Array, finite_array
from wbc.base.settings import Positive, settings

PARAMETERS = ("Sa", "Sq", "Ssk", "Sku", "Sv", "Sp", "Sz", "M", "P", "K")
"""Names of the parameters, in the order of `Roughness.values`."""

UNITS = ("m", "m", "", "", "m", "m", "m", "m2", "", "")
"""Their units."""

LEAST_SAMPLES = 8
"""Smallest number of samples of a profile: four moments and a spectrum need as many."""

LEVEL = 1e-9
"""Largest deviation from the trend that counts as level, m: far above rounding, far below any ground."""


@settings
class RoughnessSettings:
    """Settings of the roughness parameters.

    A foot does not bend into waves shorter than itself, so the profile is filtered first, by a first-order Butterworth
    low-pass run forwards and backwards. The corner is that of a single pass; both passes together keep half of the
    amplitude of a wave at the corner (−6 dB), and 1/√2 of it (−3 dB) at 0.64 of that frequency.

    Attributes:
        corner: Corner of the filter, cycles/m, by default 1 / length of the soft foot. None for no filter.

    Source: the paper, section IV-A; Gadelmawla et al., J. Mater. Process. Technol. 123 (2002) for the
    amplitude parameters; Hoffman & Krotkov, SPIE 1195 (1989) for M, P and K.
    """

    corner: Annotated[Positive, "cycles/m"] | None = 1.0 / 0.27782


@dataclass(frozen=True, eq=False)
class Roughness:
    """Roughness of one or many profiles.

    With zᵢ the n heights about their trend, Z their discrete Fourier transform over n without its mean, dx the step:

    ====  ======================  ===========================================================
    Sa    mean deviation          mean of abs(z)
    Sq    standard deviation      √ mean z²
    Ssk   skewness                mean z³ / Sq³
    Sku   kurtosis                mean z⁴ / Sq⁴; 3 for a normal distribution, 1.5 for a wave
    Sv    depth                   abs(min z)
    Sp    height                  abs(max z)
    Sz    both                    Sv + Sp
    M     microrelief             variance of z = Σ |Z|² = Sq²
    P     slope                   variance of Δz / dx
    K     spread of the spectrum  1 − Σ |Z|⁴ / (Σ |Z|²)²; 0.5 for a single wave, towards 1 for noise
    ====  ======================  ===========================================================

    Level ground has zero in all of them. The paper's Table III, corrected: as printed it divides inside the sums of Ssk
    and Sku by i + 1 instead of by n in front of them, and has P = Σ f₀² n² |Z|² over n = 0 … N − 1, without 2π and
    beyond the Nyquist frequency.

    Attributes:
        values: The parameters in the order of `PARAMETERS`, shape (…, 10), SI units.
    """

    values: Array

    def __getitem__(self, name: str) -> Array:
        """Return one parameter by name, shape (…)."""
        return np.asarray(self.values[..., PARAMETERS.index(choose("roughness parameter", name, PARAMETERS))])

    def as_dict(self) -> dict[str, float]:
        """Return name → value of a single profile."""
        return dict(zip(PARAMETERS, self.values.tolist(), strict=True))


@checked
def roughness(x: ArrayLike, z: ArrayLike, settings: RoughnessSettings | None = None) -> Roughness:
    """Return the roughness of profiles on a uniform grid.

    Args:
        x: Positions along the walking direction, at least 8, ascending and evenly spaced, shape (n,), m.
        z: Heights, shape (…, n), m.
        settings: Filter.
    """
    corner = (settings or RoughnessSettings()).corner
    places, z = finite_array("places of a profile (m)", x), finite_array("heights of a profile (m)", z)
    if places.ndim != 1 or places.size < LEAST_SAMPLES or z.shape[-1:] != places.shape:
        raise InputError(
            f"x must have shape (n,), n at least {LEAST_SAMPLES}, and z (…, n), got {places.shape} and {z.shape}"
        )
    gaps = np.diff(places)
    step = float(places[-1] - places[0]) / gaps.size
    if step <= 0.0 or np.abs(gaps - step).max() > 1e-4 * step:
        raise InputError(
            f"places of a profile must ascend evenly, got gaps from {gaps.min():g} to {gaps.max():g} m; np.interp puts "
            "heights on a grid"
        )
    z = about_line(z)
    if corner is not None:
        z = about_line(low_pass(z, step, corner))
    z = np.where((np.abs(z).max(axis=-1) <= LEVEL)[..., None], 0.0, z)
    z2 = z * z
    variance = z2.mean(axis=-1)
    sq = np.sqrt(variance)
    per_sq = 1.0 / np.where(sq > 0.0, sq, 1.0)
    weight = np.full(z.shape[-1], 1.0 / z.shape[-1])
    power = np.abs(np.fft.fft(z)[..., 1:]) ** 2  # not over n²: K is a ratio
    total = power.sum(axis=-1)
    spread = 1.0 - (power**2).sum(axis=-1) / np.where(total > 0.0, total, 1.0) ** 2
    sv, sp = np.abs(z.min(axis=-1)), np.abs(z.max(axis=-1))
    values = [
        np.abs(z).mean(axis=-1),
        sq,
        (z2 * z) @ weight * per_sq**3,
        (z2 * z2) @ weight * per_sq**4,
        sv,
        sp,
        sv + sp,
        variance,
        np.diff(z).var(axis=-1) / step**2,
        np.where(total > 0.0, spread, 0.0),
    ]
    return Roughness(np.stack(values, axis=-1))


def about_line(z: Array) -> Array:
    """Return heights on a uniform grid about their least-squares line, shape (…, n), m."""
    z = z - z.mean(axis=-1, keepdims=True)
    t = np.arange(z.shape[-1]) - (z.shape[-1] - 1) / 2.0
    return np.asarray(z - (z @ t / (t @ t))[..., None] * t)


def low_pass(z: Array, step: float, corner: float) -> Array:
    """Return heights after a first-order Butterworth low-pass, forwards and backwards, same shape, m.

    There is no shift, and half the amplitude is left at the corner.

    Both passes of H together have the gain |H|² = 1 / (1 + tan²(π f dx) / κ²) with κ = tan(π corner dx), which is that
    of the tridiagonal system

        (S + D / κ²) y = S z,   S = [1 2 1], D = [-1 2 -1] on neighbouring samples.

    The solution does not depend on the direction of travel. Beyond its ends the ground continues as its mirror image.

    Args:
        z: Heights on a uniform grid, shape (…, n), m.
        step: Distance of the samples, m.
        corner: Corner of one pass, cycles/m, from 1e-6 / step; from the Nyquist frequency 1 / (2 step) on there is no
            filter.

    Source: the paper, section IV-A: "Butterworth design, a cutoff frequency given by the inverse of the foot length".
    """
    if corner >= 0.5 / step:
        return z
    least = 1e-6 / step  # its equations lose the ground in rounding
    if corner < least:
        raise InputError(f"corner (cycles/m) must be at least {least:g}, got {corner:g}")
    bands = _bands(z.shape[-1], corner * step)
    padded = np.concatenate([z[..., :1], z, z[..., -1:]], axis=-1)
    right = padded[..., :-2] + 2.0 * z + padded[..., 2:]
    solved = solveh_banded(bands, right.reshape(-1, z.shape[-1]).T, check_finite=False)
    return np.asarray(solved.T.reshape(z.shape))


@lru_cache(maxsize=32)
def _bands(size: int, corner: float) -> Array:
    """Return the upper bands of S + D / κ² for a corner in cycles per sample, shape (2, size)."""
    d = 1.0 / math.tan(math.pi * corner) ** 2
    bands = np.empty((2, size))
    bands[0], bands[1] = 1.0 - d, 2.0 + 2.0 * d
    bands[1, [0, -1]] = 3.0 + d
    bands.setflags(write=False)
    return bands
