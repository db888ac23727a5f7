"""Wheel and sdist, each installed in an environment that has nothing of ours: all modules, all data, the command."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LINKED = ("robots", "feet", "tasks", "sim")
PARTS = ("pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "wbc", *LINKED)

IMPORT_ALL = """
import importlib, pathlib, sys, wbc
home = pathlib.Path(wbc.__file__).parent
assert str(home).startswith(sys.prefix), f"{home} is not in the environment {sys.prefix}"
for file in sorted(home.rglob("*.py")):
    parts = file.relative_to(home.parent).with_suffix("").parts
    if parts[-1] != "__main__":
        importlib.import_module(".".join(parts[:-1] if parts[-1] == "__init__" else parts))
for name in ("robots", "feet", "tasks", "sim"):
    assert name not in sys.modules, f"'{name}' was imported a second time beside wbc.{name}"
"""


def run(*command: str | Path, cwd: Path) -> str:
    done = subprocess.run(list(map(str, command)), cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def package_files() -> set[str]:
    """Every file of the package as it stands in the repository, by its place in the package."""
    files = set()
    for top, folder in [("wbc", ROOT / "wbc"), *((f"wbc/{name}", ROOT / name) for name in LINKED)]:
        for file in folder.rglob("*"):
            if file.is_file() and "__pycache__" not in file.parts:
                place = f"{top}/{file.relative_to(folder).as_posix()}"
                if top != "wbc" or file.relative_to(folder).parts[0] not in LINKED:
                    files.add(place)
    return files


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sdist, the wheel made from it, and in `direct/` the wheel made from the repository."""
    folder = tmp_path_factory.mktemp("packaging")
    source, out = folder / "wbc", folder / "dist"
    source.mkdir()
    for part in PARTS:
        if (ROOT / part).is_dir():
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / part, source / part, symlinks=True, ignore=ignored)
        else:
            shutil.copy(ROOT / part, source / part)
    build = (sys.executable, "-m", "build", "--no-isolation")
    run(*build, "--outdir", out, source, cwd=folder)  # sdist first, then a wheel from it
    run(*build, "--wheel", "--outdir", out / "direct", source, cwd=folder)
    return out


def wheel_files(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        links = [i.filename for i in archive.infolist() if (i.external_attr >> 16) & 0o170000 == 0o120000]
        assert not links, f"symbolic links in the wheel: {links}"
        return {name for name in archive.namelist() if ".dist-info/" not in name}


@pytest.mark.slow
def test_wheels_hold_every_file_of_the_package_and_nothing_else(dist: Path) -> None:
    for folder in (dist, dist / "direct"):
        (wheel,) = folder.glob("wbc-*.whl")
        assert wheel_files(wheel) == package_files(), folder


def test_the_package_holds_no_tests_benchmarks_or_helpers_of_the_documentation() -> None:
    wrong = [
        file
        for file in package_files()
        if {"tests", "benchmarks", "docs", "examples"} & set(file.split("/"))
        or Path(file).name.startswith(("test_", "conftest", "render_"))
        or not file.endswith((".py", ".typed", ".urdf", ".srdf", ".csv", ".json", ".pyi"))
    ]
    assert not wrong, wrong


@pytest.mark.slow
def test_sdist_holds_what_a_wheel_needs_as_real_files(dist: Path) -> None:
    (sdist,) = dist.glob("wbc-*.tar.gz")
    with tarfile.open(sdist) as archive:
        members = archive.getmembers()
        assert not [m.name for m in members if m.issym() or m.islnk()]
        names = {m.name.partition("/")[2] for m in members}
    assert {"LICENSE", "README.md", "pyproject.toml"} | package_files() <= names


@pytest.mark.slow
@pytest.mark.parametrize("made_from", ["sdist", "repository"])
def test_installed_package_imports_everywhere_and_has_its_command(
    dist: Path, tmp_path: Path, made_from: str
) -> None:
    folder = dist if made_from == "sdist" else dist / "direct"
    (wheel,) = folder.glob("wbc-*.whl")
    environment = tmp_path / "env"
    venv.create(environment, with_pip=False, symlinks=True)
    python = environment / "bin" / "python"
    pip = (sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--no-index")
    run(*pip, wheel, cwd=tmp_path)
    # What it depends on comes from here: downloading it all again would test the network.
    (site,) = environment.glob("lib/python*/site-packages")
    borrowed = [p for p in sys.path if "site-packages" in p and Path(p).is_dir()]
    (site / "borrowed.pth").write_text("\n".join(borrowed), encoding="utf-8")
    run(python, "-I", "-W", "ignore", "-c", IMPORT_ALL, cwd=tmp_path)
    printed = run(environment / "bin" / "wbc", "--version", cwd=tmp_path)
    assert printed.strip() == wheel.name.split("-")[1]
    assert "hrp4_class" in run(python, "-I", "-m", "wbc", "robots", cwd=tmp_path)


@pytest.mark.slow
def test_an_editable_install_is_found_from_the_folder_above_a_clone_called_wbc(
    dist: Path, tmp_path: Path
) -> None:
    clone = dist.parent / "wbc"
    build = f"from setuptools.build_meta import build_editable; build_editable({str(tmp_path)!r})"
    run(sys.executable, "-c", build, cwd=clone)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    find = (
        f"import importlib.util, site, sys; sys.path.insert(0, ''); site.addsitedir({str(tmp_path / 'site')!r}); "
        "print(importlib.util.find_spec('wbc').origin)"
    )
    assert run(sys.executable, "-I", "-S", "-c", find, cwd=clone.parent).strip() == f"{clone}/wbc/__init__.py"
