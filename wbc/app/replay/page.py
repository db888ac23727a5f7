"""Self-contained HTML page of a replay: the viewer's page with a time slider."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from wbc.app.replay.overlays import caption
from wbc.app.replay.replay import Replay
from wbc.app.view.page import Page
from wbc.app.view.viewer_commands import empty_scene, object_commands, transform_command
from wbc.core.arguments import checked

CONTROLS = Path(__file__).with_name("controls.html")
"""Slider, buttons and script of the page."""

RATE = 30.0
"""Rate of pictures, 1/s, as in the live view."""


@checked
def replay_page(
    replay: Replay,
    *,
    rate: float = RATE,
    progress: Callable[[int, int], None] | None = None,
    nonce: str = "",
) -> str:
    """Return the page.

    Args:
        replay: The replay.
        rate: Pictures for each second of the run, 1/s.
        progress: Called after each picture with the number of finished pictures and of all.
        nonce: Number of its scripts in the content security policy, if the page is served.

    Raises:
        InputError: A rate that is not above zero.
    """
    ticks = replay.ticks(rate)
    frames = np.empty((len(ticks), len(replay.scene.moving), 4, 3), dtype="<f4")
    for i, tick in enumerate(ticks):
        frames[i] = replay.frame(tick)[:, :3, :].transpose(0, 2, 1)
        if progress is not None:
            progress(i + 1, len(ticks))
    log, places = replay.log, replay.base_places[ticks]
    controls = Template(CONTROLS.read_text("utf-8")).substitute(
        nonce=nonce,
        last=len(ticks) - 1,
        paths=_script_text(replay.scene.moving),
        times=json.dumps([round(float(t), 4) for t in log.time[ticks]]),
        captions=_script_text([caption(log, tick, replay.drift) for tick in ticks]),
        soles=_script_text(replay.sole_paths),
        colours=json.dumps([replay.sole_colours(tick) if any(replay.sole_paths) else [] for tick in ticks]),
        targets=json.dumps(np.round(places[:, :2], 4).tolist()),
        frames=base64.b64encode(frames.tobytes()).decode("ascii"),
    )
    title = f"{log.header.get('title') or replay.scene.title}"
    page = Page(title, replay.scene.legend, replay.scene.com_height).static(
        _first_picture(replay, ticks[0]), float(log.time[ticks[0]]), nonce=nonce
    )
    head, end, tail = page.rpartition("</body>")
    return head + controls + end + tail


def _first_picture(replay: Replay, tick: int) -> list[bytes]:
    """Return the commands that build the scene at a tick."""
    commands = empty_scene()
    for path, matrix in zip(replay.scene.moving, replay.frame(tick), strict=True):
        commands.append(transform_command(path, matrix.T.ravel()))
    commands += [command for thing in replay.scene.objects for command in object_commands(thing)]
    return commands


def _script_text(values: Sequence[Any]) -> str:
    """Return texts as JSON that may stand in a script."""
    return json.dumps(values).replace("<", "\\u003c")
