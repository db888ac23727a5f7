"""Pictures of terrains: one in detail, or all families on a sheet."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wbc.base.drawing import import_matplotlib
from wbc.base.files import save_figure
from wbc.base.registry import first_line
from wbc.feet.sensing.roughness import PARAMETERS, UNITS
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.terrain.render import AREA_COLOURS
from wbc.sim.terrain.spec import Terrain, terrain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

MAP_STEP = 0.004
"""Pixel of maps, m: half of the smallest joint."""

COLUMNS = 4
"""Thumbnails side by side."""


def plot_terrain(ground: Terrain, path: str | Path) -> None:
    """Draw the map, a profile and the roughness parameters of a terrain; the file's ending is the format."""
    x0, x1, *_ = ground.extent
    figure = _figure(11.0, 5.2)
    top, below = figure.subplots(2, 1, height_ratios=(2.0, 1.0))
    image = _draw_map(top, ground, ground.extent)
    top.axhline(0.0, color="tab:red")
    top.set_ylabel("y (m)")
    about = f"amplitude {1e3 * ground.amplitude:.3g} mm, seed {ground.seed} - {first_line(type(ground.parameters))}"
    top.set_title(f"{ground.name}: {about}", fontsize=9)
    figure.colorbar(image, ax=top, label="z (mm)")
    xs, zs = ground.profile(x0, x1, step=0.001)
    below.fill_between(xs, 1e3 * zs, 1e3 * zs.min(), color="0.75")
    below.plot(xs, 1e3 * zs, color="tab:red")
    below.set(xlim=(x0, x1), xlabel="x (m)", ylabel="z at y = 0 (mm)")
    values = map(_number, PARAMETERS, UNITS, ground.roughness().values)
    below.set_title("roughness along y = 0:  " + "   ".join(values), fontsize=8.5)
    save_figure(figure, path, dpi=130)


def plot_families(path: str | Path) -> int:
    """Draw a thumbnail of every family with its defaults, whose number is returned; the file's ending is the format."""
    grounds = [example_terrain(name) for name in terrain_families()]
    rows = math.ceil(len(grounds) / COLUMNS)
    figure = _figure(3.9 * COLUMNS, 2.0 * rows)
    axes = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for ax, ground in zip(axes, grounds, strict=False):
        image = _draw_map(ax, ground, (ground.start - 0.1, ground.start + 2.0, *ground.extent[2:]))
        ax.set_title(f"{ground.name}  {1e3 * ground.amplitude:.3g} mm", fontsize=10)
        ax.tick_params(labelsize=7)
        if ground.amplitude > 0.0:
            figure.colorbar(image, ax=ax, pad=0.01).ax.tick_params(labelsize=7)
    figure.supxlabel("x, along the track (m); colours: height (mm)", fontsize=10)
    figure.supylabel("y, across the track (m)", fontsize=10)
    for ax in axes[len(grounds) :]:
        ax.axis("off")
    save_figure(figure, path, dpi=110)
    return len(grounds)


def example_terrain(name: str) -> Terrain:
    """Return a terrain of the family with its defaults and seed 1; for images, of a picture of ripples."""
    if name != "image":
        return terrain(name, seed=1)
    y, x = np.mgrid[-0.5:0.5:101j, -1.5:1.5:301j]
    return terrain(name, source=np.cos(30.0 * np.hypot(x, y)), metres_per_pixel=0.01)


def _figure(width: float, height: float) -> Figure:
    import_matplotlib()
    from matplotlib.figure import Figure  # noqa: PLC0415 - slow to import, and walking needs no pictures

    return Figure(figsize=(width, height), layout="constrained")


def _draw_map(ax: Axes, ground: Terrain, box: tuple[float, float, float, float]) -> AxesImage:
    """Draw heights as colours, under the shades of a light from the upper left."""
    from matplotlib.colors import LightSource  # noqa: PLC0415 - slow to import, and walking needs no pictures

    nx, ny = round((box[1] - box[0]) / MAP_STEP), round((box[3] - box[2]) / MAP_STEP)
    x = box[0] + (np.arange(nx) + 0.5) * (box[1] - box[0]) / nx
    y = box[2] + (np.arange(ny) + 0.5) * (box[3] - box[2]) / ny
    z = 1e3 * ground.height(x[None, :], y[:, None])
    # The colours begin a margin (mm) below the ground, so that the floor is earth and not sea.
    low = z.min() - 0.5 * np.ptp(z) - 1.0
    for area in ground.surface_areas:
        x0, x1, y0, y1 = area.within(ground.extent)
        colour = AREA_COLOURS[area.name]
        ax.fill([x0, x1, x1, x0], [y0, y0, y1, y1], color=colour, alpha=0.5, zorder=2)
        ax.text(
            0.5 * (x0 + x1), 0.5 * (y0 + y1), str(area), ha="center", va="center", fontsize=7, clip_on=True
        )
    image = ax.imshow(z, extent=box, origin="lower", cmap="gist_earth", vmin=low)
    shades = LightSource().hillshade(z, vert_exag=2.0, dx=1e3 * MAP_STEP, dy=-1e3 * MAP_STEP)
    ax.imshow(shades, extent=box, origin="lower", cmap="gray", alpha=0.4, vmin=0.0, vmax=1.0)
    return image


def _number(name: str, unit: str, value: float) -> str:
    """Return a roughness parameter as text: lengths in mm."""
    scale, written = {"m": (1e3, " mm"), "m2": (1e6, " mm²")}.get(unit, (1.0, ""))
    return f"{name} {scale * value:.3g}{written}"
