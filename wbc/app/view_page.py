"""The page that the browser shows: MeshCat's viewer with a title, the time and a legend."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template

import meshcat

from wbc.app.view_shapes import Colour

SCRIPT = Path(meshcat.__file__).parent / "viewer" / "dist" / "main.min.js"
"""MeshCat's viewer, as installed with it."""

_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>$title</title>
<style>
body { margin: 0; font: 14px/1.5 system-ui, sans-serif; }
#pane { width: 100vw; height: 100vh; overflow: hidden; }
#facts { position: absolute; left: 12px; top: 12px; padding: 8px 12px; border-radius: 6px;
         background: rgba(255, 255, 255, 0.82); color: #222; pointer-events: none; }
#facts b { font-size: 16px; }
#facts i { display: inline-block; width: 10px; height: 10px; margin-right: 6px; border-radius: 5px; }
#time { font-variant-numeric: tabular-nums; }
</style>
</head>
<body>
<div id="pane"></div>
<div id="facts"><b>$title</b><div><span id="time">$time</span> <span id="state"></span></div>$legend</div>
<script$source>$script</script>
<script>
const viewer = new MeshCat.Viewer(document.getElementById("pane"));
viewer.camera.position.set($camera);
viewer.controls.target.set($target);
viewer.controls.update();
const take = (data) => viewer.handle_command_bytearray(new Uint8Array(data));
const say = (id, text) => { document.getElementById(id).textContent = text; };
$feed
</script>
</body>
</html>
""")

_LIVE = """
function connect() {
    const socket = new WebSocket(location.href.replace(/^http/, "ws").replace(/[^/]*$/, "") + "stream");
    socket.binaryType = "arraybuffer";
    socket.onopen = () => say("state", "");
    socket.onmessage = (message) => {
        if (typeof message.data === "string") { say("time", JSON.parse(message.data).time.toFixed(2) + " s"); }
        else { take(message.data); }
    };
    // The next run on the same port goes on in the same page.
    socket.onclose = () => { say("state", "(ended)"); setTimeout(connect, 1000); };
}
connect();
"""


@dataclass(frozen=True)
class Page:
    """What the page says, and from where it looks.

    Attributes:
        title: Heading.
        legend: Meaning and colour of what is marked.
        size: Height of the centre of mass of what is shown, m.
    """

    title: str
    legend: Sequence[tuple[str, Colour]]
    size: float

    def live(self) -> str:
        """Return the page that follows a run; it loads the script beside it."""
        return self._fill(source=' src="main.min.js"', script="", feed=_LIVE, time="")

    def static(self, commands: Iterable[bytes], time: float) -> str:
        """Return a page that holds everything in itself and needs no server.

        Args:
            commands: Commands of the viewer, each packed.
            time: Shown on the page, s.
        """
        packed = json.dumps([base64.b64encode(command).decode("ascii") for command in commands])
        feed = f"for (const text of {packed}) take(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)));"
        script = SCRIPT.read_text(encoding="utf-8")
        return self._fill(source="", script=script, feed=feed, time=f"{time:.2f} s")

    def _fill(self, **parts: str) -> str:
        # The viewer's camera lives in a frame with y up: (x, z, -y) of the world.
        camera = (1.75 * self.size, 1.4 * self.size, 1.3 * self.size)
        target = (0.0, 0.95 * self.size, 0.0)
        legend = "".join(
            f'<div><i style="background: {_css(colour)}"></i>{html.escape(text)}</div>'
            for text, colour in self.legend
        )
        return _PAGE.substitute(
            title=html.escape(self.title),
            legend=legend,
            camera=", ".join(f"{value:.3f}" for value in camera),
            target=", ".join(f"{value:.3f}" for value in target),
            **parts,
        )


def _css(colour: Colour) -> str:
    return "#" + "".join(f"{round(255 * value):02x}" for value in colour[:3])
