"""The page in the browser: MeshCat's viewer with title, time, text and legend, and the controls of a run."""

from __future__ import annotations

import base64
import html
import json
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from string import Template

import meshcat

from wbc.app.scene.shapes import Colour, Legend

SCRIPT = Path(meshcat.__file__).parent / "viewer" / "dist" / "main.min.js"
"""MeshCat's viewer, as installed with it."""


PAGE, CONTROLS, DRIVE, LIVE = (
    Path(__file__).with_name(name) for name in ("page.html", "controls.html", "drive.js", "live.js")
)
"""Template of every page, controls of a live one, and the scripts that drive a robot and follow a run."""


@dataclass(frozen=True)
class Page:
    """Title, legend and camera of a page.

    Attributes:
        title: Heading.
        legend: Meaning of the colours.
        com_height: Height of the robot's centre of mass, m; the distance of the camera scales with it.
    """

    title: str
    legend: Legend
    com_height: float

    @property
    def key(self) -> int:
        """Hash of the page: a later run with another page makes the browser reload."""
        return zlib.crc32(f"{self.title} {self.legend} {self.com_height}".encode())

    def live(self, nonce: str) -> str:
        """Return the page that follows a run; it loads MeshCat's viewer from the server."""
        feed = (DRIVE.read_text("utf-8") + LIVE.read_text("utf-8")).replace("PAGE_KEY", str(self.key))
        feed = feed.replace("START_HEIGHT", f"{0.95 * self.com_height:.3f}")
        controls = CONTROLS.read_text("utf-8")
        return self._fill(source=' src="main.min.js"', feed=feed, controls=controls, nonce=nonce)

    def static(self, commands: Iterable[bytes], time: float, nonce: str = "") -> str:
        """Return a self-contained page, which needs no server, of packed commands of the viewer at a time, s.

        `nonce` is the number of its scripts in the content security policy, if the page is served.
        """
        packed = json.dumps([base64.b64encode(command).decode("ascii") for command in commands])
        feed = f"for (const text of {packed}) take(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)));"
        script = SCRIPT.read_text("utf-8")
        return self._fill(script=script, feed=feed, nonce=nonce, time=f"{time:.2f} s")

    def _fill(self, **parts: str) -> str:
        # The viewer's world has y up: (x, z, -y) of ours.
        camera = (1.75 * self.com_height, 1.4 * self.com_height, 1.3 * self.com_height)
        target = (0.0, 0.95 * self.com_height, 0.0)
        legend = "".join(
            f'<div><i style="background: {_css(colour)}"></i>{html.escape(text)}</div>'
            for text, colour in self.legend
        )
        empty = dict.fromkeys(("source", "script", "time", "text", "controls"), "")
        return Template(PAGE.read_text("utf-8")).substitute(
            title=html.escape(self.title),
            legend=legend,
            camera=", ".join(f"{value:.3f}" for value in camera),
            target=", ".join(f"{value:.3f}" for value in target),
            **empty | parts,
        )


def _css(colour: Colour) -> str:
    return "#" + "".join(f"{round(255 * value):02x}" for value in colour[:3])
