"""Replays of logs: a page with a time slider that opens offline, or a film. A new format of export is a new module.

replay = Replay(Log.open("walk.arrow"))
Path("walk.html").write_text(replay_page(replay))
render_video(replay, "walk.mp4")
"""

from wbc.app.replay.film import RenderError, check_film, render_video
from wbc.app.replay.page import check_page, replay_page
from wbc.app.replay.replay import Replay

__all__ = ["RenderError", "Replay", "check_film", "check_page", "render_video", "replay_page"]
