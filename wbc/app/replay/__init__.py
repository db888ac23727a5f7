"""Replays of logs: a page with a time slider, a film, or a file for another viewer. A new format is a new module.

replay = Replay(Log.open("walk.arrow"))
Path("walk.html").write_text(replay_page(replay))
render_video(replay, "walk.mp4")
convert_log(Log.open("walk.arrow"), "walk.mcap")
"""

from wbc.app.replay.convert import check_conversion, convert_log
from wbc.app.replay.film import RenderError, check_film, render_video
from wbc.app.replay.page import check_page, replay_page
from wbc.app.replay.replay import Replay

__all__ = [
    "RenderError",
    "Replay",
    "check_conversion",
    "check_film",
    "check_page",
    "convert_log",
    "render_video",
    "replay_page",
]
