"""Draw the walk of the README: `python docs/render.py` calls it; on a machine without a display set MUJOCO_GL=egl."""

from __future__ import annotations

import tempfile
from pathlib import Path

from PIL import Image

from wbc.app.log import Log, Recorder
from wbc.app.replay.film import render_video
from wbc.app.replay.replay import Replay
from wbc.sim.walks import WalkPlan, WalkSpec, walk

SPEC = WalkSpec(foot="soft", terrain="stones", amplitude=0.02, seed=101, plan=WalkPlan(distance=1.0))
"""The walk that is shown."""

INSTANT = 6.75
"""When it is shown, s."""

RATE = 4.0
"""Pictures a second of the film that the instant is taken from."""

SIZE = (960, 540)
"""Width and height of the picture, pixels."""


def draw(path: Path) -> None:
    """Walk, film the walk, and keep one picture.

    Raises:
        RuntimeError: The robot of the picture has fallen.
    """
    with tempfile.TemporaryDirectory() as folder:
        log, film = Path(folder) / "walk.arrow", Path(folder) / "walk.gif"
        if walk(SPEC, hooks=[Recorder(log)]).fell:
            raise RuntimeError("the robot of the picture has fallen")
        render_video(Replay(Log.open(log)), film, rate=RATE, size=SIZE)
        with Image.open(film) as pictures:
            pictures.seek(round(INSTANT * RATE))
            pictures.convert("RGB").quantize(128).save(path, optimize=True)
