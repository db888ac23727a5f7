"""Figure of an optimisation: convergence, and slices of the posterior through the best point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from wbc.app.plot.style import AMBER, BLUE, ORANGE, grid, new_figure
from wbc.sim.studies.paper.optimization import NAMES, Walked
from wbc.sim.studies.paper.optimum import Optimum

LABELS = {"k": "k (Nm/rad)", "kP": "kP (1/s)", "kD": "kD"}


def optimum_figure(ground: str, walked: Sequence[Walked], found: Optimum) -> Figure:
    """Draw J over the walks with its running mean of 20, and the posterior along each parameter with ± 2 σ.

    Args:
        ground: Name of the ground, for the title.
        walked: Points and results in the order of asking.
        found: The optimum; its stiffnesses as good as the best are shaded.
    """
    figure = new_figure(12.0, 3.2)
    axes = grid(figure, 1, 4)[0]
    J = np.array([each.J for each in walked])
    axes[0].plot(1 + np.arange(J.size), J, ".", color="0.6", markersize=3.0)
    window = min(20, J.size)
    mean = np.convolve(J, np.full(window, 1.0 / window), mode="valid")
    axes[0].plot(window + np.arange(mean.size), mean, color=BLUE, linewidth=1.4)
    axes[0].set(xlabel="walk", ylabel="J", title=f"{ground.replace('_', ' ')}, {J.size} walks")
    lines = {"k": (found.k, found.mean, found.std), **found.slices}
    for axis, name in zip(axes[1:], NAMES, strict=True):
        values, middle, std = lines[name]
        axis.fill_between(values, middle - 2.0 * std, middle + 2.0 * std, color=BLUE, alpha=0.2, lw=0)
        axis.plot(values, middle, color=BLUE, linewidth=1.4)
        axis.axvline(found.best[name], color=ORANGE, linewidth=1.0)
        axis.set(xlabel=LABELS[name])
        if name == "k":
            for low, high in found.same:
                axis.axvspan(low, high, color=AMBER, alpha=0.2, lw=0)
            if values[0] > 0.0 and values[-1] / values[0] > 100.0:
                axis.set_xscale("log")
    return figure
