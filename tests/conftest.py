"""For all folders: property tests, files that stay whole when processes share the tests, bytecode for children."""

import gc
import os

import pytest
from properties import load_profile

load_profile()
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # each of a hundred children would compile the library anew
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
