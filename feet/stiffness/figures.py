"""Figures of stiffness models and their data."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc.core.errors import InputError
from wbc.core.files import save_figure
from wbc.feet.stiffness.analysis import (
    LearningCurve,
    learning_curve,
    principal_components,
    stiffness_by_amplitude,
)
from wbc.feet.stiffness.dataset import StiffnessTable
from wbc.feet.stiffness.model import ModelSettings
from wbc.feet.stiffness.validation import Validation, cross_validate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES = (".png", ".pdf", ".svg", ".jpg")


def draw_model(table: StiffnessTable, path: str | Path, settings: ModelSettings | None = None) -> None:
    """Draw a table and the quality of a nearest-neighbour model on it.

    Four panels: profiles in the first two principal components; confusion of clusters, grounds kept apart; accuracy
    against the number of training grounds; best stiffness against amplitude, a line per ground.

    Args:
        table: Profiles with their best stiffness.
        path: Picture to write (.png, .pdf, .svg, .jpg).
        settings: Settings of the model; the paper's when None.

    Raises:
        InputError: The path cannot be written, or the table is too small for a cross-validation.
    """
    target = Path(path)
    if target.suffix.lower() not in PICTURES:
        raise InputError(f"a picture's name must end in one of {', '.join(PICTURES)}, got '{target.name}'")
    if not target.parent.is_dir():
        raise InputError(f"no folder {target.parent} to write {target.name} into")
    given = ModelSettings() if settings is None else settings
    grounds = cross_validate(table, given, "grounds")
    curve = learning_curve(table, given)
    figure = model_figure(table, given, grounds, curve)
    save_figure(figure, target, dpi=130)


def model_figure(
    table: StiffnessTable, settings: ModelSettings, validation: Validation, curve: LearningCurve
) -> Figure:
    """Return the figure of `draw_model` from given results."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - slow to import

    figure = Figure(figsize=(11.0, 8.5), layout="constrained")
    (data, confusion), (learning, trend) = figure.subplots(2, 2)
    _draw_components(figure, data, table, settings)
    _draw_confusion(figure, confusion, validation)
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


def labels_figure(table: StiffnessTable) -> Figure:
    """Return a figure of best stiffness against amplitude, a panel per ground, with the range of nearly best values."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - slow to import

    grounds = list(dict.fromkeys(table.ground.tolist()))
    columns = min(4, len(grounds))
    rows = -(-len(grounds) // columns)
    figure = Figure(figsize=(2.4 * columns, 1.0 + 1.8 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False)
    for panel in panels.flat[len(grounds) :]:
        panel.set_axis_off()
    for panel, ground in zip(panels.flat, grounds, strict=False):
        first = [
            int(np.flatnonzero((table.ground == ground) & (table.amplitude == amplitude))[0])
            for amplitude in np.unique(table.amplitude[table.ground == ground])
        ]
        amplitude, best = 1e3 * table.amplitude[first], table.stiffness[first]
        low, high = table.stiffness_low[first], table.stiffness_high[first]
        if np.isfinite(low).all() and np.isfinite(high).all():
            panel.vlines(amplitude, low, high, color="tab:blue", alpha=0.35, linewidth=5.0)
        panel.plot(amplitude, best, "o-", color="tab:blue", markersize=4.0, linewidth=1.0)
        panel.set_yscale("log")
        panel.set_title(ground.replace("_", " "), fontsize=9)
        panel.grid(alpha=0.3)
    for panel in panels[:, 0]:
        panel.set_ylabel("k (Nm/rad)", fontsize=9)
    for panel in panels[-1]:
        panel.set_xlabel("amplitude (mm)", fontsize=9)
    return figure
