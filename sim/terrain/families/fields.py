"""Grounds given by heights alone: filtered noise, a road spectrum, corrugated sheets."""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from wbc.base.errors import InputError
from wbc.base.numbers import Array
from wbc.base.settings import Positive
from wbc.sim.terrain.families.base import FieldFamily, family, param
from wbc.sim.terrain.families.site import Site, cells

ISO_REFERENCE = 0.1
"""Reference spatial frequency n0 of ISO 8608, cycles/m."""

ISO_LIMITS = tuple(32e-6 * 4.0**k for k in range(7))
"""Upper limits of Gd(n0) for road classes A to G of ISO 8608, m³; H lies above."""


@family("random")
class Random(FieldFamily):
    """White noise through a first-order low-pass, constant across the track, as in the paper.

    The paper prints cut-offs "0.0001 … 0.1 m⁻¹"; as cycles per metre those would be waves of 10 km to 10 m on a
    track of 3 m. The authors' public profiles agree with a ratio to the Nyquist frequency of their 7 mm grid,
    which is what `cutoff` is; `describe` reports the spatial frequency beside it. Below about 1e-3 the ground is
    a random walk and hardly changes any more.
    """

    cutoff: Annotated[float, Field(gt=0.0, le=0.99)] = param(0.01, "Cut-off over the Nyquist frequency")
    # Three samples, so that the grid of the noise itself is what is needed.
    spacing: Annotated[Positive, "m"] = param(0.007, "Distance between noise samples", feature=3.0)

    @property
    def grid(self) -> float:
        return self.spacing

    def facts(self, site: Site) -> dict[str, Any]:
        spacing = site.length / cells(site.length, self.spacing)
        frequency = self.cutoff / (2.0 * spacing)
        return {"cutoff_cycles_per_m": frequency, "cutoff_wavelength_m": 1.0 / frequency}

    def heights(self, site: Site, x: Array, y: Array) -> Array:
        count = cells(site.length, self.spacing) + 1
        z = low_pass(site.draws.uniform(-1.0, 1.0, count), self.cutoff)
        return np.interp(x, np.linspace(site.x0, site.x1, count), z)


def low_pass(signal: Array, cutoff: float) -> Array:
    """Filter a signal, shape (n,), with a first-order Butterworth low-pass, from rest.

    The cut-off is the half-power frequency over the Nyquist frequency, below 1.
    """
    from scipy.signal import butter, lfilter  # noqa: PLC0415 - slow to import

    return np.asarray(lfilter(*butter(1, cutoff), signal))


@family("iso8608")
class Iso8608(FieldFamily):
    """Sum of waves with the spectrum of a road, Gd(n) = Gd(n0) (n/n0)^-waviness, between two spatial frequencies.

    Here the frequency truly varies: `low` and `high` are waves per metre. The amplitude sets the scale, so that
    Gd(n0) and the ISO class follow from it and are reported.
    """

    low: Annotated[Positive, "1/m"] = param(0.5, "Longest waves, per metre")
    high: Annotated[Positive, "1/m"] = param(5.0, "Shortest waves, per metre")
    waviness: Annotated[float, Field(ge=0.0, le=6.0)] = param(2.0, "Exponent of the spectrum; ISO 8608 has 2")
    isotropic: bool = param(False, "Waves of every heading; otherwise constant across the track")
    waves: Annotated[int, Field(ge=2, le=2000)] = param(64, "Number of waves")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.low >= self.high:
            raise InputError(f"iso8608: low ({self.low:g} 1/m) must be below high ({self.high:g} 1/m)")

    @property
    def smallest_feature(self) -> float:
        return 0.5 / self.high

    def check_track(self, length: float, width: float) -> None:
        if self.high * length < 1.0:
            raise InputError(
                f"iso8608: high ({self.high:g} 1/m) leaves no whole wave on a track of {length:g} m"
            )

    def facts(self, site: Site) -> dict[str, Any]:
        raw, _ = self.sample(site, self.grid)
        gd = (site.amplitude / float(raw.max() - raw.min())) ** 2
        if self.isotropic:  # of the waves; a track across them has less
            return {"gd_n0_m3": gd}
        return {"gd_n0_m3": gd, "iso_class": "ABCDEFGH"[sum(gd > limit for limit in ISO_LIMITS)]}

    def heights(self, site: Site, x: Array, y: Array) -> Array:
        width = (self.high - self.low) / self.waves
        n = self.low + width * (np.arange(self.waves) + 0.5)
        # Amplitudes for Gd(n0) = 1 m³: each wave carries the variance Gd dn.
        size = np.sqrt(2.0 * (n / ISO_REFERENCE) ** -self.waviness * width)
        phase = site.draws.uniform(0.0, math.tau, self.waves)
        heading = site.draws.uniform(0.0, math.tau, self.waves) if self.isotropic else np.zeros(self.waves)
        across = y if self.isotropic else np.zeros((1, 1))
        z = np.zeros(np.broadcast_shapes(x.shape, across.shape))
        for ni, ai, pi, hi in zip(n, size, phase, heading, strict=True):
            z += ai * np.cos(math.tau * ni * (x * math.cos(hi) + across * math.sin(hi)) + pi)
        return z


@family("metal_sheets")
class MetalSheets(FieldFamily):
    """Corrugated iron sheets with their ridges across the track."""

    period: Annotated[Positive, "m"] = param(0.076, "Ridge to ridge", feature=0.5)

    default_amplitude = 0.02

    def heights(self, site: Site, x: Array, y: Array) -> Array:
        phase = float(site.draws.uniform(0.0, math.tau, 1)[0])
        return np.sin(math.tau * (x - site.x0) / self.period + phase)
