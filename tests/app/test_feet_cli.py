"""Feet and grounds from the command line: what they say, and that wrong input is refused before anything starts."""

from __future__ import annotations

import json
import logging
import math
import re
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from PIL import Image

from wbc.app import cli
from wbc.app.arguments import attribute_docs
from wbc.app.commands.foot import parameters
from wbc.core.changes import changed, setting_names
from wbc.core.errors import InputError
from wbc.feet import SoftFoot, foot
from wbc.feet.soles.catalog import foot_names
from wbc.feet.soles.soft import VariableStiffnessFoot
from wbc.robots import names
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.walks.trial import WalkTrial

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str]) -> Run:
    def command(*words: str) -> tuple[int, str, str]:
        code = cli.main(list(words))
        out, err = capfd.readouterr()
        return code, out, err

    return command


def data_of(run: Run, *words: str) -> Any:
    code, out, err = run(*words, "--json")
    assert code == cli.RAN, err
    return json.loads(out)


# --- bad input -------------------------------------------------------------------------------------------------------


@pytest.fixture
def grey(tmp_path: Path) -> Path:
    path = tmp_path / "grey.png"
    Image.fromarray(np.random.default_rng(0).integers(0, 256, (40, 60)).astype(np.uint8)).save(path)
    return path


BAD: dict[str, tuple[str, str]] = {
    "stiffness of a rigid foot": ("foot pitch --foot rigid --stiffness 5", "a rigid foot has no stiffness"),
    "unknown foot": ("foot press --foot sotf", "did you mean 'soft'"),
    "feet that overlap": ("foot press --robot g1 --foot-param width=0.3", "their centres are 0.2370 m apart"),
    "unknown family": ("terrain stone", "did you mean 'stones'"),
    "pitch of a free ankle": ("foot pitch --ankle-stiffness 0", "above 0 Nm/rad"),
    "picture into no folder": ("foot press --plot no/folder/a.png", "no folder"),
    "picture that is none": ("foot pitch --plot a.doc", "must end in"),
    "sheet that is none": ("terrain --plot a.doc", "must end in"),
    "option of another test": ("foot press --rate 100", "--rate is no option of 'foot press'"),
    "option of one ground": ("terrain --amplitude 0.1", "belongs to one ground; name its family"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_nothing_starts(
    run: Run, case: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    line, message = BAD[case]

    def started(*_: Any, **__: Any) -> None:
        pytest.fail("a simulation was started")

    monkeypatch.setattr(mujoco, "MjData", started)
    code, out, err = run(*line.split())
    assert code == cli.BAD_INPUT and out == ""
    said = [part for part in err.splitlines() if part.startswith("wbc: ")]
    assert len(said) == 1 and message in said[0], err


@pytest.mark.slow
@pytest.mark.parametrize(("clearance", "clears"), [((), "false"), (("--clearance", "0.1"), "true")])
def test_ground_beyond_the_foot_clearance_is_a_warning(clearance: tuple[str, ...], clears: str) -> None:
    # In a process of its own: here pytest catches warnings before anyone sees them.
    words = [sys.executable, "-m", "wbc", "terrain", "stones", "--amplitude", "0.08", *clearance]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == cli.RAN
    assert re.search(rf"^clears +{clears}$", done.stdout, flags=re.MULTILINE)
    if clears == "true":
        assert done.stderr == ""
    else:
        assert "rises by 80 mm, more than the foot clearance of 60 mm" in done.stderr
        assert done.stderr.strip().count("\n") == 0 and "terrain.py" not in done.stderr


def test_a_walk_over_ground_beyond_its_clearance_warns_first(
    run: Run, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def walks(*_: Any) -> None:
        raise InputError("it would walk now")

    monkeypatch.setattr(WalkTrial, "run", walks)
    words = "walk --terrain stones --amplitude 0.05 --set swing_height=0.04 --distance 0.05"
    logging.captureWarnings(False)  # an earlier command may have left it on, with another test's hook
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        assert run(*words.split())[0] == cli.BAD_INPUT
    logging.captureWarnings(False)
    assert "by 50 mm, more than the foot clearance of 40 mm" in caplog.text


# --- feet ------------------------------------------------------------------------------------------------------------


def test_feet_are_listed_under_every_robot(run: Run) -> None:
    listed = {entry["name"]: entry for entry in data_of(run, "foot")["feet"]}
    assert set(listed) == set(foot_names())
    for robot in names():
        own, soft = (listed[name]["fits"][robot] for name in ("flat", "soft"))
        assert own["added_mass_kg"] == own["height_change_m"] == 0.0
        assert soft["added_mass_kg"] == pytest.approx(0.34)
        assert soft["ankle_in_sole_m"][0] == pytest.approx(-0.03)
        assert soft["footprint_m"] == pytest.approx([0.2778, 0.1045], abs=1e-4)
    _, out, _ = run("foot", "--robot", "g1")
    assert "talos" not in out and "278 x 104 mm" in out and "0.34 kg more, 0 mm higher" in out


@pytest.mark.parametrize("name", foot_names())
def test_everything_about_a_foot_is_documented_and_can_be_changed(name: str) -> None:
    design = foot(name)
    found = {entry["name"]: entry for entry in parameters(design)}
    assert set(found) == set(setting_names(design))
    assert all(entry["about"].endswith((".", ")", "s")) for entry in found.values())
    assert changed(design, {"contact.radius": 0.005}).contact.radius == 0.005


def test_documentation_of_fields_is_read_with_what_it_derives_from() -> None:
    found = attribute_docs(VariableStiffnessFoot)
    assert found["actuator"] == "Rate limit, lag and range of the stiffness."
    assert found["damping"].endswith("the public SoftFoot model has 0.04.")  # the second line of it
    assert found["stiffness"].startswith("Stiffness at the start")  # its own word, not that of the soft foot
    assert found["contact"] == "Contact spheres of the sole."


def test_parameters_that_change_together_are_checked_together() -> None:
    # In either order one of the two alone would be refused.
    for order in (("phalanges", "loop_phalanx"), ("loop_phalanx", "phalanges")):
        many, few = {"phalanges": 13, "loop_phalanx": 11}, {"phalanges": 2, "loop_phalanx": 1}
        for values in (many, few):
            design = changed(SoftFoot(), {name: values[name] for name in order})
            assert (design.phalanges, design.loop_phalanx) == tuple(values.values())
    with pytest.raises(InputError, match="loop_phalanx"):
        changed(SoftFoot(), {"loop_phalanx": 11})


# --- rig -------------------------------------------------------------------------------------------------------------


def test_a_press_says_what_was_pressed_and_draws_it(run: Run, tmp_path: Path) -> None:
    picture = tmp_path / "press.png"
    words = "foot press --robot g1 --foot-param phalanges=8 --stiffness 20 --terrain stones --amplitude 0.02 --seed 4"
    facts = data_of(run, *words.split(), "--plot", str(picture))
    assert (facts["foot"], facts["terrain"], facts["seed"], facts["load_n"]) == ("soft", "stones", 4, 200.0)
    assert facts["foot_parameters"]["phalanges"] == len(facts["hold"]["sole_angles"]) == 8
    assert facts["foot_parameters"]["stiffness"] == 20.0
    assert facts["ankle_in_sole_m"][2] == pytest.approx(0.035)  # g1's ankles are low
    assert facts["added_mass_kg"] == pytest.approx(0.30)
    assert picture.stat().st_size > 10_000 and facts["plot"] == str(picture)


def test_a_height_field_is_what_was_asked_for(run: Run) -> None:
    words = (
        "foot press --foot rigid --terrain stone_bricks --seed 1 --rendering height_field --resolution 0.003"
    )
    facts = data_of(run, *words.split())
    geoms = data_of(run, *words.split()[:-4])
    assert (facts["rendering"], geoms["rendering"]) == ("height_field", "geoms")
    assert facts["hold"]["ankle_height"] == pytest.approx(geoms["hold"]["ankle_height"], abs=5e-4)


def test_a_drop_is_harder_from_higher_up_and_a_pitch_is_drawn(run: Run, tmp_path: Path) -> None:
    low, high = (data_of(run, "foot", "press", "--drop", h)["impact"] for h in ("0.01", "0.05"))
    assert high["peak_force"] > low["peak_force"] and high["speed"] > 2.0 * low["speed"]
    picture = tmp_path / "pitch.png"
    data_of(run, "foot", "pitch", "--foot", "rigid", "--rate", "60", "--plot", str(picture))
    assert picture.stat().st_size > 10_000


# --- grounds ---------------------------------------------------------------------------------------------------------


def test_a_terrain_from_an_image(run: Run, grey: Path, tmp_path: Path) -> None:
    words = f"terrain image --param source={grey} --param metres_per_pixel=0.01 --amplitude 0.02".split()
    facts = data_of(run, *words, "--plot", str(tmp_path / "map.png"))
    assert facts["length_m"] == pytest.approx(0.59) and facts["rendering"] == "height_field"
    assert (tmp_path / "map.png").stat().st_size > 10_000


def test_roughness_is_what_the_feet_know_of_the_ground(run: Run) -> None:
    found = data_of(run, "terrain", "metal_sheets", "--param", "period=0.1", "--ramp", "0")["roughness"]
    assert found["Sz_m"] == pytest.approx(0.02, rel=0.05)  # a line is taken off a sine
    assert found["Sq_m"] == pytest.approx(0.02 / math.sqrt(8.0), rel=0.02)
    assert found["Sku"] == pytest.approx(1.5, rel=0.02) and found["K"] == pytest.approx(0.5, abs=0.05)
    assert data_of(run, "terrain", "flat")["roughness"]["Sq_m"] == 0.0


@pytest.mark.slow
def test_all_terrains_are_drawn(run: Run, tmp_path: Path) -> None:
    sheet = tmp_path / "sheet.png"
    facts = data_of(run, "terrain", "--plot", str(sheet))
    assert {entry["name"] for entry in facts["terrains"]} == set(terrain_families())
    with Image.open(sheet) as picture:
        assert picture.width > 1500
