"""Film the walks of the README: `python docs/render_walk.py`; on a machine without a display set MUJOCO_GL=egl."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

from wbc.app import Log, Recorder, Replay
from wbc.app.replay.film import renderer
from wbc.sim import WalkPlan, WalkPush, WalkSpec, walk

MARKS = ("com", "com shadow", "zmp", "dcm", "known ground")
"""Marks that are shown."""


@dataclass(frozen=True)
class Film:
    """A walk, and what of it is filmed.

    Attributes:
        spec: The walk.
        start: Beginning of the film, s.
        seconds: Length of what is filmed, s.
        rate: Pictures per second of the walk, 1/s.
        pace: Seconds of the walk in one second of the film.
        size: Width and height, pixels.
        camera: Distance (m), azimuth and elevation (degrees).
        smooth: Time over which the camera's way is averaged, s.
    """

    spec: WalkSpec
    start: float
    seconds: float
    rate: float
    pace: float
    size: tuple[int, int]
    camera: tuple[float, float, float]
    smooth: float


WALK = Film(
    WalkSpec(
        foot="long_arch", stiffness=5.0, eyes="depth", terrain="stones", amplitude=0.06, seed=30000,
        plan=WalkPlan(distance=2.4),
    ),
    start=6.4, seconds=5.2, rate=6.0, pace=2.0, size=(560, 480), camera=(2.35, 118.0, -20.0), smooth=6.0,
)  # fmt: skip
"""Five steps over stones, with the map of what the robot has seen."""

DRIVE = Film(
    WalkSpec(
        plan=WalkPlan(drive=((0.0, 0.3, 0.0, 0.4), (5.5, 0.3, 0.0, -0.4), (13.5, 0.0, 0.0, 0.0))),
        pushes=(WalkPush(impulse=0.2, direction=1.2, time=9.0),),
        seed=3,
    ),
    start=0.5, seconds=14.5, rate=6.0, pace=2.5, size=(480, 411), camera=(3.3, 205.0, -28.0), smooth=3.0,
)  # fmt: skip
"""A robot that is driven in an S, pushed at 9 s, and goes on."""


def draw(path: Path, what: Film = WALK) -> None:
    """Walk, record the walk, and film it as an animated WebP, or another format that Pillow knows by the ending.

    Raises:
        RuntimeError: The filmed robot has fallen.
    """
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "walk.arrow"
        if walk(what.spec, hooks=[Recorder(log)]).fell:
            raise RuntimeError("the filmed robot has fallen")
        frames = film(Replay(Log.open(log)), what)
    frames[0].save(
        path,
        save_all=True,
        append_images=frames[1:],
        duration=round(1000.0 / (what.rate * what.pace)),
        loop=0,
        quality=60,
        method=4,
    )


def film(replay: Replay, what: Film) -> list[Image.Image]:
    """Return the pictures; the camera goes where the robot goes in the mean over a while."""
    brighten(replay.model)
    places, times = replay.log["truth/base/position"], replay.log.time
    pictures = round(what.seconds * what.rate)
    ticks = [int(np.searchsorted(times, what.start + i / what.rate)) for i in range(pictures)]
    way = np.array([places[min(tick, len(places) - 1)][:2] for tick in ticks])
    half = max(1, round(0.5 * what.smooth * what.rate))
    camera = mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = what.camera
    frames = []
    with renderer(replay.model, *what.size, samples=4) as drawn:
        for i, tick in enumerate(ticks):
            near = way[max(0, i - half) : i + half + 1]
            camera.lookat[:] = (*near.mean(axis=0), replay.floor + 0.74)
            picture = replay.picture(tick)
            picture.marks = [mark for mark in picture.marks if mark.name in MARKS]
            frames.append(Image.fromarray(drawn.draw(replay, picture, camera)))
    return frames


def brighten(model: mujoco.MjModel) -> None:
    """Light the scene as a bright room.

    Shadows are drawn in a square around the light, whose edge would be seen: it is made larger, and finer.
    """
    model.vis.map.shadowclip, model.vis.quality.shadowsize = 8.0, 8192
    model.vis.quality.numslices, model.vis.quality.numstacks = 28, 16
    model.vis.headlight.ambient[:] = 0.50
    model.vis.headlight.diffuse[:] = 0.40


if __name__ == "__main__":
    draw(Path(__file__).parent / "images" / "walk.webp")
    draw(Path(__file__).parent / "images" / "drive.webp", DRIVE)
