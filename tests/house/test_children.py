"""Child processes: they run no code of the current folder, and none outlives the program that it works for."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def run(words: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(
        words, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=200.0
    )


PROGRAM = """
import os
import wbc
from wbc.app import MeshcatView
from wbc.machine.guard import Guard
from wbc.machine.loop import Driver
from wbc.sim.studies.sweep import local_executor

class Damped(Driver):
    description = None
    read = write = damp = lambda self, *values: None

if __name__ == "__main__":
    from program import Damped
    with MeshcatView(wbc.Plant(wbc.load_robot("hrp4_class")), port=0) as view:
        view.update()
        assert view.frames > 0
    with local_executor(1) as pool:
        assert pool.submit(os.getpid).result() != os.getpid()
    Guard(Damped(), 1.0).close()
"""

NAMES = "meshcat joblib multiprocessing tornado zmq wbc numpy pickle json re"
"""Modules of the standard library, of other libraries and of this one that the children import."""


@pytest.mark.slow  # four processes import the library
def test_no_child_imports_from_the_current_folder(tmp_path: Path) -> None:
    current, own = tmp_path / "current", tmp_path / "own"
    current.mkdir()
    own.mkdir()
    (own / "program.py").write_text(PROGRAM)
    for name in NAMES.split():
        (current / f"{name}.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'a').write({name!r} + ' ')\n")
    done = run([sys.executable, str(own / "program.py")], current)
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "ran").exists(), (tmp_path / "ran").read_text()


def test_the_command_as_a_module_imports_nothing_from_the_current_folder(tmp_path: Path) -> None:
    (tmp_path / "cyclopts.py").write_text("raise SystemExit('ran')")
    done = run([sys.executable, "-m", "wbc", "--version"], tmp_path)
    assert done.returncode == 0 and "ran" not in done.stderr


@pytest.mark.slow  # a process imports the library and is waited for
def test_a_worker_whose_sweep_was_killed_before_it_began_ends() -> None:
    """The worker is told the number of a process that is not its parent, as it finds it after a kill."""
    code = "import time; from wbc.sim.studies.sweep import _start_worker as start; start(1); time.sleep(60.0)"
    with subprocess.Popen([sys.executable, "-c", code], cwd=ROOT) as worker:
        try:
            assert worker.wait(30.0) == 1
        finally:
            worker.kill()
