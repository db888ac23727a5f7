"""Figures of optimisations: convergence, slices of the posterior through the best point, and grounds side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from wbc.app.plot.style import AMBER, BLUE, ORANGE, grid, new_figure
from wbc.sim.studies.paper.optimization import NAMES, Walked
from wbc.sim.studies.paper.optimum import Optimum

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LABELS = {"k": "k (Nm/rad)", "kP": "kP (1/s)", "kD": "kD"}


def optimum_figure(ground: str, walked: Sequence[Walked], found: Optimum) -> Figure:
    """Draw J over the walks with its running mean of 20, and the posterior along each parameter with ± 2 σ.

    Points and results are in the order of asking; stiffnesses as good as the best are shaded.
    """
    figure = new_figure(12.0, 3.2)
    axes = grid(figure, 1, 4)[0]
    J = np.array([each.J for each in walked])
    axes[0].plot(1 + np.arange(J.size), J, ".", color="0.6", markersize=3.0)
    window = min(20, J.size)
    mean = np.convolve(J, np.full(window, 1.0 / window), mode="valid")
    axes[0].plot(window + np.arange(mean.size), mean, color=BLUE, linewidth=1.4)
    axes[0].set(xlabel="walk", ylabel="J", title=f"{ground.replace('_', ' ')}, {J.size} walks")
    for axis, name in zip(axes[1:], NAMES, strict=True):
        _slice(axis, name, found)
    return figure


def stiffness_figure(walked: Mapping[str, Sequence[Walked]], found: Mapping[str, Optimum]) -> Figure:
    """Draw J over the stiffness for each ground: walks at all gains, and the posterior ± 2 σ at the best gains.

    Stiffnesses as good as the best are shaded.
    """
    columns = min(4, len(found))
    rows = math.ceil(len(found) / columns)
    figure = new_figure(3.0 * columns, 0.6 + 2.0 * rows)
    axes = [axis for row in grid(figure, rows, columns, sharex=True, sharey=True) for axis in row]
    for axis, (ground, each) in zip(axes, found.items(), strict=False):
        shares = [point.unit[0] for point in walked[ground]]
        k = np.interp(shares, np.linspace(0.0, 1.0, each.k.size), each.k)
        axis.plot(k, [point.J for point in walked[ground]], ".", color="0.6", markersize=3.0)
        _slice(axis, "k", each)
        axis.set(title=ground.replace("_", " "), xlabel="", ylim=(-230.0, 30.0))
        axis.tick_params(labelbottom=True)
    for axis in axes[len(found) :]:
        axis.set_visible(False)
    figure.supxlabel(LABELS["k"])
    figure.supylabel("J")
    return figure


def _slice(axis: Axes, name: str, found: Optimum) -> None:
    """Draw the posterior along one parameter, through the best point."""
    values, middle, std = (found.k, found.mean, found.std) if name == "k" else found.slices[name]
    axis.fill_between(values, middle - 2.0 * std, middle + 2.0 * std, color=BLUE, alpha=0.2, lw=0)
    axis.plot(values, middle, color=BLUE, linewidth=1.4)
    axis.axvline(found.best[name], color=ORANGE, linewidth=1.0)
    axis.set(xlabel=LABELS[name])
    if name == "k":
        for low, high in found.same:
            axis.axvspan(low, high, color=AMBER, alpha=0.2, lw=0)
        if values[0] > 0.0 and values[-1] / values[0] > 100.0:
            axis.set_xscale("log")
