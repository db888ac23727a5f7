"""Libraries that draw, where the environment names what this machine has not.

MuJoCo reads `MUJOCO_GL` when it is imported, Matplotlib `MPLBACKEND`, and neither can be imported with a wrong one. A
simulation runs without pictures then, and files are drawn without a backend. Without a display, renderers take EGL or
OSMesa.
"""

from __future__ import annotations

import ctypes
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from ctypes.util import find_library
from importlib import import_module
from typing import Any

from wbc.base.errors import WbcError

logger = logging.getLogger(__name__)

VARIABLE, BACKEND = "MUJOCO_GL", "MPLBACKEND"

ANYWHERE = ["glfw", "enable", "enabled", "on", "true", "1", "disable", "disabled", "off", "false", "0"]
"""Values that MuJoCo takes on each system."""

OWN = {"linux": ("glx", "egl", "osmesa"), "darwin": ("cgl",), "win32": ("wgl",)}
"""Platform → its values."""

LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}
"""Value → the library that it needs."""

GL_HELP = (
    "offscreen rendering needs OpenGL without a display: install EGL (Debian, Ubuntu: apt install libegl1 "
    "libgl1) and set MUJOCO_GL=egl, or OSMesa (apt install libosmesa6) and set MUJOCO_GL=osmesa"
)

_unusable: list[str] = []
_refusals: list[str] = []  # of renderers that this process could not make


class RenderError(WbcError):
    """Pictures cannot be rendered or written on this machine."""


def check_opengl() -> None:
    """Switch MuJoCo's pictures off, with a warning, if `MUJOCO_GL` names what this machine has not."""
    given = os.environ.get(VARIABLE, "")
    value = given.lower().strip()
    if not value or "mujoco" in sys.modules:
        return
    if value in ANYWHERE or (value in OWN.get(sys.platform, ()) and _is_installed(LIBRARIES.get(value))):
        return
    os.environ[VARIABLE] = "disable"
    _unusable.append(given)
    logger.warning("%s", advice())


def advice() -> str:
    """Return what to do about a value of `MUJOCO_GL` that was switched off; empty for none."""
    if not _unusable:
        return ""
    return (
        f"{VARIABLE}={_unusable[-1]} cannot be used on this machine, and MuJoCo draws no pictures: unset it, or set "
        f"one of {', '.join(OWN.get(sys.platform, ()))} whose library is installed"
    )


@contextmanager
def opening() -> Iterator[None]:
    """Let a renderer of MuJoCo be made in the block; a `RenderError` says what to install if it cannot.

    MuJoCo is not asked again after its own `FatalError`: a second attempt would abort the process.
    """
    if _refusals:
        raise RenderError(_refusals[-1])
    try:
        _take_library()
        yield
    except Exception as error:  # depends on the missing library
        kind, reason = os.environ.get(VARIABLE, ""), str(error) or type(error).__name__
        said = advice() or f"cannot draw with {VARIABLE}={kind} ({reason}): {GL_HELP}"
        if type(error).__name__ == "FatalError":
            _refusals.append(said)
        raise RenderError(said) from error


def _take_library() -> None:
    """Let MuJoCo's renderers take the library that `MUJOCO_GL` names; without it and a display the first installed one.

    MuJoCo itself reads the variable only when it is imported, and takes the display's library without it.
    """
    shows = sys.platform != "linux" or {"DISPLAY", "WAYLAND_DISPLAY"} & {*os.environ}
    usual = "" if shows else next((value for value, name in LIBRARIES.items() if _is_installed(name)), "")
    value = os.environ.get(VARIABLE, "").lower().strip() or usual
    if value in LIBRARIES:
        os.environ[VARIABLE] = value
        import mujoco  # noqa: PLC0415 - who draws has imported it

        contexts: Any = sys.modules[mujoco.Renderer.__module__]
        contexts.gl_context.GLContext = import_module(f"mujoco.{value}").GLContext


def _is_installed(library: str | None) -> bool:
    if library is None or find_library(library) is not None:
        return True
    for name in (f"lib{library}.so", f"lib{library}.so.1"):  # where no list of libraries is found
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False


def import_matplotlib() -> None:
    """Import Matplotlib; a backend that it does not have is left out, and any other is as the variable says."""
    if "matplotlib" in sys.modules:
        return
    backend = os.environ.pop(BACKEND, None)
    try:
        import matplotlib as mpl  # noqa: PLC0415 - slow, and few programs draw
    finally:
        if backend is not None:
            os.environ[BACKEND] = backend
    if backend:
        with suppress(ValueError):
            mpl.rcParams["backend"] = backend
