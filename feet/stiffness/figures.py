"""Figures of stiffness models and their data."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from wbc.feet.stiffness.analysis import LearningCurve, principal_components, stiffness_by_amplitude
from wbc.feet.stiffness.dataset import StiffnessTable
from wbc.feet.stiffness.model import ModelSettings
from wbc.feet.stiffness.validation import Validation, cross_validate

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def model_figure(table: StiffnessTable, settings: ModelSettings, curve: LearningCurve) -> Figure:
    """Return a figure of a table, and of the quality of a nearest-neighbour model with its learning curve on it.

    Four panels: profiles in the first two principal components; confusion of clusters, grounds kept apart; accuracy
    against the number of training grounds; best stiffness against amplitude, a line per ground. Raises `InputError` for
    a table that is too small for a cross-validation.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415 - slow to import

    figure = Figure(figsize=(11.0, 8.5), layout="constrained")
    (data, confusion), (learning, trend) = figure.subplots(2, 2)
    _draw_components(figure, data, table, settings)
    _draw_confusion(figure, confusion, cross_validate(table, settings, "grounds"))
    _draw_curve(learning, curve)
    _draw_trends(trend, table)
    return figure


def _draw_components(figure: Figure, axes: Any, table: StiffnessTable, settings: ModelSettings) -> None:
    components = principal_components(table, settings.features)
    x, y = components.scores.T
    points = axes.scatter(x, y, c=table.stiffness, s=12, cmap="viridis")
    share = 100.0 * components.explained
    second = share[1] if share.size > 1 else 0.0
    axes.set(
        xlabel=f"first component ({share[0]:.0f} %)",
        ylabel=f"second component ({second:.0f} %)",
        title=f"{len(table)} profiles",
    )
    figure.colorbar(points, ax=axes, label="best stiffness (Nm/rad)")


def _draw_confusion(figure: Figure, axes: Any, validation: Validation) -> None:
    names, counts = validation.confusion()
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    image = axes.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0)
    centres = [f"{k:g}" for k in validation.clusters.centres[names - 1]]
    axes.set_xticks(range(names.size), centres, rotation=90)
    axes.set_yticks(range(names.size), centres)
    axes.set(
        xlabel="commanded stiffness (Nm/rad)",
        ylabel="cluster of the best stiffness (Nm/rad)",
        title=f"{validation.protocol} kept apart: accuracy {validation.accuracy:.2f} ± {validation.accuracy_std:.2f}, "
        f"mean error {validation.mean_error:.1f} Nm/rad",
    )
    axes.title.set_fontsize(9)
    figure.colorbar(image, ax=axes, label="share of the row")


def _draw_curve(axes: Any, curve: LearningCurve) -> None:
    mean, spread = curve.accuracy.mean(axis=1), curve.accuracy.std(axis=1)
    axes.plot(curve.grounds, mean, "o-", color="tab:blue", label="accuracy")
    axes.fill_between(curve.grounds, mean - spread, mean + spread, color="tab:blue", alpha=0.2)
    axes.set(
        xlabel="grounds trained on", ylabel="accuracy on others", ylim=(0.0, 1.0), title="learning curve"
    )
    error = axes.twinx()
    error.plot(curve.grounds, curve.mean_error.mean(axis=1), "s--", color="tab:red")
    error.set_ylabel("mean error (Nm/rad)", color="tab:red")
    error.set_ylim(bottom=0.0)


def _draw_trends(axes: Any, table: StiffnessTable) -> None:
    from matplotlib import colormaps  # noqa: PLC0415 - slow to import

    axes.set_prop_cycle(color=colormaps["tab20"](range(20)))
    for ground, (amplitudes, best) in stiffness_by_amplitude(table).items():
        axes.plot(1e3 * amplitudes, best, ".-", label=ground)
    axes.set(xlabel="amplitude of the ground (mm)", ylabel="best stiffness (Nm/rad)", title="by ground")
    axes.legend(fontsize=6, loc="center left", bbox_to_anchor=(1.0, 0.5))
