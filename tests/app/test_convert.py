"""Converted logs hold what the log holds, are opened by their own readers without a complaint, and have no spaces."""

from __future__ import annotations

import base64
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from recorded import recorded_stand, recorded_walk

from wbc.app.cli import main
from wbc.app.log.reader import Log
from wbc.app.replay.convert import convert_log
from wbc.app.replay.replay import Replay
from wbc.app.scene.shapes import MeshFile
from wbc.core.errors import InputError

TIME = 1e-9  # s for each unit of a time stamp


@pytest.fixture(scope="module")
def replay(tmp_path_factory: pytest.TempPathFactory) -> Replay:
    """The first half of a walk."""
    half, whole = tmp_path_factory.mktemp("half") / "walk.arrow", recorded_walk().read_bytes()
    half.write_bytes(whole[: len(whole) // 2])
    return Replay(Log.open(half))


@pytest.fixture(scope="module")
def topics(replay: Replay, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[tuple[float, Any]]]:
    return converted(replay.log, tmp_path_factory.mktemp("converted"))


def converted(log: Log, folder: Path) -> dict[str, list[tuple[float, Any]]]:
    """Time and content of all messages by topic, every tenth checked against the schema of its topic."""
    reader = pytest.importorskip("mcap.reader")
    path = folder / "walk.mcap"
    assert convert_log(log, path, rate=10.0) is None
    found: dict[str, list[tuple[float, Any]]] = {}
    with path.open("rb") as file:
        for schema, channel, message in reader.make_reader(file, validate_crcs=True).iter_messages():
            content, of_topic = json.loads(message.data), found.setdefault(channel.topic, [])
            if len(of_topic) % 10 == 0:
                follows(content, json.loads(schema.data), channel.topic)
            of_topic.append((TIME * message.log_time, content))
    return found


def follows(value: Any, schema: dict[str, Any], where: str) -> None:
    """Check that a value has the fields and kinds of its schema alone."""
    if schema["type"] == "object":
        assert set(value) <= set(schema["properties"]), where
        for key, item in value.items():
            follows(item, schema["properties"][key], f"{where}.{key}")
    elif schema["type"] == "array":
        for item in value:
            follows(item, schema["items"], where)
    else:
        kinds: dict[str, Any] = {"string": str, "boolean": bool, "integer": int, "number": (int, float)}
        assert isinstance(value, kinds[schema["type"]]), where


def test_an_mcap_has_the_signals(replay: Replay, topics: dict[str, list[tuple[float, Any]]]) -> None:
    log = replay.log
    times, messages = zip(*topics["/com/estimated"], strict=True)
    np.testing.assert_allclose(times, log.time, atol=1e-9)
    np.testing.assert_allclose([[m["x"], m["y"], m["z"]] for m in messages], log["com/estimated"])
    assert [m["phase"] for _, m in topics["/walk"]] == list(log.texts("walk/phase"))
    assert [(pytest.approx(time), m["message"]) for time, m in topics["/log"]] == log.events
    assert "left_foot_swing" in topics["/solver/residual"][-1][1]
    assert not [name for name in topics if " " in name]


def test_an_mcap_has_the_scene(replay: Replay, topics: dict[str, list[tuple[float, Any]]]) -> None:
    ticks = replay.ticks(10.0)
    updates = topics["/scene"]
    assert len(updates) == len(topics["/tf"]) == len(ticks)
    name = replay.scene.bodies[0]
    for tick, (_, message) in zip(ticks, topics["/tf"], strict=True):
        placed = {t["child_frame_id"].removeprefix("robot/"): t["translation"] for t in message["transforms"]}
        expected = replay.frame(tick)[0, :3, 3]
        np.testing.assert_allclose([placed[name][axis] for axis in "xyz"], expected, atol=1e-5)
    first = {entity["id"]: entity for entity in updates[0][1]["entities"]}
    shapes = ("cubes", "spheres", "cylinders", "triangles", "models")
    assert any(first[f"robot/{name}"][kind] for kind in shapes)
    assert first["ground"]["triangles"]
    for tick, (_, message) in zip(ticks, updates, strict=True):
        lengths = [a["shaft_length"] + a["head_length"] for a in message["entities"][-1]["arrows"]]
        forces = [np.linalg.norm(replay.scene.reach(force)) for _, _, force in replay.snapshot(tick).forces]
        np.testing.assert_allclose(lengths, forces)
    landed = [entity["id"] for _, message in updates for entity in message["entities"]]
    assert any(one.startswith("footsteps/real") for one in landed)


def test_meshes_of_an_mcap_lie_as_viewers_turn_them(tmp_path: Path) -> None:
    """Foxglove and Lichtblick take y for up in a mesh that does not say, and turn it."""
    replay = Replay(recorded_stand(tmp_path / "stand.arrow", "g1"))
    (_, first), *_ = converted(replay.log, tmp_path)["/scene"]
    models = {entity["id"]: entity["models"] for entity in first["entities"]}
    turn = pin.SE3(pin.utils.rotate("x", 0.5 * np.pi), np.zeros(3)).homogeneous
    seen = 0
    for thing in replay.scene.objects:
        if isinstance(thing.shape, MeshFile):
            model = models[thing.path.rpartition("/")[0].removeprefix("/wbc/")].pop(0)
            assert base64.b64decode(model["data"]) == Path(thing.shape.path).read_bytes()
            pose, scale = (list(model[name].values()) for name in ("pose", "scale"))
            placed = pin.XYZQUATToSE3(np.array([*pose[0].values(), *pose[1].values()])).homogeneous
            expected = thing.placement @ np.diag([*thing.shape.scale, 1.0])
            np.testing.assert_allclose(placed @ np.diag([*scale, 1.0]) @ turn, expected, atol=2e-5)
            seen += 1
    assert seen > 20


def test_rerun_opens_an_rrd(replay: Replay, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    path = tmp_path / "walk.rrd"
    assert convert_log(replay.log, path, rate=5.0) is None

    def rerun(word: str) -> str:
        words = [sys.executable, "-m", "rerun", "rrd", word, str(path)]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        return done.stdout + done.stderr

    assert "1 file verified without error" in rerun("verify")
    listed = rerun("print")
    assert "/com/estimated" in listed and "left_foot swing" not in listed


def test_a_log_without_a_robot_has_signals_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mcap")
    log, out = tmp_path / "stand.arrow", tmp_path / "stand.mcap"
    opened = recorded_stand(log, plant=False)
    with pytest.raises(InputError, match=r"rate \(1/s\) must be"):
        convert_log(opened, out, rate=0.0)
    assert main(["log", "convert", str(log), str(out), "--json"]) == 0
    assert "without a plant" in json.loads(capsys.readouterr().out)["without_scene"]
    assert main(["log", "convert", str(log), str(tmp_path / "stand.bag")]) == 2
    assert ".mcap, .rrd" in capsys.readouterr().err
