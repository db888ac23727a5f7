"""For all folders: the profile of the property tests, and files that stay whole when processes share the tests."""

import gc
import os
import sys
from ctypes.util import find_library

import pytest
from properties import load_profile

load_profile()
if sys.platform == "linux" and not os.environ.get("DISPLAY") and find_library("EGL"):
    os.environ.setdefault("MUJOCO_GL", "egl")  # films, without a display; MuJoCo reads it when it is imported
gc.disable()  # until all tests are collected: half a million objects that stay


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Give each file to one process of `pytest -n`: the walks that its tests share are walked once."""
    if config.getoption("numprocesses", None) and config.getoption("dist") == "no":
        config.option.dist = "loadfile"


def pytest_collection_finish() -> None:
    """Leave what has been collected alone when garbage is looked for; plants in circles reserve memory: look often."""
    gc.freeze()
    gc.set_threshold(2_000)
    gc.enable()
