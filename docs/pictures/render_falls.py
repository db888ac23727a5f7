"""Draw the picture of docs/falls.md from the two runs of the program on that page.

python docs/pictures/render_falls.py [FILE]
"""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path

import matplotlib as mpl
import numpy as np
from arguments import IMAGES, target
from matplotlib import pyplot as plt

from wbc.app import Log
from wbc.app.log.stances import support_box
from wbc.app.view.marks import COM_COLOUR, DCM_COLOUR, ZMP_COLOUR

PAGE = Path(__file__).parents[1] / "falls.md"
LINES = (
    ("ZMP measured", "zmp/measured", ZMP_COLOUR, 0.9),
    ("DCM estimated", "dcm/estimated", DCM_COLOUR, 2.2),
    ("CoM estimated", "com/estimated", COM_COLOUR, 1.6),
)
TITLES = {"held": "150 N: held", "fell": "250 N: falls"}
PUSHED = 0.1
"""End of the push, s."""


def main() -> None:
    """Run the first program of the page in a scratch folder, and draw its logs."""
    path = target(__doc__, IMAGES / "falls.webp").resolve()
    found = re.search(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    assert found is not None, "the page has no program"
    mpl.use("Agg")
    with tempfile.TemporaryDirectory() as scratch:
        os.chdir(scratch)
        exec(found[1], {})
        figure, axes = plt.subplots(1, 2, figsize=(9.0, 4.2), layout="constrained", sharex=True, sharey=True)
        for ax, (name, title) in zip(axes, TITLES.items(), strict=True):
            log = Log.open(f"{name}.arrow")
            low, high = (edges[0, 1] for edges in support_box(log))  # of both soles, which carry at first
            ax.axhspan(low, high, color="0.88", label="hull of both soles")
            ax.axvspan(0.0, PUSHED, color="#e8a0b0", alpha=0.6, lw=0, label="push")
            for label, group, colour, width in LINES:
                ax.plot(log.time, log.vector(group, 2)[:, 1], color=colour, lw=width, label=label)
            outside = np.abs(log.vector("dcm/estimated", 2)[:, 1]) > high
            if outside.any():
                ax.axvline(
                    log.time[outside.argmax()], color="0.3", ls="--", lw=1.0, label="DCM leaves the soles"
                )
                ax.axvline(log.time[-1], color="0.3", lw=1.0, label="fall")
            ax.set(title=title, xlabel="time (s)", xlim=(0.0, 1.2), ylim=(low - 0.06, 0.34))
        axes[0].set_ylabel("to the left, y (m)")
        handles, labels = axes[1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
        figure.savefig(path, dpi=130, pil_kwargs={"quality": 85, "method": 6})
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
