"""The `wbc` command, and its parts for programs: logs, replays, figures and the live view.

A new command is a module in `commands`. Names are loaded when they are used: most commands need few of them.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wbc.app.log.reader import Log
    from wbc.app.log.recorder import Recorder
    from wbc.app.plot.figures import draw
    from wbc.app.plot.output import save
    from wbc.app.plot.signals import draw_signals
    from wbc.app.replay.convert import convert_log
    from wbc.app.replay.film import render_video
    from wbc.app.replay.page import replay_page
    from wbc.app.replay.replay import Replay
    from wbc.app.view.controls import RepeatWalk, interventions_of
    from wbc.app.view.meshcat_view import MeshcatView
    from wbc.app.view.walk_hook import WatchWalk
    from wbc.app.view.workbench import Workbench

__all__ = [
    "Log",
    "MeshcatView",
    "Recorder",
    "RepeatWalk",
    "Replay",
    "WatchWalk",
    "Workbench",
    "convert_log",
    "draw",
    "draw_signals",
    "interventions_of",
    "render_video",
    "replay_page",
    "save",
]

_MODULES = {
    "log.reader": ("Log",),
    "log.recorder": ("Recorder",),
    "plot.figures": ("draw",),
    "plot.output": ("save",),
    "plot.signals": ("draw_signals",),
    "replay.convert": ("convert_log",),
    "replay.film": ("render_video",),
    "replay.page": ("replay_page",),
    "replay.replay": ("Replay",),
    "view.controls": ("RepeatWalk", "interventions_of"),
    "view.meshcat_view": ("MeshcatView",),
    "view.walk_hook": ("WatchWalk",),
    "view.workbench": ("Workbench",),
}


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names:
            return getattr(importlib.import_module(f"wbc.app.{module}"), name)
    raise AttributeError(f"module 'wbc.app' has no attribute '{name}'")
