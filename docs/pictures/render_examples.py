"""Draw the sheet of all examples with `python docs/pictures/render_examples.py [FILE]`.

Each of the examples of `INSTANTS` is run as it is, and drawn at one instant.
"""

from __future__ import annotations

import contextlib
import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from arguments import IMAGES, target
from PIL import Image, ImageDraw, ImageFont
from render_walk import brighten

from wbc.app.replay.film import renderer
from wbc.app.view.stage import SimulatedStage
from wbc.sim import Plant
from wbc.sim.trial.trial import TrialHook, TrialTick

EXAMPLES = Path(__file__).parents[2] / "examples"

INSTANTS = {
    "stand": (1.0, 150.0, "--robot talos"),
    "program": (4.6, 130.0, "--robot g1"),
    "reach_walking": (4.6, 130.0, ""),
    "walk": (4.9, 95.0, ""),
    "drive": (4.6, 150.0, ""),
    "walk_stones": (5.7, 130.0, ""),
    "walk_soles": (6.9, 60.0, ""),
    "walk_stairs": (5.7, 110.0, ""),
    "step_over_stones": (4.6, 150.0, ""),
    "own_source": (3.3, 160.0, "--robot talos"),
    "own_robot": (1.0, 130.0, ""),
    "hands/carry": (4.0, 110.0, ""),
    "hands/cart": (9.0, 125.0, "--forward 0.5 --back 0.2"),
    "hands/press": (8.0, 130.0, "--robot talos"),
}
"""Time at which each example is drawn, s; azimuth of the camera, degrees (behind the robot is 0); arguments."""

NOT_DRAWN = (
    *("arm", "cassie", "handles", "learn", "motion", "other_engine", "without_feet", "two_robots"),
    *("hands/door", "hands/one_foot"),
)
"""Examples that are not drawn: they have no plant, a loop of their own or two robots, or take long."""

SIZE = (300, 260)
"""Width and height of one picture, pixels."""

COLUMNS = 5


class Catcher(TrialHook):
    """Takes a picture of a plant when its time has come."""

    def __init__(self, instant: float, azimuth: float) -> None:
        self.instant, self.azimuth, self.picture = instant, azimuth, None
        self.plant: Plant | None = None

    def update(self, *_: Any) -> None:
        """Look at the plant; called once a tick."""
        assert self.plant is not None
        if self.picture is None and self.plant.time >= self.instant - 1e-9:
            self.picture = photograph(self.plant, view=(3.3, self.azimuth, -14.0))

    def tick(self, tick: TrialTick) -> None:
        """The same for walks that `walk` runs."""
        self.plant = tick.plant
        self.update()


def photograph(
    plant: Plant,
    size: tuple[int, int] = SIZE,
    view: tuple[float, float, float] = (3.3, 130.0, -14.0),
) -> Image.Image:
    """Draw a plant as it is now, as a replay would be drawn.

    The size is in pixels; the view has the distance in CoM heights, azimuth and elevation in degrees.
    """
    stage = SimulatedStage(plant, None)
    brighten(stage.model)
    picture, height, camera = stage.picture(), stage.scale.height, mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = view[0] * height, *view[1:]
    camera.lookat[:] = (*picture.target[:2], stage.floor + 0.85 * height)
    with renderer(stage.model, *size, samples=4) as drawn:
        return Image.fromarray(drawn.draw(stage, picture, camera))


def picture_of(name: str, instant: float, azimuth: float, arguments: str) -> Image.Image:
    """Run an example, and take its picture."""
    module, common = importlib.import_module(name.replace("/", ".")), importlib.import_module("_common")
    catcher = Catcher(instant, azimuth)

    @contextlib.contextmanager
    def watch(self: Any, plant: Plant, *_: Any) -> Iterator[Catcher]:
        if catcher.picture is None:
            catcher.plant = plant
        yield catcher

    common.Options.watch = watch
    common.Options.hooks = lambda self: [catcher]
    module.main(arguments.split())
    if catcher.picture is None:
        raise RuntimeError(f"{name} ended before {instant:g} s")
    return catcher.picture


def main() -> None:
    """Draw the sheet."""
    path = target(__doc__, IMAGES / "examples.png")
    sys.path[:0] = [str(EXAMPLES), str(EXAMPLES / "hands")]
    examples = (path for folder in (".", "hands") for path in (EXAMPLES / folder).glob("*.py"))
    found = {str(p.relative_to(EXAMPLES).with_suffix("")) for p in examples}
    missing = found - {"_common", "hands/_common", "hands/_hands", *NOT_DRAWN} - set(INSTANTS)
    if missing:
        raise RuntimeError(f"no instant for {', '.join(sorted(missing))}")
    rows = -(-len(INSTANTS) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * SIZE[0], rows * SIZE[1]), "white")
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(16)
    for i, (name, drawn) in enumerate(INSTANTS.items()):
        corner = np.array([i % COLUMNS, i // COLUMNS]) * SIZE
        sheet.paste(picture_of(name, *drawn), tuple(corner.tolist()))
        pen.text(tuple((corner + (8, 6)).tolist()), f"{name}.py", fill="black", font=font)
    sheet.quantize(128).save(path, optimize=True)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
