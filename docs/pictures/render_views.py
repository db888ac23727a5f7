"""Take the pictures of the viewers: one instant of a walk in each of them, and a figure of its log.

xvfb-run -a -s "-screen 0 1000x750x24" python docs/pictures/render_views.py [FOLDER]

It needs Chromium, the extras workbench and rerun, and a screen, for which Xvfb does.
"""

from __future__ import annotations

import os
import tempfile
import time
from base64 import b64decode
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

from arguments import target
from browser import Browser
from PIL import Image, ImageGrab

from wbc.app import Log, MeshcatView, Recorder, Workbench, draw
from wbc.app.view.mujoco_view import MujocoView
from wbc.app.view.rerun_view import RerunView
from wbc.sim import WalkPlan, WalkSpec, WalkTrial

SPEC = WalkSpec(
    robot="hrp4_class",
    foot="long_arch",
    stiffness=5.0,
    eyes="depth",
    terrain="stones",
    amplitude=0.04,
    seed=100,
    noise="realistic",
    plan=WalkPlan(distance=1.0),
)
INSTANT, WIDTH = 4.0, 720
"""Time of the walk, s, and width of a picture, pixels."""

SETTLE = {"meshcat": 5.0, "workbench": 60.0, "rerun": 60.0}
"""Time that a page may take to draw what it was sent, s: pixels are computed without a graphics card."""

HIDE = "document.querySelectorAll('.mantine-Notifications-root').forEach(e => { e.style.display = 'none' })"
"""Script that hides the workbench's notice that there is no graphics card."""


def save(picture: Image.Image, path: Path) -> None:
    """Write a picture of at most the usual width."""
    picture = picture.convert("RGB")
    picture.thumbnail((WIDTH, WIDTH), Image.Resampling.LANCZOS)
    picture.save(path, quality=80, method=6)
    print(f"wrote {path}")


def main() -> None:
    """Walk once, and show the walk in all viewers."""
    folder = target(__doc__)
    with tempfile.TemporaryDirectory() as scratch:
        log = Path(scratch) / "walk.arrow"
        trial = WalkTrial(SPEC)
        plant, control = trial.plant, trial.control
        views: dict[str, Callable[[], Any]] = {
            "meshcat": lambda: MeshcatView(plant, control, port=0, rate=1e6),
            "workbench": lambda: Workbench(plant, control, port=0, rate=1e6),
            "rerun": lambda: RerunView(plant, control, port=0, rate=1e6),
            "mujoco": lambda: MujocoView(plant, control, rate=1e6),
        }

        def tick() -> None:
            for cloud in plant.clouds():
                control.see(cloud)
            measurement = plant.measure()
            command = control.command(measurement)
            record(plant, control, measurement, command)
            plant.step(command)

        with Recorder(log) as record:
            while plant.time < INSTANT:
                tick()
            for name, make in views.items():
                with make() as view:
                    if name == "mujoco":
                        for _ in range(3):
                            tick()
                            view.update()
                            time.sleep(1.0)
                        screen = ImageGrab.grab(xdisplay=os.environ["DISPLAY"])
                        picture = screen.crop(screen.getbbox())  # the window, on a black screen
                    else:
                        with Browser(Path(scratch) / name, (1000, 700)) as browser:
                            browser.open(view.url)
                            view.wait_for_page(60.0)
                            for _ in range(3):
                                tick()
                                view.update()
                                time.sleep(1.0)
                            browser.evaluate(HIDE)
                            time.sleep(SETTLE[name])
                            shot = browser.call("Page.captureScreenshot", format="png")["data"]
                            picture = Image.open(BytesIO(b64decode(shot)))
                save(picture, folder / f"view_{name}.webp")
        figure = draw("balance", [Log.open(log)])
        figure.savefig(Path(scratch) / "balance.png", dpi=110)
        save(Image.open(Path(scratch) / "balance.png"), folder / "view_plot.webp")


if __name__ == "__main__":
    main()
