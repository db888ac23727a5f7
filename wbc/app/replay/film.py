"""Films of a replay: MP4 or GIF, rendered offscreen by MuJoCo."""

from __future__ import annotations

import contextlib
import importlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from wbc.app.files import FILMS, check_target
from wbc.app.replay.mujoco_scene import MujocoScene
from wbc.app.replay.overlays import caption
from wbc.app.replay.replay import Replay
from wbc.app.scene.colours import ARROW_COLOURS
from wbc.core.arguments import checked
from wbc.core.errors import InputError, WbcError
from wbc.core.files import replacing

Picture = NDArray[np.uint8]

GL_HELP = (
    "offscreen rendering needs OpenGL without a display: install EGL (Debian, Ubuntu: apt install libegl1 "
    "libgl1-mesa-dri), or OSMesa (apt install libosmesa6) and set MUJOCO_GL=osmesa"
)
FFMPEG_HELP = 'MP4 needs ffmpeg: install it, or the extra "film": pip install -e ".[film]"; GIF needs none'
GIF_RATE = 20.0
"""Largest rate of a GIF, 1/s: players round the time between two pictures to hundredths of a second."""

FOLLOW_TIME = 0.5
"""Time constant with which the camera follows the robot, s."""


class RenderError(WbcError):
    """Pictures cannot be rendered or written on this machine."""


def check_film(path: str | Path, inputs: Iterable[str | Path] = ()) -> Path:
    """Return the path of a film to be written, after a check by `check_target` and one that it can be made here.

    `RenderError` for no ffmpeg for MP4, or no offscreen rendering; the message says what to install.
    """
    target = check_target("a film", path, FILMS, inputs)
    if target.suffix.lower() == ".mp4":
        find_ffmpeg()
    with _drawing_context(64, 64):
        pass
    return target


def find_ffmpeg() -> str:
    """Return the path of ffmpeg: the system's, else the one that comes with the extra `film`, a program under the GPL.

    `RenderError` if neither is installed.
    """
    if (path := shutil.which("ffmpeg")) is not None:
        return path
    try:
        import imageio_ffmpeg  # noqa: PLC0415 - an extra

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError) as error:
        raise RenderError(FFMPEG_HELP) from error


@checked
def render_video(
    replay: Replay,
    path: str | Path,
    *,
    rate: float = 30.0,
    speed: float = 1.0,
    size: tuple[int, int] = (960, 720),
    progress: Callable[[int, int], None] | None = None,
) -> int:
    """Film a replay.

    Args:
        replay: The replay.
        path: File to write, .mp4 or .gif.
        rate: Pictures a second; a GIF takes at most 20.
        speed: Seconds of the run in a second of the film.
        size: Width and height, pixels; even numbers.
        progress: Called after each picture with the number of finished pictures and of all.

    Returns:
        Number of pictures.

    Raises:
        InputError: A path that cannot be written, or a value out of range.
        RenderError: Not possible on this machine; the message says what to install.
    """
    target = check_film(path, [replay.log.path])
    width, height = size
    if min(size) < 16 or width % 2 or height % 2:
        raise InputError(f"size of a film must be two even numbers of at least 16, got {width} x {height}")
    if target.suffix.lower() == ".gif":
        rate = min(rate, GIF_RATE)
    ticks = replay.ticks(rate, speed)
    write = _write_gif if target.suffix.lower() == ".gif" else _write_mp4
    with replacing(target) as new:
        write(new, _pictures(replay, ticks, rate, size, progress), rate, size)
    return len(ticks)


def _pictures(
    replay: Replay,
    ticks: list[int],
    rate: float,
    size: tuple[int, int],
    progress: Callable[[int, int], None] | None,
) -> Iterator[Picture]:
    """Yield the pictures."""
    width, height = size
    drawn = MujocoScene(replay.scene, replay.terrain, width, height, replay.sole_paths)
    camera = mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = 3.2 * replay.scene.com_height, 130.0, -12.0
    places = replay.base_places
    camera.lookat[:] = (*places[ticks[0], :2], replay.scene.floor + 0.85 * replay.scene.com_height)
    share = 1.0 - np.exp(-1.0 / (rate * FOLLOW_TIME))
    with _drawing_context(width, height):
        context = mujoco.MjrContext(drawn.model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
        scene, option = mujoco.MjvScene(drawn.model, maxgeom=20_000), mujoco.MjvOption()
        view, pixels = mujoco.MjrRect(0, 0, width, height), np.empty((height, width, 3), dtype=np.uint8)
        try:
            for i, tick in enumerate(ticks):
                camera.lookat[:2] += share * (places[tick, :2] - camera.lookat[:2])
                drawn.set(replay.frame(tick), replay.sole_colours(tick))
                everything = mujoco.mjtCatBit.mjCAT_ALL
                mujoco.mjv_updateScene(drawn.model, drawn.data, option, None, camera, everything, scene)
                _add_forces(scene, replay, tick)
                mujoco.mjr_render(view, scene, context)
                mujoco.mjr_readPixels(pixels, None, view, context)
                yield _with_caption(pixels[::-1], replay, tick)
                if progress is not None:
                    progress(i + 1, len(ticks))
        finally:
            context.free()


def _add_forces(scene: Any, replay: Replay, tick: int) -> None:
    """Add an arrow for each force to the picture."""
    arrow = mujoco.mjtGeom.mjGEOM_ARROW
    for kind, point, force in replay.snapshot(tick).forces:
        reach = replay.scene.reach(force)
        if np.linalg.norm(reach) < 1e-3 or scene.ngeom >= scene.maxgeom:
            continue
        start, end = (point - reach, point) if kind == "push" else (point, point + reach)
        geom = scene.geoms[scene.ngeom]
        colour = np.array(ARROW_COLOURS[kind], dtype=np.float32)
        mujoco.mjv_initGeom(geom, arrow, np.zeros(3), np.zeros(3), np.eye(3).ravel(), colour)
        mujoco.mjv_connector(geom, arrow, 0.02 * replay.scene.com_height, start, end)
        scene.ngeom += 1


def _with_caption(pixels: Picture, replay: Replay, tick: int) -> Picture:
    """Return a picture with title, time and caption."""
    picture, log, size = Image.fromarray(np.ascontiguousarray(pixels)), replay.log, max(10, len(pixels) // 36)
    title = f"{log.header.get('title') or replay.scene.title}   {log.time[tick]:.2f} s"
    text, font = f"{title}\n{caption(log, tick, replay.drift)}".strip(), ImageFont.load_default(size)
    ImageDraw.Draw(picture).multiline_text((size, size), text, fill=(30, 30, 30), font=font, spacing=4)
    return np.asarray(picture)


@contextlib.contextmanager
def _drawing_context(width: int, height: int) -> Iterator[None]:
    """Make an offscreen OpenGL context; `RenderError` if OpenGL is not available."""
    usual = "cgl" if sys.platform == "darwin" else "egl"
    kind = os.environ.get("MUJOCO_GL", "").strip().lower()
    if kind not in ("egl", "osmesa", "glfw", "cgl"):
        kind = usual
    context = None
    try:
        context = importlib.import_module(f"mujoco.{kind}").GLContext(width, height)
        context.make_current()
    except Exception as error:  # depends on the missing library
        reason = str(error) or type(error).__name__
        raise RenderError(f"cannot draw with MUJOCO_GL={kind} ({reason}): {GL_HELP}") from error
    try:
        yield
    finally:
        context.free()


def _write_mp4(path: Path, pictures: Iterator[Picture], rate: float, size: tuple[int, int]) -> None:
    command = [find_ffmpeg(), "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{size[0]}x{size[1]}", "-r", f"{rate:g}", "-i", "-", "-an", "-c:v", "libx264"]
    command += ["-pix_fmt", "yuv420p", "-crf", "23", "-movflags", "+faststart", str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None and process.stderr is not None
        try:
            for picture in pictures:
                process.stdin.write(picture.tobytes())
        except BrokenPipeError:
            pass
        finally:
            with contextlib.suppress(BrokenPipeError):
                process.stdin.close()
            message = process.stderr.read().decode(errors="replace").strip()
    if process.returncode != 0:
        raise RenderError(f"ffmpeg could not write the film: {message or process.returncode}")


def _write_gif(path: Path, pictures: Iterator[Picture], rate: float, size: tuple[int, int]) -> None:
    frames = (Image.fromarray(picture).quantize(128, dither=Image.Dither.NONE) for picture in pictures)
    first = next(frames)
    first.save(path, save_all=True, append_images=frames, duration=round(1000.0 / rate), loop=0)
