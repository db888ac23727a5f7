"""The `wbc` command, and its parts for programs: logs, replays, figures and the live view.

A new command is a module in `commands`. Names are loaded when they are used: most commands need few of them.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wbc.app.log import Log, Recorder
    from wbc.app.plot import draw, draw_signals, save
    from wbc.app.replay import Replay, render_video, replay_page
    from wbc.app.view import MeshcatView, WatchWalk, Workbench

__all__ = [
    "Log",
    "MeshcatView",
    "Recorder",
    "Replay",
    "WatchWalk",
    "Workbench",
    "draw",
    "draw_signals",
    "render_video",
    "replay_page",
    "save",
]

_ROOMS = {
    "log": ("Log", "Recorder"),
    "plot": ("draw", "draw_signals", "save"),
    "replay": ("Replay", "render_video", "replay_page"),
    "view": ("MeshcatView", "WatchWalk", "Workbench"),
}


def __getattr__(name: str) -> Any:
    for room, names in _ROOMS.items():
        if name in names:
            return getattr(importlib.import_module(f"wbc.app.{room}"), name)
    raise AttributeError(f"module 'wbc.app' has no attribute '{name}'")
