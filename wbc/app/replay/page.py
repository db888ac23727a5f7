"""One HTML page with a whole replay in it: the viewer's page with a time slider; it needs no network."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
import umsgpack  # type: ignore[import-untyped]  # comes with meshcat, which speaks it

from wbc.app.files import check_target
from wbc.app.replay.replay import Replay
from wbc.app.replay.texts import caption
from wbc.app.view.page import Page
from wbc.app.view.scene import ROOT, SKY_COLOURS
from wbc.app.view.server import object_commands, transform_command

PAGES = (".html", ".htm")

RATE = 30.0
"""Pictures a second of the run, as in the live view."""

_CONTROLS = Template("""
<style>
#bar { position: absolute; left: 12px; right: 12px; bottom: 12px; padding: 8px 12px; border-radius: 6px;
       background: rgba(255, 255, 255, 0.88); color: #222; display: flex; gap: 12px; align-items: center; }
#bar input[type=range] { flex: 1; }
#bar button { width: 4.5em; }
</style>
<div id="bar">
<button id="play">pause</button>
<input id="slider" type="range" min="0" max="$last" value="0" step="1" aria-label="time">
<label>speed <select id="speed"><option>0.1<option>0.25<option>0.5<option selected>1<option>2<option>4</select></label>
<label><input id="follow" type="checkbox" checked> follow</label>
</div>
<script>
const paths = $paths;
const times = $times;
const captions = $captions;
const targets = $targets;
const soles = $soles;
const colours = $colours;
// Matrices by columns without the last row, 4-byte floats: frames, then paths.
const floats = new Float32Array(Uint8Array.from(atob("$frames"), (c) => c.charCodeAt(0)).buffer);
const slider = document.getElementById("slider");
let shown = -1, playing = true, clock = null, now = times[0], seen = targets[0];
function show(frame) {
    if (frame === shown) return;
    for (let i = 0; i < paths.length; i++) {
        const m = floats.subarray(12 * (frame * paths.length + i), 12 * (frame * paths.length + i + 1));
        if (shown >= 0) {
            const old = floats.subarray(12 * (shown * paths.length + i), 12 * (shown * paths.length + i + 1));
            if (m.every((value, k) => value === old[k])) continue;
        }
        viewer.handle_command({type: "set_transform", path: paths[i],
            matrix: [m[0], m[1], m[2], 0, m[3], m[4], m[5], 0, m[6], m[7], m[8], 0, m[9], m[10], m[11], 1]});
    }
    for (let i = 0; i < colours[frame].length; i++) {
        const colour = colours[frame][i];
        if (shown >= 0 && String(colour) === String(colours[shown][i])) continue;
        for (const path of soles[i]) {
            viewer.handle_command({type: "set_property", path, property: "color", value: colour});
        }
    }
    if (document.getElementById("follow").checked) {
        // The camera lives in a frame with y up: (x, z, -y) of the world.
        const dx = targets[frame][0] - seen[0], dy = targets[frame][1] - seen[1];
        viewer.camera.position.x += dx; viewer.camera.position.z -= dy;
        viewer.controls.target.x += dx; viewer.controls.target.z -= dy;
        viewer.controls.update();
    }
    seen = targets[frame];
    shown = frame;
    slider.value = frame;
    say("time", times[frame].toFixed(2) + " s");
    say("text", captions[frame]);
    viewer.set_dirty();
}
function frame_at(time) {
    let frame = Math.min(Math.max(shown, 0), times.length - 1);
    while (frame + 1 < times.length && times[frame + 1] <= time) frame++;
    while (frame > 0 && times[frame] > time) frame--;
    return frame;
}
function step(stamp) {
    if (playing && clock !== null) {
        now += Math.min(0.1, (stamp - clock) / 1000) * Number(document.getElementById("speed").value);
        if (now > times[times.length - 1]) now = times[0];
        show(frame_at(now));
    }
    clock = stamp;
    requestAnimationFrame(step);
}
function play(on) { playing = on; document.getElementById("play").textContent = on ? "pause" : "play"; }
document.getElementById("play").onclick = () => play(!playing);
slider.oninput = () => { play(false); now = times[Number(slider.value)]; show(Number(slider.value)); };
document.addEventListener("keydown", (event) => {
    if (event.target.tagName === "SELECT") return;
    const by = {ArrowLeft: -1, ArrowRight: 1}[event.key];
    if (event.key === " ") { event.preventDefault(); play(!playing); }
    else if (by) {
        event.preventDefault();
        play(false);
        const frame = Math.min(Math.max(shown + by, 0), times.length - 1);
        now = times[frame];
        show(frame);
    }
});
show(0);
requestAnimationFrame(step);
</script>
""")


def replay_page(
    replay: Replay,
    *,
    rate: float = RATE,
    progress: Callable[[int, int], None] | None = None,
) -> str:
    """Make the page.

    Args:
        replay: What to show.
        rate: Pictures a second of the run, 1/s.
        progress: Called with the number of pictures made, and of all, after each.

    Raises:
        InputError: A rate that is not above zero.
    """
    ticks = replay.ticks(rate)
    frames = np.empty((len(ticks), len(replay.moving), 4, 3), dtype="<f4")
    for i, tick in enumerate(ticks):
        frames[i] = replay.frame(tick)[:, :3, :].transpose(0, 2, 1)
        if progress is not None:
            progress(i + 1, len(ticks))
    log, places = replay.log, replay.log["truth/base/position"][ticks]
    controls = _CONTROLS.substitute(
        last=len(ticks) - 1,
        paths=json.dumps(replay.moving),
        times=json.dumps([round(float(t), 4) for t in log.time[ticks]]),
        captions=_script_text([caption(log, tick) for tick in ticks]),
        soles=json.dumps(replay.sole_paths),
        colours=json.dumps([replay.sole_colours(tick) if any(replay.sole_paths) else [] for tick in ticks]),
        targets=json.dumps(np.round(places[:, :2], 4).tolist()),
        frames=base64.b64encode(frames.tobytes()).decode("ascii"),
    )
    title = f"{log.header.get('title') or replay.scene.title}"
    page = Page(title, replay.overlays.legend, replay.scene.size).static(
        _first_picture(replay, ticks[0]), float(log.time[ticks[0]])
    )
    head, end, tail = page.rpartition("</body>")
    return head + controls + end + tail


def check_page(path: str | Path) -> Path:
    """Return where a page is to be written.

    Raises:
        InputError: Not the ending of a page, no such folder, or not writable.
    """
    return check_target("a page", path, PAGES)


def _first_picture(replay: Replay, tick: int) -> list[bytes]:
    """Commands that build the scene as it is at a tick."""
    scene = replay.scene
    settings: list[tuple[str, str, Any]] = [("/Grid", "visible", False)]
    settings += [("/Background", key, list(colour)) for key, colour in SKY_COLOURS.items()]
    commands = [umsgpack.packb({"type": "delete", "path": ROOT})]
    for path, key, value in settings:
        command = {"type": "set_property", "path": path, "property": key, "value": value}
        commands.append(umsgpack.packb(command))
    for path, matrix in zip(replay.moving, replay.frame(tick), strict=True):
        commands.append(transform_command(path, matrix.T.ravel()))
    commands += [command for drawing in scene.drawings for command in object_commands(drawing)]
    return commands


def _script_text(values: list[str]) -> str:
    """JSON that may stand in a script."""
    return json.dumps(values).replace("<", "\\u003c")
