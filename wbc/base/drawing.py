"""Pictures of MuJoCo, where this machine has no OpenGL for them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from wbc.base.errors import WbcError

GL_HELP = (
    "offscreen rendering needs OpenGL without a display: install EGL (Debian, Ubuntu: apt install libegl1 "
    "libgl1) and set MUJOCO_GL=egl, or OSMesa (apt install libosmesa6) and set MUJOCO_GL=osmesa"
)


class RenderError(WbcError):
    """Pictures cannot be rendered or written on this machine."""


@contextmanager
def opening() -> Iterator[None]:
    """Let a renderer of MuJoCo be made in the block; a `RenderError` says what to install if it cannot."""
    try:
        yield
    except Exception as error:  # depends on the missing library
        kind, reason = os.environ.get("MUJOCO_GL", ""), str(error) or type(error).__name__
        raise RenderError(f"cannot draw with MUJOCO_GL={kind} ({reason}): {GL_HELP}") from error
