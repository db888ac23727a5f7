"""Imports that users rely on: no simulator below the simulator, and one copy of every module."""

from __future__ import annotations

import ast
import importlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("name", ["robots", "feet", "tasks", "sim"])
def test_links_lead_to_the_folders_beside(name: str) -> None:
    link = ROOT / "wbc" / name
    assert link.is_symlink() and link.readlink() == Path("..") / name
    assert link.resolve() == ROOT / name


LOADED = """
import importlib, pkgutil, sys, wbc
assert "numpy" not in sys.modules, "names are loaded when they are asked for"
controller = wbc.balance_controller(wbc.load_robot("hrp4_class").robot(), 0.005)
assert controller.solve().ok and wbc.TorqueControl and wbc.InverseKinematics and wbc.WalkingControl
others = {"matplotlib", "pandas", "sklearn", "pyarrow", "rich", "cyclopts", "gymnasium", "PIL", "viser"}
assert not (others | {"mujoco"}) & set(sys.modules), "a controller"
for name in ("base", "core", "robots", "feet", "tasks", "walking", "machine"):
    package = importlib.import_module(f"wbc.{name}")
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not module.name.endswith("_mjcf"):
            importlib.import_module(module.name)
from wbc.feet.soles.catalog import foot, foot_names
from wbc.feet.soles.foot import AnkleSole
for name in foot_names():
    foot(name).fit(AnkleSole.under_ankle(0.09, 0.16, 0.08))
assert not {"mujoco", "matplotlib", "meshcat"} & set(sys.modules), "all below the simulator"
wbc.Plant("hrp4_class").measure()
assert not others & set(sys.modules), "a plant"
from wbc.sim import WalkSpec; WalkSpec().prepare()
assert not others & set(sys.modules), "a walk"
from wbc.app import Log, Recorder, Replay
assert not {"matplotlib", "pandas", "sklearn", "viser"} & set(sys.modules), "a log"
"""


def test_a_controller_needs_no_simulator_and_slow_libraries_are_loaded_when_they_are_asked_for() -> None:
    """Importing everything below the simulator and solving a tick loads no MuJoCo: a real robot has none."""
    done = subprocess.run([sys.executable, "-c", LOADED], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


SIMULATES_AND_DRAWS = """
import io, os, wbc, mujoco
wbc.Plant("hrp4_class").step(wbc.Plant("hrp4_class").hold())
from wbc.app.replay.film import RenderError, renderer
try:
    renderer(mujoco.MjSpec().compile(), 16, 16)
except RenderError as error:
    assert DRIVER in str(error), error
else:
    raise SystemExit("it draws")
from wbc.app.plot.style import new_figure
from wbc.sim.terrain.plot import _figure
for make in (new_figure, _figure):
    make(1.0, 1.0).savefig(io.BytesIO())
import matplotlib
assert os.environ["MPLBACKEND"] == BACKEND
assert (matplotlib.rcParams["backend"] == BACKEND) == (BACKEND == "svg")
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("driver", "backend"), [("nonsense", "Qt4Agg"), ("wgl" if sys.platform != "win32" else "cgl", "svg")]
)
def test_variables_that_do_not_fit_stop_no_simulation_and_no_file(driver: str, backend: str) -> None:
    """Shell profiles and notebooks set them for programs that draw in windows."""
    done = subprocess.run(
        [sys.executable, "-c", f"DRIVER, BACKEND = {driver!r}, {backend!r}\n{SIMULATES_AND_DRAWS}"],
        env={**os.environ, "MUJOCO_GL": driver, "MPLBACKEND": backend},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


SCRIPTS = sorted(
    file for folder in ("benchmarks", "docs", "examples") for file in (ROOT / folder).rglob("*.py")
)
"""Programs that no import reaches."""


@pytest.mark.parametrize("file", SCRIPTS, ids=lambda file: str(file.relative_to(ROOT)))
def test_what_programs_import_from_the_library_is_there(file: Path) -> None:
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "wbc":
            module = importlib.import_module(str(node.module))
            for name in (alias.name for alias in node.names):
                assert hasattr(module, name) or importlib.import_module(f"{node.module}.{name}")
