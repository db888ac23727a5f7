"""Draw the pictures of the tutorial by running its program; on a machine without a display set MUJOCO_GL=egl.

python docs/render_tutorial.py [FOLDER]
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import mujoco
from PIL import Image

from wbc.app.replay.film import renderer
from wbc.app.view.stage import SimulatedStage
from wbc.sim import Plant

SIZE = (360, 300)
"""Width and height, pixels."""

PIECE = re.compile(r"!\[[^]]*\]\(images/(\w+)\.webp\).*?^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
"""A picture and the first program behind it."""

AT_THE_END = "run(2.0)\nprint(walking.fallen)\n"
"""End of the last piece, after its picture."""


def photograph(plant: Plant) -> Image.Image:
    """Draw a plant as it is now, seen from the front left."""
    stage = SimulatedStage(plant, None)
    picture, height, camera = stage.picture(), stage.scale.height, mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = 3.0 * height, 150.0, -10.0
    camera.lookat[:] = (*picture.target[:2], stage.floor + 0.85 * height)
    with renderer(stage.model, *SIZE, samples=4) as drawn:
        return Image.fromarray(drawn.draw(stage, picture, camera))


def main() -> None:
    """Run the tutorial, and draw the plant at the end of each piece."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "images"
    page = (Path(__file__).parent / "tutorial.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    for name, program in PIECE.findall(page):
        exec(program.removesuffix(AT_THE_END), names)
        path = folder / f"{name}.webp"
        photograph(names["plant"]).save(path, quality=80, method=6)
        print(f"wrote {path}")


if __name__ == "__main__":
    main()
