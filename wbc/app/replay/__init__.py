"""Replays of logs: a page with a time slider, a film, or a file for Rerun or Foxglove. A new format is a new module.

replay = Replay(Log.open("walk.arrow"))
Player(replay).run()
render_video(replay, "walk.mp4")
convert_log(Log.open("walk.arrow"), "walk.rrd")
"""
