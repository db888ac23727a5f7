"""The pages about feet and grounds do what they say: programs run, pictures are there."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from PIL import Image

import wbc
from wbc.feet import foot
from wbc.feet.soles import catalog
from wbc.sim.rig import FootTest, press
from wbc.sim.terrain import add_to_spec, terrain, terrain_families
from wbc.sim.terrain.families import base

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = {name: (DOCS / name).read_text(encoding="utf-8") for name in ("feet.md", "grounds.md")}


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", PAGES[page], flags=re.MULTILINE | re.DOTALL)


def run(program: str, names: dict[str, Any]) -> None:
    exec(compile(program, "page", "exec", dont_inherit=True), names)  # without this file's future statement


@pytest.fixture
def names(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Namespace of a page's programs, which run one after the other; what they register is forgotten afterwards."""
    monkeypatch.setattr(catalog, "_FEET", copy.copy(catalog._FEET))
    monkeypatch.setattr(base, "_FAMILIES", copy.copy(base._FAMILIES))
    return {}


def test_programs_about_feet_run(names: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    on_rig, own_numbers, own_shape, on_robot = blocks("feet.md", "python")
    run(on_rig, names)
    assert names["result"] == press(names["test"]) and "m² of support" in capsys.readouterr().out
    run(own_numbers, names)
    long = press(FootTest(foot("long_toes"))).hold
    assert long is not None and len(long.sole_angles) == 12 and abs(long.balance_error) < 1e-3
    run(own_shape, names)
    rocker = names["Rocker"]()
    flat = press(FootTest(rocker))
    assert flat.hold is not None and flat.support is not None
    assert abs(flat.hold.balance_error) < 1e-3
    # A round sole touches along one line, which moves by the radius times the angle of the ankle.
    assert np.ptp([point[0] for point in flat.hold.contact_points]) < 0.02
    length = flat.support.forward - flat.support.backward
    assert length == pytest.approx(2.0 * flat.support.tilt * rocker.radius, abs=0.01)
    plant = wbc.Plant(wbc.load_robot("talos"), foot=rocker)
    for _ in range(40):
        plant.step(plant.hold())
    assert plant.diverged is None and plant.truth().sole_wrench[:, 2].min() > 300.0
    run(on_robot, names)
    measured = names["plant"].measure().sole_stiffness
    np.testing.assert_allclose(measured, [42.0, 5.0], atol=0.11)
    assert names["robot"].mass - names["description"].robot().mass == pytest.approx(2 * 0.34)


def test_programs_about_grounds_run(names: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    first, picture, heights, solids = blocks("grounds.md", "python")
    run(first, names)
    assert "Sku" in capsys.readouterr().out
    run(picture, names)
    assert float(capsys.readouterr().out) == pytest.approx(0.0, abs=1e-3)  # the middle of the bowl
    run(heights, names)
    run(solids, names)
    assert {"ripples", "molehills"} <= set(terrain_families())
    for name in ("ripples", "molehills"):
        ground = terrain(name, 0.03, 5)
        x = np.linspace(ground.start, ground.stop, 400)
        assert np.ptp(ground.height(x, np.linspace(-0.5, 0.5, 200)[:, None])) == pytest.approx(0.03, abs=1e-3)
        spec = mujoco.MjSpec()
        add_to_spec(spec, ground)
        spec.compile()


@pytest.mark.parametrize("page", PAGES)
def test_pictures_are_there_and_small(page: str) -> None:
    shown = re.findall(r"\]\((images/[^)]+)\)", PAGES[page])
    assert shown
    for name in shown:
        assert (DOCS / name).stat().st_size < 300_000
        with Image.open(DOCS / name) as picture:
            assert picture.width > 800


def test_every_family_is_on_its_page() -> None:
    named = set(re.findall(r"`(\w+)`", PAGES["grounds.md"]))
    assert set(terrain_families()) <= named
    measured = set(
        re.findall(r"^\| (\w+)[^|]*\| [\d,]+ \| [\d,]+ \|", PAGES["grounds.md"], flags=re.MULTILINE)
    )
    assert measured == set(terrain_families())
