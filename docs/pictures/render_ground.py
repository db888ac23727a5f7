"""Draw the pictures of feet and grounds with `python docs/pictures/render_ground.py [FOLDER]`.

A few are simulations in MuJoCo, the others what `wbc terrain` and the paper's application draw. It takes
about two minutes; on a machine without a display set MUJOCO_GL=egl.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
from arguments import target
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

import wbc
from wbc.base.numbers import Array
from wbc.feet import foot
from wbc.sim.rig.rig import FootTest, Rig
from wbc.sim.scenes.base import make_scene
from wbc.sim.terrain.plot import plot_families
from wbc.sim.terrain.spec import terrain

PANEL = (560, 300)
"""Width and height of a view of a foot, pixels."""

AREAS = (900, 480)
"""The same of the view of areas."""

LOAD = 390.0
"""Load of one foot under a robot of 39.8 kg, N."""

SKY = (0.93, 0.95, 0.97)

STONES = terrain("stones", amplitude=0.03, seed=1)

BAR = terrain("cylinder_obstacles", 0.03, yaw=0.0)
"""Bars across the track."""

BAR_PLACE = -0.028
"""Place of a bar under the foot, m ahead of the sole centre: midway between the heel hinge and the loop point of the
soft foot, where its sole can bend most."""


def over_bar(stiffness: float) -> FootTest:
    """The soft foot over the highest bar, under the middle of its arch."""
    peak = max((shape.peak for shape in BAR.surface.shapes), key=lambda peak: float(peak[2]))
    place = float(peak[0]) - (BAR.start + BAR.stop) / 2.0 - BAR_PLACE
    return FootTest(foot("soft", stiffness=stiffness), BAR, load=LOAD, x=place)


VIEWS: dict[str, FootTest] = {
    "rigid, on stones": FootTest(foot("rigid"), STONES, load=LOAD),
    "soft, k = 5 Nm/rad": FootTest(foot("soft"), STONES, load=LOAD),
    "long arch, k = 5 Nm/rad": FootTest(foot("long_arch"), STONES, load=LOAD),
    "soft over a bar, k = 1 Nm/rad": over_bar(1.0),
    "k = 20 Nm/rad": over_bar(20.0),
    "k = 80 Nm/rad": over_bar(80.0),
}
"""Foot tests that are drawn, in rows of three."""


def foot_view(test: FootTest) -> Array:
    """A foot that has settled under its load, seen from the side and above, as pixels."""
    rig = Rig(test)
    for _ in range(rig.steps(test.settle)):
        rig.step()
    model = rig.model
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = 0.75, 0.55
    model.vis.global_.offwidth, model.vis.global_.offheight = PANEL
    model.vis.rgba.fog[:3] = SKY
    model.vis.map.fogstart, model.vis.map.fogend = 1.2, 2.6
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance = [*rig.centre, 0.045], 0.38
    camera.azimuth, camera.elevation = 102.0, -9.0
    options = mujoco.MjvOption()
    options.geomgroup[3] = 1  # the spheres that touch the ground
    renderer = mujoco.Renderer(model, PANEL[1], PANEL[0])
    try:
        renderer.update_scene(rig.data, camera, options)
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = 1
        pixels = renderer.render().copy()
    finally:
        renderer.close()
    pixels[(pixels == 0).all(axis=2)] = (255 * np.array(SKY)).astype(np.uint8)  # beyond the horizon
    return np.asarray(pixels)


def draw_feet(path: Path) -> None:
    """Feet on stones and over a bar."""
    figure = Figure(figsize=(12.6, 4.9), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (title, test) in zip(figure.subplots(2, 3).ravel(), VIEWS.items(), strict=True):
        axes.imshow(foot_view(test))
        axes.set_title(title, fontsize=11)
        axes.axis("off")
    figure.savefig(path, dpi=100)


def draw_areas(path: Path) -> None:
    """A robot before a wet patch, foam, a walkway and a layer of gravel."""
    wet, foam = (0.4, 1.0, -0.4, 0.1, "friction", 0.1), (0.4, 1.0, 0.15, 0.5, "stiffness", 3e6)
    walkway = (1.1, 1.8, -0.5, 0.5, "speed", 0.5)
    pebbles = {"shape": "pebble", "size": 0.04, "height": 0.02, "count": 200}
    gravel = make_scene("loose_stones", **pebbles, distance=1.9, length=0.8)
    plant = wbc.Plant("g1", terrain=terrain("flat", areas=(*wet, *foam, *walkway)), scene=gravel)
    plant.model.vis.global_.offwidth, plant.model.vis.global_.offheight = AREAS
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance, camera.azimuth, camera.elevation = [1.15, 0.0, 0.25], 3.1, 130.0, -28.0
    renderer = mujoco.Renderer(plant.model, AREAS[1], AREAS[0])
    try:
        renderer.update_scene(plant.data, camera)
        Image.fromarray(renderer.render()).save(path)
    finally:
        renderer.close()


def small(path: Path) -> None:
    """Write a picture again with 256 colours: a third of the size, and nobody sees it."""
    with Image.open(path) as picture:
        picture.convert("RGB").quantize(256, dither=Image.Dither.NONE).save(path, optimize=True)


PICTURES: dict[str, Callable[[Path], object]] = {
    "terrains.png": plot_families,
    "foot_soft.png": draw_feet,
    "areas.png": draw_areas,
}
"""Name of each picture and who draws it."""


def draw_all(folder: Path) -> None:
    """Draw all pictures of feet and grounds."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in PICTURES.items():
        draw(folder / name)
        small(folder / name)
        print(f"wrote {folder / name}", file=sys.stderr)


if __name__ == "__main__":
    draw_all(target(__doc__))
