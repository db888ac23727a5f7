"""Film the walk of the README: `python docs/render.py` calls it; on a machine without a display set MUJOCO_GL=egl."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

from wbc.app.log import Log, Recorder
from wbc.app.replay import Replay
from wbc.app.replay.mujoco_scene import MujocoScene
from wbc.sim import WalkPlan, WalkSpec, walk

SPEC = WalkSpec(foot="soft", terrain="stones", amplitude=0.02, seed=101, plan=WalkPlan(distance=1.6))
"""The walk that is filmed."""

START, SECONDS = 7.0, 4.0
"""Beginning and length of the film, s: four steps in the middle of the walk."""

RATE = 15.0
"""Pictures per second of the film, 1/s."""

SIZE = (560, 480)
"""Width and height of the film, pixels."""


def draw(path: Path) -> None:
    """Walk, record the walk, and film it as an animated WebP, or another format that Pillow knows by the ending.

    Raises:
        RuntimeError: The filmed robot has fallen.
    """
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "walk.arrow"
        if walk(SPEC, hooks=[Recorder(log)]).fell:
            raise RuntimeError("the filmed robot has fallen")
        frames = film(Replay(Log.open(log)))
    frames[0].save(
        path,
        save_all=True,
        append_images=frames[1:],
        duration=round(1000.0 / RATE),
        loop=0,
        quality=60,
        method=6,
    )


def film(replay: Replay) -> list[Image.Image]:
    """Return the pictures; the camera moves beside the robot at the mean velocity of the walk."""
    width, height = SIZE
    drawn = MujocoScene(replay.scene, replay.plant.terrain, width, height, replay.sole_paths)
    brighten(drawn.model)
    places, times = replay.log["truth/base/position"], replay.log.time
    ticks = [int(np.searchsorted(times, START + i / RATE)) for i in range(round(SECONDS * RATE))]
    first, last = places[ticks[0]], places[ticks[-1]]
    camera = mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = 2.35, 118.0, -16.0
    frames = []
    with mujoco.Renderer(drawn.model, height, width) as renderer:
        for i, tick in enumerate(ticks):
            share = i / (len(ticks) - 1)
            camera.lookat[:] = (*((1.0 - share) * first + share * last)[:2], replay.scene.floor + 0.74)
            drawn.set(replay.frame(tick), replay.sole_colours(tick))
            renderer.update_scene(drawn.data, camera)
            frames.append(Image.fromarray(renderer.render()))
    return frames


def brighten(model: mujoco.MjModel) -> None:
    """Light the scene as a bright room, and hide the overlays: footsteps and support regions."""
    model.vis.headlight.ambient[:] = 0.50
    model.vis.headlight.diffuse[:] = 0.40
    floor = np.flatnonzero(model.geom_matid == model.material("tiles").id)
    model.geom_rgba[floor, :3] = 0.85
    overlay = re.compile("/(footsteps|support)/")
    for geom, body in enumerate(model.geom_bodyid):
        planned = body == 0 and model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH
        if planned or overlay.search(model.body(body).name):
            model.geom_rgba[geom, 3] = 0.0


if __name__ == "__main__":
    draw(Path(__file__).parent / "images" / "walk.webp")
