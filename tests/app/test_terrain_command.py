"""Grounds described, listed, drawn and measured by the commands."""

import json

import pytest

from wbc.app.commands.terrain import TerrainOptions, describe_terrain, list_terrains
from wbc.base.errors import InputError
from wbc.sim.terrain.families.base import terrain_families


def test_descriptions_are_json_and_complete() -> None:
    for name in set(terrain_families()) - {"image"}:
        report = describe_terrain(name, TerrainOptions(), {"seed": 1})
        assert json.loads(json.dumps(report, allow_nan=False))["terrain"] == name
    listed = {entry["name"]: entry for entry in json.loads(json.dumps(list_terrains()))["terrains"]}
    assert {"flat", "stones", "random", "image"} <= listed.keys()
    assert all(p["about"] and p["unit"] for entry in listed.values() for p in entry["parameters"])


def test_parameters_of_a_family_may_be_called_like_those_of_the_track() -> None:
    facts = describe_terrain("stone_bricks", TerrainOptions(param=("length=0.3",)), {"length": 2.0})
    assert facts["length_m"] == 2.0 and facts["parameters"]["length"] == 0.3


def test_parameters_of_every_ground_are_given_beside_those_of_the_family() -> None:
    areas = "areas=1.0,2.0,none,0.2,friction,0.2"
    facts = describe_terrain("stones", TerrainOptions(param=("density=60", "floor_stiffness=1e7", areas)), {})
    assert facts["floor_stiffness_n_per_m3"] == 1e7 and facts["parameters"]["density"] == 60.0
    assert facts["areas"] == [1.0, 2.0, None, 0.2, "friction", 0.2]
    with pytest.raises(InputError, match="floor_stifness"):
        describe_terrain("stones", TerrainOptions(param=("floor_stifness=1e7",)), {})
