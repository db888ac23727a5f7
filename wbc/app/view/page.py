"""The page that the browser shows: MeshCat's viewer with a title, time, text and legend, and the controls of a run."""

from __future__ import annotations

import base64
import html
import json
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template

import meshcat

from wbc.app.view.shapes import Colour

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
#time, #text { font-variant-numeric: tabular-nums; }
#text { white-space: pre; }
</style>
</head>
<body>
<div id="pane"></div>
<div id="facts"><b>$title</b><div><span id="time">$time</span> <span id="state"></span></div>
<div id="text">$text</div>$legend</div>
$controls
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

_CONTROLS = """<style>
#bar { position: absolute; left: 12px; right: 12px; bottom: 12px; padding: 6px 12px; border-radius: 6px;
       background: rgba(255, 255, 255, 0.88); color: #222; display: flex; flex-wrap: wrap; gap: 6px 16px;
       align-items: center; }
#bar .group { display: flex; gap: 6px; align-items: center; }
#bar input[type=number] { width: 5.5em; }
#bar #pause { width: 4.5em; }
#bar #change { display: contents; }
#bar summary { cursor: pointer; }
#bar details[open] { flex-basis: 100%; }
#bar .gains { display: flex; flex-wrap: wrap; gap: 6px 16px; }
</style>
<div id="bar">
<span class="group"><button id="pause">pause</button>
<label>speed <select id="speed"><option value="0.1">0.1<option value="0.25">0.25<option value="0.5">0.5
<option value="1">1<option value="2">2<option value="4">4<option value="">as fast as it goes</select></label></span>
<label><input id="follow" type="checkbox" checked> camera follows</label>
<span id="change"></span>
</div>"""

_LIVE = """
let socket = null;
const byId = (id) => document.getElementById(id);
const tell = (wish) => { if (socket && socket.readyState === 1) socket.send(JSON.stringify(wish)); };
const order = (wish) => tell({order: wish});

// ---- what can be changed depends on the run; it says so when the connection is made

function make(tag, parent, attributes = {}, text = "") {
    const made = parent.appendChild(document.createElement(tag));
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.append(text);
    return made;
}
function number(parent, label, unit, value, limits, then) {
    const box = make("label", parent, {}, label + " ");
    const field = make("input", box, {type: "number", step: "any", value: value, ...limits});
    box.append(" " + unit);
    if (then) field.onchange = () => { if (field.value !== "") then(Number(field.value)); };
    return field;
}
function build(controls) {
    const place = byId("change");
    place.replaceChildren();
    if (controls.push) {
        const group = make("span", place, {class: "group"});
        const button = make("button", group, {id: "push"}, "push");
        const direction = make("select", group, {"aria-label": "direction of the push"});
        for (const name of controls.push.directions) make("option", direction, {}, name);
        const limits = {min: 0, max: controls.push.largest};
        const impulse = number(group, "", "Ns/kg", controls.push.impulse, limits);
        button.onclick = () =>
            order({do: "push", direction: direction.value, impulse: Number(impulse.value)});
    }
    if (controls.stop) make("button", place, {id: "stop"}, "stop walking").onclick = () => order({do: "stop"});
    if (controls.stiffness) {
        const limits = {min: controls.stiffness.low, max: controls.stiffness.high, id: "stiffness"};
        number(place, "soles", "Nm/rad", controls.stiffness.value, limits,
            (value) => order({do: "stiffness", value: value}));
    }
    if (controls.gains) {
        const fold = make("details", place, {id: "gains"});
        make("summary", fold, {}, "gains");
        const group = make("span", fold, {class: "gains"});
        for (const gain of controls.gains) {
            number(group, gain.name, gain.unit, gain.value, {min: 0, "data-gain": gain.name},
                (value) => order({do: "gain", name: gain.name, value: value}));
        }
    }
}
let paused = false;
byId("pause").onclick = () => tell({paused: !paused});
byId("speed").onchange = (event) => {
    tell({speed: event.target.value === "" ? null : Number(event.target.value)});
};
document.addEventListener("keydown", (event) => {
    if (event.key === " " && !["SELECT", "INPUT", "BUTTON"].includes(event.target.tagName)) {
        event.preventDefault();
        tell({paused: !paused});
    }
});
function state(facts) {
    paused = facts.paused;
    byId("pause").textContent = paused ? "go on" : "pause";
    const speed = facts.speed === null ? "" : String(facts.speed), select = byId("speed");
    if (![...select.options].some((option) => option.value === speed)) make("option", select, {value: speed}, speed);
    select.value = speed;
}

// ---- frames

// The camera lives in a frame with y up: (x, z, -y) of the world. It follows slowly: hips sway.
const FOLLOW = 0.15;
let seen = null;
function follow(target) {
    const from = seen === null ? [0, 0, START_HEIGHT] : seen;
    const share = seen === null ? 1 : FOLLOW;
    const by = target.map((value, i) => share * (value - from[i]));
    seen = from.map((value, i) => value + by[i]);
    if (!byId("follow").checked) return;
    for (const place of [viewer.camera.position, viewer.controls.target]) {
        place.x += by[0]; place.y += by[2]; place.z -= by[1];
    }
    viewer.controls.update();
}
function bend(path, numbers) {
    // Vertices are moved where they are: an object made anew with each frame would be slow, and flicker.
    let node = viewer.scene_tree;
    for (const name of [...path.split("/").filter((part) => part), "0", "<object>"]) {
        node = node.children[name];
        if (node === undefined) return;
    }
    const geometry = node.object.geometry;
    const places = geometry && geometry.attributes.position;
    if (!places || places.array.length !== numbers.length) return;
    places.array.set(numbers);
    places.needsUpdate = true;
    geometry.computeBoundingSphere();
}
function facts(said) {
    say("time", said.time.toFixed(2) + " s");
    say("text", said.text || "");
    state(said);
    for (const [path, numbers] of Object.entries(said.shapes || {})) bend(path, numbers);
    if (said.target) follow(said.target);
    viewer.set_dirty();
}
function connect() {
    socket = new WebSocket(location.href.replace(/^http/, "ws").replace(/[^/]*$/, "") + "stream");
    socket.binaryType = "arraybuffer";
    socket.onopen = () => say("state", "");
    socket.onmessage = (message) => {
        if (typeof message.data !== "string") { take(message.data); return; }
        const said = JSON.parse(message.data);
        if (!said.hello) { facts(said); return; }
        if (said.hello.page !== PAGE_KEY) { location.reload(); return; }
        build(said.hello.controls);
    };
    // The next run on the same port goes on in the same page.
    socket.onclose = () => {
        say("state", "(ended)");
        byId("change").replaceChildren();
        setTimeout(connect, 1000);
    };
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

    @property
    def key(self) -> int:
        """A number that tells pages apart: a later run that needs another page makes the browser load it anew."""
        return zlib.crc32(f"{self.title} {self.legend} {self.size}".encode())

    def live(self) -> str:
        """Return the page that follows a run; it loads the script beside it."""
        feed = _LIVE.replace("START_HEIGHT", f"{0.95 * self.size:.3f}").replace("PAGE_KEY", str(self.key))
        return self._fill(
            source=' src="main.min.js"', script="", feed=feed, time="", text="", controls=_CONTROLS
        )

    def static(self, commands: Iterable[bytes], time: float, text: str = "") -> str:
        """Return a page that holds everything in itself and needs no server.

        Args:
            commands: Commands of the viewer, each packed.
            time: Shown on the page, s.
            text: Shown on the page below it.
        """
        packed = json.dumps([base64.b64encode(command).decode("ascii") for command in commands])
        feed = f"for (const text of {packed}) take(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)));"
        script = SCRIPT.read_text(encoding="utf-8")
        return self._fill(
            source="",
            script=script,
            feed=feed,
            time=f"{time:.2f} s",
            text=html.escape(text),
            controls="",
        )

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
