"""Grounds described, listed, drawn and measured by the commands."""

import json

import pytest

from wbc.app.commands.terrain import TerrainOptions, describe_terrain, list_terrains
from wbc.core.errors import InputError
from wbc.sim.terrain.families.base import terrain_families


def test_descriptions_are_json_and_complete() -> None:
    for name in set(terrain_families()) - {"image"}:
        report = describe_terrain(name, given={"seed": 1})
        assert json.loads(json.dumps(report, allow_nan=False))["terrain"] == name
    listed = {entry["name"]: entry for entry in json.loads(json.dumps(list_terrains()))["terrains"]}
    assert {"flat", "stones", "random", "image"} <= listed.keys()
    assert all(p["about"] and p["unit"] for entry in listed.values() for p in entry["parameters"])


def test_options_read_parameters_as_text() -> None:
    report = describe_terrain(
        "iso8608", TerrainOptions(param=("isotropic=true", "waves=20", "high=4"), clearance=0.06)
    )
    assert report["parameters"] | {"isotropic": True, "waves": 20, "high": 4.0} == report["parameters"]
    assert report["clears"] is True
    for param, message in (
        ("high", "name=value"),
        ("high=fast", r"^high \(1/m\) must be a finite number above 0, got 'fast'$"),
        ("waves=2.5", "^waves must be an integer of at least 2 and of at most 2000, got 2.5$"),
        ("isotropic=1", "true or false"),
        ("hihg=3", "did you mean 'high'"),
        ("seed=3", "no parameter of the terrain 'iso8608' 'seed'"),
    ):
        with pytest.raises(InputError, match=message):
            describe_terrain("iso8608", TerrainOptions(param=(param,)))
    with pytest.raises(InputError, match="twice"):
        describe_terrain("iso8608", TerrainOptions(param=("high=3", "high=4")))


def test_parameters_of_a_family_may_be_called_like_those_of_the_track() -> None:
    facts = describe_terrain("stone_bricks", TerrainOptions(param=("length=0.3",)), {"length": 2.0})
    assert facts["length_m"] == 2.0 and facts["parameters"]["length"] == 0.3
