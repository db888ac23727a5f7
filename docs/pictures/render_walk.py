"""Film the walks of the gallery: `python docs/pictures/render_walk.py [NAME …]`."""

from __future__ import annotations

import argparse
import importlib
import math
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
from arguments import IMAGES
from PIL import Image, ImageDraw, ImageFont

from wbc.app import Log, Recorder, Replay
from wbc.app.replay.film import renderer
from wbc.app.view.marks import FORCES, Mark
from wbc.base.files import replacing
from wbc.base.numbers import Array
from wbc.sim import WalkPlan, WalkPush, WalkSpec, walk

MARKS = ("com", "com shadow", "zmp", "dcm", "known ground")
"""Marks that are shown."""

EXAMPLES = Path(__file__).parents[2] / "examples"

SHOWN, ARROW = 0.8, 0.5
"""Time of the film for which the arrow of a push is shown, s, and its length, m. A push itself lasts 0.1 s."""


@dataclass(frozen=True)
class Film:
    """A run, and what of it is filmed.

    Attributes:
        record: Records the run into a log, and raises if the robot falls.
        start: Beginning of the film, s.
        seconds: Length of what is filmed, s.
        rate: Pictures per second of the run, 1/s.
        pace: Seconds of the run in one second of the film.
        size: Width and height, pixels.
        camera: Distance (m), azimuth and elevation (degrees).
        smooth: Time over which the camera's way is averaged, s.
        marks: Names of the marks that are shown, or beginnings of their names.
    """

    record: Callable[[Path], None]
    start: float
    seconds: float
    rate: float
    pace: float
    size: tuple[int, int]
    camera: tuple[float, float, float]
    smooth: float
    marks: tuple[str, ...] = ()


def walked(spec: WalkSpec, log: Path) -> None:
    """Record a walk."""
    if walk(spec, hooks=[Recorder(log)]).fell:
        raise RuntimeError("the filmed robot has fallen")


def example(name: str, arguments: list[str], log: Path) -> None:
    """Record an example."""
    sys.path[:0] = [str(EXAMPLES), str(EXAMPLES / "hands")]
    module, common = importlib.import_module(name), importlib.import_module("_common")
    common.Options.hooks = lambda self: [Recorder(log)]
    if not module.main(arguments)["upright"]:
        raise RuntimeError("the filmed robot has fallen")


FILMS = {
    # Five steps over stones, with the map of what the robot has seen.
    "walk": Film(
        partial(
            walked,
            WalkSpec(
                foot="long_arch", stiffness=5.0, eyes="depth", terrain="stones", amplitude=0.06, seed=30000,
                plan=WalkPlan(distance=2.4),
            ),
        ),
        start=6.4, seconds=5.2, rate=6.0, pace=2.0, size=(480, 411), camera=(2.35, 118.0, -20.0), smooth=6.0,
        marks=MARKS,
    ),
    # A robot that is driven in an S, pushed at 9 s, and goes on.
    "drive": Film(
        partial(
            walked,
            WalkSpec(
                plan=WalkPlan(drive=((0.0, 0.3, 0.0, 0.4), (5.5, 0.3, 0.0, -0.4), (13.5, 0.0, 0.0, 0.0))),
                pushes=(WalkPush(impulse=0.2, direction=1.2, time=9.0),),
                seed=3,
            ),
        ),
        start=0.5, seconds=14.5, rate=5.0, pace=2.5, size=(420, 360), camera=(3.9, 205.0, -34.0), smooth=8.0,
        marks=("real step",),
    ),
    # A push to the left at 70 % of the force under which this robot falls in some directions.
    "push": Film(
        partial(
            walked,
            WalkSpec(
                robot="g1", mode="torque", foot="flat", eyes="none",
                plan=WalkPlan(drive=((0.0, 0.3, 0.0, 0.0), (6.5, 0.0, 0.0, 0.0))),
                pushes=(WalkPush(impulse=0.6, direction=math.pi / 2, time=4.0),),
                seed=3,
            ),
        ),
        start=3.2, seconds=3.6, rate=12.0, pace=1.0, size=(400, 360), camera=(2.4, 150.0, -14.0), smooth=3.0,
    ),
    # Three stairs of 0.1 m, both feet on each.
    "stairs": Film(
        partial(
            walked,
            WalkSpec(
                foot="flat", eyes="none", terrain="steps", amplitude=0.3,
                terrain_params={"riser": 0.1, "direction": "up", "tread": 0.25},
                plan=WalkPlan(stairs="together"), seed=30000,
            ),
        ),
        start=11.0, seconds=9.0, rate=6.0, pace=2.0, size=(400, 360), camera=(2.6, 110.0, -12.0), smooth=4.0,
    ),
    # A cart is pushed and turned.
    "cart": Film(
        partial(example, "cart", ["--forward", "0.5", "--back", "0.2"]),
        start=3.0, seconds=24.0, rate=2.0, pace=4.0, size=(420, 360), camera=(3.4, 125.0, -18.0), smooth=8.0,
    ),
}  # fmt: skip
"""Name of the picture → film."""


def draw(path: Path, what: Film) -> None:
    """Record a run and film it, as an animated WebP.

    Raises:
        RuntimeError: The filmed robot has fallen.
    """
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "walk.arrow"
        what.record(log)
        frames = film(Replay(Log.open(log)), what)
    with replacing(path) as new:
        frames[0].save(
            new,
            "WEBP",
            save_all=True,
            append_images=frames[1:],
            duration=round(1000.0 / (what.rate * what.pace)),
            loop=0,
            quality=55,
            method=4,
        )
    print(f"wrote {path}, {path.stat().st_size} bytes")


def film(replay: Replay, what: Film) -> list[Image.Image]:
    """Return the pictures; the camera goes where the robot goes in the mean over a while."""
    brighten(replay.stage.model)
    places, times = replay.log["truth/base/position"], replay.log.time
    pictures = round(what.seconds * what.rate)
    due = what.start + np.arange(pictures) / what.rate
    ticks = np.minimum(np.searchsorted(times, due), len(times) - 1).tolist()
    way = places[ticks][:, :2]
    half = max(1, round(0.5 * what.smooth * what.rate))
    camera = mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = what.camera
    frames, pen = [], ImageFont.load_default(18)
    pushed = np.zeros(len(times), bool)
    if "truth/push/force/x" in replay.log:
        pushed = np.nan_to_num(replay.log["truth/push/force"]).any(axis=1)
    with renderer(replay.stage.model, *what.size, samples=4) as drawn:
        for i, tick in enumerate(ticks):
            near = way[max(0, i - half) : i + half + 1]
            height = max(replay.stage.floor, places[tick][2] - replay.stage.scale.height)
            camera.lookat[:] = (*near.mean(axis=0), height + 0.74)
            picture = replay.picture(tick)
            picture.marks = [mark for mark in picture.marks if mark.name.startswith(what.marks)]
            before = np.flatnonzero(pushed[:tick] & (times[:tick] > times[tick] - SHOWN * what.pace))
            if before.size:
                last = int(before[-1])
                point = replay.log["truth/push/point"][last] + places[tick] - places[last]
                picture.marks.append(arrow(point, replay.log["truth/push/force"][last]))
            frame = Image.fromarray(drawn.draw(replay.stage, picture, camera))
            text, colour = ("push", (200, 30, 20)) if before.size else (f"{what.pace:g} x", (70, 80, 90))
            ImageDraw.Draw(frame).text((10, 8), text, fill=colour, font=pen)
            frames.append(frame)
    return frames


def arrow(point: Array, force: Array) -> Mark:
    """Return an arrow that ends at the point of a push, both of shape (3,)."""
    reach = ARROW * force / np.linalg.norm(force)
    return Mark(
        "push", "arrow", np.array([point - 1.2 * reach, point - 0.2 * reach]), FORCES["push"][0], 0.025
    )


def brighten(model: mujoco.MjModel) -> None:
    """Light the scene as a bright room.

    Shadows are drawn in a square around the light, whose edge would be seen: it is made larger, and finer.
    """
    model.vis.map.shadowclip, model.vis.quality.shadowsize = 8.0, 8192
    model.vis.quality.numslices, model.vis.quality.numstacks = 28, 16
    model.vis.headlight.ambient[:] = 0.50
    model.vis.headlight.diffuse[:] = 0.40


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"film: {', '.join(FILMS)}; all of them by default"
    )
    names = parser.parse_args().names
    if unknown := {*names} - {*FILMS}:
        parser.error(f"no film '{min(unknown)}'; choose from {', '.join(FILMS)}")
    for name in names or FILMS:
        draw(IMAGES / f"{name}.webp", FILMS[name])
