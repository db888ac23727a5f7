"""Draw the pictures of the tutorial by running its program; on a machine without a display set MUJOCO_GL=egl.

python docs/pictures/render_tutorial.py [FOLDER]
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from arguments import target
from render_examples import photograph

SIZE, VIEW = (360, 300), (3.0, 150.0, -10.0)
"""Width and height, pixels; view of the camera, from the front left."""

PIECE = re.compile(r"!\[[^]]*\]\(images/(\w+)\.webp\).*?^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
"""A picture and the first program behind it."""

AT_THE_END = "run(2.0)\nprint(walking.fallen)\n"
"""End of the last piece, after its picture."""


def main() -> None:
    """Run the tutorial, and draw the plant at the end of each piece."""
    folder = target(__doc__)
    page = (Path(__file__).parents[1] / "tutorial.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    for name, program in PIECE.findall(page):
        exec(program.removesuffix(AT_THE_END), names)
        path = folder / f"{name}.webp"
        photograph(names["plant"], SIZE, VIEW).save(path, quality=80, method=6)
        print(f"wrote {path}")


if __name__ == "__main__":
    main()
