"""Figures of the paper from its journals: `python examples/paper/figures.py [NAME …]` draws into images/."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from models import (
    CLUSTERS,
    DEFAULT_TABLE,
    candidates,
    learning_curve,
    principal_components,
    read_table,
    splitter,
)
from optimize import Optimum, stored_optima
from seeing import sight
from sklearn.metrics import confusion_matrix
from sklearn.model_selection import cross_val_predict
from tables import SOLES
from walks import PAPER, by_sole, corrected, falls, gain, walks

from wbc.feet.sensing.roughness import PARAMETERS

BLUE, ORANGE, AMBER = "#1f77b4", "#ff7f0e", "#f0b429"


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches."""
    return Figure(figsize=(width, height), layout="constrained")


def risks() -> Figure:
    """Draw the falls of each fixed sole by cause, and its loads over those of the rigid one."""
    table = walks("hypotheses")
    figure = new_figure(7.6, 2.8)
    left, right = figure.subplots(1, 2)
    for cause, colour in (("sideways", BLUE), ("forward", ORANGE)):
        rate, low, high = np.array([falls(table, arm, cause) for arm in SOLES]).T
        left.errorbar(
            range(len(SOLES)),
            rate,
            [rate - low, high - rate],
            color=colour,
            fmt="o-",
            ms=4,
            capsize=2,
            label=cause,
        )
    names = {"impact": "landing peak", "zmp_error": "ZMP error", "contact_area": "contact area"}
    whole = table[table["sole"].isin(SOLES)].groupby("sole")[list(names)].mean().loc[list(SOLES)]
    for (name, label), marker in zip(names.items(), "osD", strict=True):
        right.plot(range(len(SOLES)), whole[name] / whole[name].iloc[0], marker + "-", ms=4, label=label)
    right.axhline(1.0, color="0.3", lw=0.8)
    left.set_ylabel("falls per 1,000 steps", fontsize=8)
    right.set_ylabel("over that of 'rigid'", fontsize=8)
    for axes in (left, right):
        axes.set_xticks(range(len(SOLES)), [arm.removeprefix("soft, ") for arm in SOLES], fontsize=7)
        axes.set_ylim(bottom=0.0)
        axes.legend(fontsize=7)
    return figure


def stiffness_differences(reference: str = "soft, 80", margin: float = 0.5) -> Figure:
    """Draw the steps of each fixed sole over the reference by family with its interval; established ones are filled."""
    steps = by_sole(walks("hypotheses"))[list(SOLES)]
    families = list(dict.fromkeys(steps.index.get_level_values("terrain")))
    arms = [arm for arm in SOLES if arm != reference]
    found = {(f, arm): gain(steps.xs(f, drop_level=False), arm, reference) for f in families for arm in arms}
    p = corrected({key: value for key, (_, value) in found.items()})
    rows = [*families, "all"]
    found |= {("all", arm): gain(steps, arm, reference, "terrain") for arm in arms}
    figure = new_figure(2.6 + 1.7 * len(arms), 1.1 + 0.17 * len(rows))
    for axes, arm in zip(figure.subplots(1, len(arms), sharex=True, sharey=True), arms, strict=True):
        axes.axvspan(-margin, margin, color="0.93", lw=0)
        axes.axvline(0.0, color="0.3", lw=0.8)
        for place, row in enumerate(rows):
            each, colour = found[row, arm][0], ORANGE if row == "all" else BLUE
            axes.plot([each.low, each.high], [place, place], color=colour, lw=1.2)
            sure = (p.get((row, arm)) or 1.0) < 0.05
            axes.plot(each.mean, place, "o", color=colour, ms=4.0, fillstyle="full" if sure else "none")
        axes.set_title(arm, fontsize=8)
        axes.set_yticks(range(len(rows)), [row.replace("_", " ") for row in rows], fontsize=6)
        axes.set_ylim(len(rows) - 0.5, -0.5)
    figure.supxlabel(f"steps: difference to '{reference}'", fontsize=8)
    return figure


def fig5_frizza_steps() -> Figure:
    """Draw the steps of the paper's Fig. 5 in its arrangement: cut-offs down, heights across, soles stacked."""
    table = walks("fig5_frizza")
    arms = ["flat", "rigid", "soft, 5", "variable"]
    means = table.pivot_table("steps", ["cutoff", "sole"], "amplitude")
    cutoffs = sorted(table["cutoff"].unique())
    blank = np.full((1, means.shape[1]), np.nan)
    values = np.concatenate([np.vstack([means.loc[[(c, arm) for arm in arms]], blank]) for c in cutoffs])
    figure = new_figure(3.0 + 0.9 * means.shape[1], 1.0 + 0.16 * len(values))
    axes = figure.subplots()
    image = axes.imshow(values, aspect="auto", cmap="viridis")
    names = [f"{c:g}: {arm}" if arm == arms[0] else arm for c in cutoffs for arm in arms]
    axes.set_yticks([i for i in range(len(values)) if (i + 1) % (len(arms) + 1)], names, fontsize=6)
    axes.set_xticks(range(means.shape[1]), [f"{1e3 * height:g} mm" for height in means.columns], fontsize=7)
    figure.colorbar(image, ax=axes, label="steps")
    return figure


def optima(journal: str = "optimize") -> Figure:
    """Draw J of the walks over the stiffness on each ground, with the posterior at the best gains."""
    found = list(stored_optima(journal))
    columns = min(4, len(found))
    figure = new_figure(3.0 * columns, 0.6 + 2.0 * math.ceil(len(found) / columns))
    panels = figure.subplots(
        math.ceil(len(found) / columns), columns, sharex=True, sharey=True, squeeze=False
    ).flat
    for axes, (ground, (X, y), best) in zip(panels, found, strict=False):
        k = best.slices["k"][0]
        axes.plot(np.interp(X[:, 0], np.linspace(0.0, 1.0, k.size), k), y, ".", color="0.6", ms=3.0)
        _slice(axes, best)
        axes.set(title=ground.replace("_", " "), ylim=(-230.0, 30.0), xscale="log")
        axes.tick_params(labelbottom=True)
    for axes in list(figure.axes)[len(found) :]:
        axes.set_visible(False)
    figure.supxlabel("k (Nm/rad)")
    figure.supylabel("J")
    return figure


def _slice(axes: Axes, best: Optimum) -> None:
    """Draw the posterior along the stiffness with ± 2 σ; stiffnesses as good as the best are shaded."""
    k, mean, std = best.slices["k"]
    axes.fill_between(k, mean - 2.0 * std, mean + 2.0 * std, color=BLUE, alpha=0.2, lw=0)
    axes.plot(k, mean, color=BLUE, lw=1.4)
    axes.axvline(best.best["k"], color=ORANGE, lw=1.0)
    for low, high in best.same:
        axes.axvspan(low, high, color=AMBER, alpha=0.2, lw=0)


def stiffness_labels() -> Figure:
    """Draw the best stiffness of every training ground of the built-in model, with the range of nearly best values."""
    table = read_table(DEFAULT_TABLE)
    grounds = list(dict.fromkeys(table["ground"]))
    figure = new_figure(9.6, 1.0 + 1.8 * math.ceil(len(grounds) / 4))
    panels = figure.subplots(math.ceil(len(grounds) / 4), 4, sharey=True, squeeze=False)
    for axes, ground in zip(panels.flat, grounds, strict=False):
        own = table[table["ground"] == ground].groupby("amplitude").first()
        axes.vlines(
            1e3 * own.index, own["stiffness_low"], own["stiffness_high"], color=BLUE, alpha=0.35, lw=5.0
        )
        axes.plot(1e3 * own.index, own["stiffness"], "o-", color=BLUE, ms=4.0, lw=1.0)
        axes.set_yscale("log")
        axes.set_title(ground, fontsize=9)
    figure.supxlabel("amplitude (mm)")
    figure.supylabel("best stiffness (Nm/rad)")
    return figure


def stiffness_model() -> Figure:
    """Draw the built-in model's table in two components, its confusion on unseen grounds and its learning curve."""
    table = read_table(DEFAULT_TABLE)
    values, best = table[list(PARAMETERS)].to_numpy(), table["stiffness"].to_numpy(float)
    figure = new_figure(12.0, 3.8)
    data, confusion, learning = figure.subplots(1, 3)
    share, scores = principal_components(table)
    points = data.scatter(*scores.T, c=best, s=12)
    data.set(
        xlabel=f"first component ({100 * share[0]:.0f} %)",
        ylabel=f"second component ({100 * share[1]:.0f} %)",
    )
    figure.colorbar(points, ax=data, label="best stiffness (Nm/rad)")
    labels = CLUSTERS["paper"].of(best)
    split, groups = splitter(table, "grounds", 10)
    predicted = cross_val_predict(candidates()[0].pipeline, values, labels, groups=groups, cv=split)
    image = confusion.imshow(
        confusion_matrix(labels, predicted, normalize="true"), cmap="Blues", vmin=0.0, vmax=1.0
    )
    confusion.set(xlabel="commanded class", ylabel="class of the best stiffness", title="grounds kept apart")
    figure.colorbar(image, ax=confusion, label="share of the row")
    sizes, accuracy, _ = learning_curve(table)
    mean, spread = accuracy.mean(axis=1), accuracy.std(axis=1)
    learning.plot(sizes, mean, "o-", color=BLUE)
    learning.fill_between(sizes, mean - spread, mean + spread, color=BLUE, alpha=0.2)
    learning.set(xlabel="grounds trained on", ylabel="accuracy on others", ylim=(0.0, 1.0))
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {
    f.__name__: f
    for f in (
        risks,
        sight,
        stiffness_differences,
        fig5_frizza_steps,
        optima,
        stiffness_labels,
        stiffness_model,
    )
}


def main() -> None:
    """Draw figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"figures: {', '.join(FIGURES)}; all when left out")

    for name in parser.parse_args().names or FIGURES:
        path = PAPER / "images" / f"{name}.png"
        FIGURES[name]().savefig(path, dpi=110)
        print(path)


if __name__ == "__main__":
    main()
