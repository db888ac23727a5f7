"""Films of a replay: MP4, rendered offscreen by `mujoco.Renderer`."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import wbc.app.offscreen  # noqa: F401 - before MuJoCo is imported

# isort: split
import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from wbc.app.replay.replay import Replay
from wbc.app.view.marks import Mark, Picture, mark_mesh
from wbc.app.view.stage import Stage
from wbc.base.checked import checked
from wbc.base.errors import InputError, WbcError
from wbc.base.files import check_target, replacing
from wbc.base.numbers import Array
from wbc.base.settings import Positive

Pixels = NDArray[np.uint8]
"""A picture, shape (height, width, 3)."""

GL_HELP = (
    "offscreen rendering needs OpenGL without a display: install EGL (Debian, Ubuntu: apt install libegl1 "
    "libgl1-mesa-dri) and set MUJOCO_GL=egl, or OSMesa (apt install libosmesa6) and set MUJOCO_GL=osmesa"
)
FFMPEG_HELP = 'a film needs the extra "film": pip install -e ".[film]" in the clone'

FOLLOW_TIME = 0.5
"""Time constant with which the camera follows the robot, s."""

MOST_MARKS = 10_000
"""Geoms of marks in a picture."""


class RenderError(WbcError):
    """Pictures cannot be rendered or written on this machine."""


def check_film(path: str | Path, inputs: Iterable[str | Path] = ()) -> Path:
    """Return the path of a film, after `check_target` and a check that it can be made here: `RenderError` if not."""
    target = check_target("a film", path, (".mp4",), inputs)
    if find_spec("imageio_ffmpeg") is None:
        raise RenderError(FFMPEG_HELP)
    renderer(mujoco.MjSpec().compile(), 64, 64).close()
    return target


def renderer(model: mujoco.MjModel, width: int, height: int, samples: int = 0) -> mujoco.Renderer:
    """Return a renderer of pictures of a size in pixels, with samples per pixel, 4 for smooth edges."""
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    model.vis.quality.offsamples = samples
    try:
        return mujoco.Renderer(model, height, width, max_geom=model.ngeom + MOST_MARKS)
    except Exception as error:  # depends on the missing library
        kind, reason = os.environ.get("MUJOCO_GL", ""), str(error) or type(error).__name__
        raise RenderError(f"cannot draw with MUJOCO_GL={kind} ({reason}): {GL_HELP}") from error


@checked
def render_video(
    replay: Replay,
    path: str | Path,
    *,
    rate: Annotated[Positive, "1/s"] = 30.0,
    speed: Positive = 1.0,
    size: tuple[int, int] = (960, 720),
    progress: Callable[[Sequence[int]], Iterable[int]] = iter,
) -> int:
    """Film a replay.

    Args:
        replay: The replay.
        path: File to write, .mp4.
        rate: Pictures a second.
        speed: Seconds of the run in a second of the film.
        size: Width and height, pixels; even numbers.
        progress: Shows how far the work has come, such as `tqdm.tqdm`: called with all ticks, it yields them.

    Returns:
        Number of pictures.

    Raises:
        RenderError: Not possible on this machine; the message says what to install.
    """
    target = check_film(path, [replay.log.path])
    width, height = size
    if min(size) < 16 or width % 2 or height % 2:
        raise InputError(f"size of a film must be two even numbers of at least 16, got {width} x {height}")
    ticks = replay.ticks(rate, speed)
    with replacing(target) as new:
        _write(new, _pictures(replay, progress(ticks), rate, size), rate, size)
    return len(ticks)


def _pictures(replay: Replay, ticks: Iterable[int], rate: float, size: tuple[int, int]) -> Iterator[Pixels]:
    height = replay.scale.height
    camera, places = mujoco.MjvCamera(), replay.base_places
    camera.distance, camera.azimuth, camera.elevation = 3.2 * height, 130.0, -12.0
    camera.lookat[:] = (*places[0, :2], replay.floor + 0.85 * height)
    share = 1.0 - np.exp(-1.0 / (rate * FOLLOW_TIME))
    with renderer(replay.model, *size) as drawn:
        for tick in ticks:
            picture = replay.picture(tick)
            camera.lookat[:2] += share * (places[tick, :2] - camera.lookat[:2])
            yield _with_caption(draw(drawn, replay, picture, camera), replay.title, picture)


def draw(drawn: mujoco.Renderer, stage: Stage, picture: Picture, camera: mujoco.MjvCamera) -> Pixels:
    """Return a picture of a stage, whose bodies are where they are to be, with its marks."""
    model = stage.model
    for body, colour in picture.colours.items():
        model.geom_rgba[model.geom_bodyid == body] = colour
    model.light_pos[:] = camera.lookat - 4.0 * model.light_dir  # shadows are drawn around the lamp alone
    mujoco.mj_camlight(model, stage.data)
    drawn.update_scene(stage.data, camera)
    add_marks(drawn.scene, picture.marks)
    pixels: Pixels = drawn.render()
    return pixels


def add_marks(scene: mujoco.MjvScene, marks: Sequence[Mark]) -> None:
    """Add geoms for marks to MuJoCo's picture; those beyond its room are left out."""
    kinds, level = mujoco.mjtGeom, np.eye(3)

    def add(kind: mujoco.mjtGeom, mark: Mark, size: float, place: Array, axes: Array = level) -> None:
        if scene.ngeom < scene.maxgeom:
            geom, colour = scene.geoms[scene.ngeom], np.array(mark.colour, dtype=np.float32)
            mujoco.mjv_initGeom(geom, kind, np.full(3, size), place, axes.ravel(), colour)
            scene.ngeom += 1

    for mark in marks:
        points = np.asarray(mark.points, dtype=np.float64)
        if mark.kind == "ball":
            add(kinds.mjGEOM_SPHERE, mark, mark.size, points[0])
        elif mark.kind == "arrow" and scene.ngeom < scene.maxgeom:
            add(kinds.mjGEOM_ARROW, mark, mark.size, points[0])
            geom = scene.geoms[scene.ngeom - 1]
            mujoco.mjv_connector(geom, kinds.mjGEOM_ARROW, mark.size, points[0], points[1])
            geom.size[2] *= 2.0  # it is drawn half as long as the connector says
        else:
            vertices, faces = mark_mesh(mark)
            for corner, one, other in np.asarray(vertices, dtype=np.float64)[faces]:
                sides = np.stack([one - corner, other - corner])
                add(kinds.mjGEOM_TRIANGLE, mark, 1.0, corner, np.column_stack([*sides, np.cross(*sides)]))


def _with_caption(pixels: Pixels, title: str, picture: Picture) -> Pixels:
    """Return a picture with title, time and text."""
    image, size = Image.fromarray(pixels), max(10, len(pixels) // 36)
    text = "\n".join([f"{title}   {picture.time:.2f} s", *picture.text])
    font = ImageFont.load_default(size)
    ImageDraw.Draw(image).multiline_text((size, size), text, fill=(30, 30, 30), font=font, spacing=4)
    return np.asarray(image)


def _write(path: Path, pictures: Iterator[Pixels], rate: float, size: tuple[int, int]) -> None:
    import imageio_ffmpeg  # noqa: PLC0415 - an extra

    film = imageio_ffmpeg.write_frames(str(path), size, fps=rate, codec="libx264", macro_block_size=2)
    film.send(None)
    try:
        for picture in pictures:
            film.send(np.ascontiguousarray(picture))
        film.close()
        imageio_ffmpeg.count_frames_and_secs(str(path))  # a full disk is no error of the writer
    except (OSError, RuntimeError) as error:
        raise RenderError(f"ffmpeg could not write the film: {str(error).splitlines()[0]}") from error
    finally:
        film.close()
