"""Draw what a walk has seen of the ground, and where its feet went: `python docs/pictures/render_seeing.py [FILE]`."""

from __future__ import annotations

import math
from typing import Any

import matplotlib as mpl
import numpy as np
from arguments import IMAGES, target

from wbc.sim import WalkPlan, WalkSpec
from wbc.sim.trial.trial import TrialHook
from wbc.sim.walks.trial import WalkTrial

mpl.use("Agg")
import matplotlib.pyplot as plt

SPEC = WalkSpec(
    eyes="depth", foot="long_arch", stiffness=5.0, terrain="sticks", amplitude=0.065, seed=32000,
    noise="realistic", plan=WalkPlan(distance=1.5),
)  # fmt: skip
COLOURS = {"left": (0.0, 0.45, 0.70), "right": (0.84, 0.37, 0.0)}


class Seen(TrialHook):
    """Cells that were seen, over the sole that stands, and all landings: planned, chosen and found."""

    def __init__(self) -> None:
        self.cells: dict[tuple[int, int], tuple[float, float, float]] = {}
        self.landings: list[tuple[Any, Any, np.ndarray]] = []

    def start(self, trial: Any) -> None:
        """Keep the plan."""
        self.walk = trial.control.source
        self.plan, self.done = self.walk.phases.plan, 0
        self.chosen: Any = None

    def tick(self, tick: Any) -> None:
        """Keep the landing of the foot in the air, and the map when it has landed."""
        walk = self.walk
        if walk.phases.swing is not None:
            self.chosen = walk.phases.landing
        if walk.steps_done > self.done:
            side = 0 if self.chosen.side == "left" else 1
            true = np.array(tick.plant.data.site_xpos[tick.plant.sole_sites[side]])
            self.landings.append((self.plan.steps[self.done], self.chosen, true))
            self.done = walk.steps_done
            drift = self.chosen.z - true[2]  # of the estimate
            for x, y, z in tick.control.ground.map.known()[0].tolist():
                self.cells[math.floor(x / 0.02), math.floor(y / 0.02)] = (x, y, z - drift)


def corners(step: Any, length: float, width: float) -> np.ndarray:
    """Return the outline of a sole from above, closed."""
    local = 0.5 * np.array([(1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)]) * (length, width)
    c, s = np.cos(step.yaw), np.sin(step.yaw)
    return local @ np.array([[c, s], [-s, c]]) + (step.x, step.y)


def main() -> None:
    """Walk, and draw."""
    path = target(__doc__, IMAGES / "seeing.png")
    trial, seen = WalkTrial(SPEC), Seen()
    result = trial.run([seen])
    cells = np.array(list(seen.cells.values()))
    sole = trial.plant.feet[0].fit.sole
    figure, (side, above) = plt.subplots(2, 1, figsize=(9.0, 6.6), height_ratios=(1, 2), sharex=True)
    x = np.linspace(-0.1, 2.1, 900)
    y = seen.plan.left.y + np.linspace(-0.5, 0.5, 21)[:, None] * sole.width
    side.fill_between(
        x, 1e3 * trial.plant.terrain.height(x, y).max(axis=0), -20, color="0.8", label="ground, left track"
    )
    mine = np.abs(cells[:, 1] - seen.plan.left.y) < 0.5 * sole.width
    side.plot(cells[mine, 0], 1e3 * cells[mine, 2], ".", ms=2.0, color="0.25", label="cells of the map")
    for planned, chosen, found in seen.landings:
        colour = COLOURS[chosen.side]
        first = not any(line.get_label().startswith(chosen.side) for line in above.lines)
        label = f"{chosen.side} foot, chosen" if first else None
        above.plot(*corners(planned, sole.length, sole.width).T, ":", color="black", lw=1.3)
        above.plot(*corners(chosen, sole.length, sole.width).T, "-", color=colour, lw=1.8, label=label)
        if chosen.side == "left":
            ends = chosen.x + np.array([-0.5, 0.5]) * sole.length
            label = None if len(side.lines) > 1 else "left sole as it landed"
            side.plot(ends, 1e3 * found[[2, 2]], "-", color=colour, lw=2.0, label=label)
    above.plot([], [], ":", color="black", lw=1.3, label="planned")
    points = above.scatter(
        cells[:, 0],
        cells[:, 1],
        c=1e3 * cells[:, 2],
        s=9,
        marker="s",
        cmap="gist_earth",
        vmin=-20.0,
        zorder=0,
    )
    figure.colorbar(points, ax=above, orientation="horizontal", pad=0.14, aspect=50, label="height (mm)")
    side.set(ylabel="height (mm)", ylim=(-20, 120))
    side.legend(loc="upper left", fontsize=8, ncols=3)
    above.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), fontsize=8, ncols=3, frameon=False)
    above.set(xlabel="x (m)", ylabel="y (m)", xlim=(-0.1, 2.1), ylim=(-0.35, 0.35), aspect="equal")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    print(result.outcome, len(cells), "cells", len(seen.landings), "landings")


if __name__ == "__main__":
    main()
