"""A few roughness numbers of a ground, for pictures and reports."""

from __future__ import annotations

import numpy as np

from wbc.core.errors import Array


def roughness(z: Array) -> dict[str, float]:
    """Amplitude parameters of a profile or map, taken about its mean.

    Args:
        z: Heights, any shape, m.

    Returns:
        Sa (mean deviation), Sq (standard deviation), Sz (highest minus lowest), all m; Ssk (skewness) and Sku
        (kurtosis, 3 for a normal distribution), 0 for level ground.

    Source: Gadelmawla et al., J. Mater. Process. Technol. 123 (2002).
    """
    d = z - z.mean()
    sq = float(np.sqrt((d**2).mean()))
    moment = (lambda k: float((d**k).mean()) / sq**k) if sq > 0.0 else (lambda k: 0.0)
    return {
        "Sa_m": float(np.abs(d).mean()),
        "Sq_m": sq,
        "Sz_m": float(z.max() - z.min()),
        "Ssk": moment(3),
        "Sku": moment(4),
    }
