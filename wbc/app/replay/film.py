"""Films of a replay: MP4, rendered offscreen by `mujoco.Renderer`."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from wbc.app.replay.replay import Replay
from wbc.app.view.marks import Picture
from wbc.app.view.mujoco_view import MOST_MARKS, MujocoMarks, paint_bodies
from wbc.app.view.stage import Stage
from wbc.base.checked import checked
from wbc.base.drawing import RenderError, opening
from wbc.base.errors import InputError
from wbc.base.files import check_target, replacing
from wbc.base.numbers import lag_gain
from wbc.base.settings import Positive
from wbc.sim.plant.model import aim

Pixels = NDArray[np.uint8]
"""A picture, shape (height, width, 3)."""

FOLLOW_TIME = 0.5
"""Time constant with which the camera follows the robot, s."""

SHADOW = 1024
"""Side of the map of shadows, pixels; without a graphics card the time of a picture grows with it."""


def check_film(path: str | Path, inputs: Iterable[str | Path] = ()) -> Path:
    """Return the path of a film, after `check_target` and a check that it can be made here: `RenderError` if not."""
    target = check_target("a film", path, (".mp4",), inputs)
    if find_spec("imageio_ffmpeg") is None:
        raise RenderError('a film needs the extra "film": pip install -e ".[film]" in the clone')
    renderer(mujoco.MjSpec().compile(), 64, 64).close()
    return target


class Renderer(mujoco.Renderer):  # type: ignore[misc]  # MuJoCo has no types
    """Renderer of stages with their marks, which draws a copy of their model and data; see `renderer`."""

    def __init__(self, model: mujoco.MjModel, height: int, width: int) -> None:
        super().__init__(model, height, width, max_geom=model.ngeom + MOST_MARKS)
        self._copy, self._data = model, mujoco.MjData(model)
        self._marks = MujocoMarks(self.scene)

    def draw(self, stage: Stage, picture: Picture, camera: mujoco.MjvCamera) -> Pixels:
        """Return a picture of a stage, whose bodies are where they are to be, with its marks."""
        model, data = self._copy, self._data
        mujoco.mj_copyData(data, model, stage.data)
        model.geom_rgba[:] = stage.model.geom_rgba
        paint_bodies(model, picture.colours)
        model.light_pos[:] = camera.lookat - 4.0 * model.light_dir  # shadows are drawn around the lamp alone
        mujoco.mj_camlight(model, data)
        self.update_scene(data, camera)
        self._marks.add(picture.marks)
        pixels: Pixels = self.render()
        return pixels


def renderer(model: mujoco.MjModel, width: int, height: int, samples: int = 0) -> Renderer:
    """Return a renderer of pictures of a size in pixels, with samples per pixel, 4 for smooth edges."""
    model = copy.copy(model)
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    model.vis.quality.offsamples, model.vis.quality.shadowsize = samples, SHADOW
    with opening():
        return Renderer(model, height, width)


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
    """Film a replay of a log as an MP4 file.

    Args:
        replay: The replay.
        path: File to write, .mp4.
        rate: Pictures per second, Hz.
        speed: Speed of the film: seconds of the run in one second of the film.
        size: Width and height, pixels; both even.
        progress: Wrapper that shows the progress, such as `tqdm.tqdm`: it is called with all ticks, and yields them.

    Returns:
        Number of pictures.

    Raises:
        RenderError: Films cannot be made on this machine; the message says what to install.
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
    stage, height = replay.stage, replay.stage.scale.height
    camera, places = mujoco.MjvCamera(), replay.base_places
    aim(camera, height, (*places[0, :2], stage.floor + 0.85 * height))
    share = lag_gain(1.0 / rate, FOLLOW_TIME)
    with renderer(stage.model, *size) as drawn:
        for tick in ticks:
            picture = replay.picture(tick)
            camera.lookat[:2] += share * (places[tick, :2] - camera.lookat[:2])
            yield _with_caption(drawn.draw(stage, picture, camera), replay.title, picture)


def _with_caption(pixels: Pixels, title: str, picture: Picture) -> Pixels:
    image, size = Image.fromarray(pixels), max(10, min(pixels.shape[:2]) // 36)
    text = "\n".join([f"{title}   {picture.time:.2f} s", *picture.text])
    font = ImageFont.load_default(size)
    ImageDraw.Draw(image).multiline_text((size, size), text, fill=(30, 30, 30), font=font, spacing=4)
    return np.asarray(image)


def _write(path: Path, pictures: Iterator[Pixels], rate: float, size: tuple[int, int]) -> None:
    import imageio_ffmpeg  # noqa: PLC0415 - an extra

    film = imageio_ffmpeg.write_frames(
        str(path),
        size,
        fps=rate,
        codec="libx264",
        macro_block_size=2,
        output_params=["-preset", "veryfast"],  # the same quality in two fifths of the usual preset's time
    )
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
