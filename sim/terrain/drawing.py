"""Pictures of terrains: one in detail, or all on a sheet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wbc.core.errors import Array, InputError
from wbc.feet.stiffness.roughness import PARAMETERS, UNITS
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.terrain.spec import Terrain, terrain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAP_STEP = 0.004
"""Pixel of maps, m: half of the smallest joint."""

PICTURES = (".png", ".pdf", ".svg", ".jpg")


def checked_path(path: str | Path) -> Path:
    """Return the path of a picture to be written.

    Raises:
        InputError: Its folder does not exist, or its ending is not that of a picture.
    """
    target = Path(path)
    if target.suffix.lower() not in PICTURES:
        raise InputError(f"a picture's name must end in one of {', '.join(PICTURES)}, got '{target.name}'")
    if not target.parent.is_dir():
        raise InputError(f"no folder {target.parent} to write {target.name} into")
    return target


def draw_terrain(ground: Terrain, path: str | Path) -> None:
    """Draw the map, a profile and the roughness parameters of a terrain.

    Args:
        ground: What to draw.
        path: Picture to write (.png, .pdf, .svg, .jpg).

    Raises:
        InputError: The path cannot be written.
    """
    target = checked_path(path)
    x0, x1, y0, y1 = ground.extent
    figure = _figure(11.0, 5.2)
    top, below = figure.subplots(2, 1, height_ratios=(2.0, 1.0))
    z = _map(ground, (x0, x1, y0, y1))
    image = top.imshow(
        1e3 * z,
        extent=(x0, x1, y0, y1),
        origin="lower",
        cmap="gist_earth",
        vmin=_low(z),
        vmax=1e3 * z.max() + 1e-9,
    )
    top.imshow(
        _shade(z), extent=(x0, x1, y0, y1), origin="lower", cmap="gray", alpha=0.35, vmin=0.0, vmax=1.0
    )
    top.axhline(0.0, color="tab:red", lw=0.7)
    top.set_ylabel("y (m)")
    top.set_title(
        f"{ground.name}: amplitude {1e3 * ground.amplitude:.3g} mm, seed {ground.seed} - {ground.parameters.summary()}",
        fontsize=9,
    )
    figure.colorbar(image, ax=top, label="z (mm)", shrink=0.8)
    xs, zs = ground.profile(x0, x1, step=0.001)
    below.fill_between(xs, 1e3 * zs, 1e3 * zs.min() - 3.0, color="0.75")
    below.plot(xs, 1e3 * zs, color="tab:red", lw=1.0)
    below.set(xlim=(x0, x1), xlabel="x (m)", ylabel="z at y = 0 (mm)")
    values = map(_number, PARAMETERS, UNITS, ground.roughness().values)
    below.set_title("roughness along y = 0:  " + "   ".join(values), fontsize=8.5)
    figure.savefig(target, dpi=130)


def contact_sheet(path: str | Path, terrains: Sequence[Terrain] | None = None, columns: int = 4) -> int:
    """Draw many terrains as thumbnails.

    Args:
        path: Picture to write (.png, .pdf, .svg, .jpg).
        terrains: What to draw; every family with its defaults when None, ripples for the image.
        columns: Thumbnails side by side.

    Returns:
        Number of thumbnails.

    Raises:
        InputError: The path cannot be written.
    """
    target = checked_path(path)
    shown = list(terrains) if terrains is not None else [example(name) for name in terrain_families()]
    rows = math.ceil(len(shown) / columns)
    figure = _figure(3.9 * columns, 2.0 * rows)
    axes = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    for ax, ground in zip(axes, shown, strict=False):
        x0, x1 = ground.start - 0.1, min(ground.stop, ground.start + 2.0)
        box = (x0, x1, *ground.extent[2:])
        z = _map(ground, box)
        ax.imshow(
            1e3 * z, extent=box, origin="lower", cmap="gist_earth", vmin=_low(z), vmax=1e3 * z.max() + 1e-9
        )
        ax.imshow(_shade(z), extent=box, origin="lower", cmap="gray", alpha=0.4, vmin=0.0, vmax=1.0)
        ax.set_title(f"{ground.name}  {1e3 * ground.amplitude:.3g} mm", fontsize=10)
        ax.tick_params(labelsize=7)
    for ax in axes[len(shown) :]:
        ax.axis("off")
    figure.savefig(target, dpi=110)
    return len(shown)


def example(name: str) -> Terrain:
    """Make a terrain of the family with its defaults, seed 1; for images, of a picture of ripples."""
    if name != "image":
        return terrain(name, seed=1)
    y, x = np.mgrid[-0.5:0.5:101j, -1.5:1.5:301j]
    return terrain(name, source=np.cos(30.0 * np.hypot(x, y)), metres_per_pixel=0.01)


def _figure(width: float, height: float) -> Figure:
    """Make a figure that needs no display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415 - walking needs no pictures
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _map(ground: Terrain, box: tuple[float, float, float, float]) -> Array:
    """Heights at pixel centres, shape (rows, columns), m."""
    nx, ny = round((box[1] - box[0]) / MAP_STEP), round((box[3] - box[2]) / MAP_STEP)
    x = box[0] + (np.arange(nx) + 0.5) * (box[1] - box[0]) / nx
    y = box[2] + (np.arange(ny) + 0.5) * (box[3] - box[2]) / ny
    return ground.height(x[None, :], y[:, None])


def _low(z: Array) -> float:
    """Colour floor of a map, mm: a margin below, so that the floor is earth and not sea."""
    return float(1e3 * (z.min() - 0.5 * (z.max() - z.min()))) - 1e-9


def _shade(z: Array) -> Array:
    """Brightness of a surface lit from the upper left, 0..1, heights doubled."""
    dy, dx = np.gradient(2.0 * z, MAP_STEP)
    light = np.array([-0.5, 0.5, 0.75]) / np.linalg.norm([-0.5, 0.5, 0.75])
    return np.asarray(
        np.clip((light[2] - light[0] * dx - light[1] * dy) / np.sqrt(1.0 + dx**2 + dy**2), 0.0, 1.0)
    )


def _number(name: str, unit: str, value: float) -> str:
    """Write a roughness parameter: lengths in mm."""
    scale, written = {"m": (1e3, " mm"), "m2": (1e6, " mm²")}.get(unit, (1.0, ""))
    return f"{name} {scale * value:.3g}{written}"
