"""Entry points: a package of somebody else brings a robot, a foot, a ground and a policy; a broken one does no harm."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = """
from dataclasses import dataclass
import wbc
from wbc.feet import SoftFoot
from wbc.sim import FieldFamily, family
from wbc.sim.studies.outcomes import TrialKind
from wbc.tasks.scheduling.policies import FixedPolicy

def describe():
    return wbc.RobotDescription.from_urdf({biped!r}, left_sole="left_foot", right_sole="right_foot")

@dataclass(frozen=True)
class LongToes(SoftFoot):
    phalanges: int = 12

@family("their_waves")
class Waves(FieldFamily):
    smallest_feature = property(lambda self: 0.1)
    def heights(self, site, x, y):
        return x + y

policy = FixedPolicy
trials = TrialKind(dict, print, metric="height")
"""

POINTS = """
[wbc.robots]
their_biped = theirs:describe
[wbc.feet]
long_toes = theirs:LongToes
no_foot = theirs:Waves
gone = their_other:Foot
[wbc.terrains]
their_waves = theirs:Waves
[wbc.policies]
theirs = theirs:policy
[wbc.trials]
theirs = theirs:trials
"""

PROGRAM = """
import json, sys
import wbc
from wbc.feet import foot
from wbc.robots import load
from wbc.robots.registry import others
from wbc.sim.studies import Study
from wbc.sim.terrain.families.base import terrain_families
from wbc.tasks.scheduling.policies import stiffness_policy

def error(call, *values):
    try:
        call(*values)
    except wbc.InputError as failure:
        return str(failure)

wbc.load_robot("hrp4_class"), foot("flat")
said = {"listed": others(), "early": "theirs" in sys.modules, "joints": len(load("their_biped").joint_names)}
said["phalanges"] = foot("long_toes").phalanges
said["policy"] = type(stiffness_policy("theirs", stiffness=5.0)).__name__
study = {"name": "s", "kind": "theirs", "cells": {"c": {}}, "arms": {"a": {}}, "seeds": [1]}
said["metric"] = Study.from_json(study).measured
said["families"] = list(terrain_families())
said["errors"] = [error(foot, "no_foot"), error(foot, "gone"), error(load, "their_bipeds")]
print(json.dumps(said))
"""


@pytest.mark.slow
def test_what_another_package_brings_is_listed_and_loaded_when_it_is_used_and_a_broken_one_is_named(
    tmp_path: Path,
) -> None:
    folder, root = tmp_path, Path(__file__).parents[2]
    (folder / "theirs.py").write_text(PACKAGE.format(biped=str(root / "examples/biped.urdf")))
    (folder / "theirs-1.0.dist-info").mkdir()
    (folder / "theirs-1.0.dist-info/METADATA").write_text(
        "Metadata-Version: 2.1\nName: theirs\nVersion: 1.0\n"
    )
    (folder / "theirs-1.0.dist-info/entry_points.txt").write_text(POINTS)
    path = os.pathsep.join([str(folder), str(root)])
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        check=False,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert "their_biped" in said["listed"] and not said["early"] and "their_waves" in said["families"]
    assert (said["joints"], said["phalanges"], said["policy"]) == (12, 12, "FixedPolicy")
    assert said["metric"] == "height"
    for message, named in zip(said["errors"], ("no_foot", "their_other:Foot", "their_biped"), strict=True):
        assert named in message
