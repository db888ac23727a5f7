"""Files for Foxglove of logs whose numbers are known: what each message says, and when."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from log_writing import made_log

from wbc.app.replay import foxglove
from wbc.app.replay.convert import convert_log
from wbc.app.replay.foxglove import FoxgloveFile
from wbc.app.view.marks import Mark, Picture

TIME = 0.25 * np.arange(5) + 1.5

MODEL = """<mujoco><worldbody>
<geom type="plane" size="1 1 0.1" rgba="0.25 0.5 0.75 1"/>
<body name="box" pos="0 0 1"><freejoint/><geom type="box" size="0.1 0.2 0.3" rgba="1 0.5 0 0.5"/></body>
</worldbody></mujoco>"""


def read(path: Path) -> list[tuple[str, int, Any, Any]]:
    """Topic, time in nanoseconds, name of the schema and content of each message."""
    reader = pytest.importorskip("mcap.reader")
    with path.open("rb") as file:
        return [
            (channel.topic, message.log_time, schema, message.data)
            for schema, channel, message in reader.make_reader(file).iter_messages()
        ]


def test_numbers_and_texts_of_a_log_are_messages_at_their_times(tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    columns: dict[str, Any] = {
        "time": TIME,
        "v/x": np.array([1.0, np.nan, 3.0, np.inf, 5.0]),
        "v/y": -TIME,
        "w/none": np.full(5, np.nan),
        "state": ["a", "a", None, "a", "b"],
    }
    log, path = made_log(tmp_path / "a.arrow", columns), tmp_path / "a.mcap"
    reason = convert_log(log, path)
    assert reason, "nothing to draw"
    found = read(path)
    numbers = [(time, json.loads(data)) for topic, time, _, data in found if topic == "/v"]
    times = [1_500_000_000 + 250_000_000 * k for k in range(5)]
    assert numbers == [
        (times[0], {"x": 1.0, "y": -1.5}),
        (times[1], {"y": -1.75}),
        (times[2], {"x": 3.0, "y": -2.0}),
        (times[3], {"y": -2.25}),
        (times[4], {"x": 5.0, "y": -2.5}),
    ]
    (schema,) = {schema.name for topic, _, schema, _ in found if topic == "/v"}
    assert schema == "wbc.v"
    texts = [(time, data) for topic, time, _, data in found if topic == "/texts"]
    assert [time for time, _ in texts] == [times[0], times[3], times[4]], "where they change"
    assert all(name in data for (_, data), name in zip(texts, (b"a", b"a", b"b"), strict=True))
    assert not [topic for topic, *_ in found if topic in ("/w", "/tf", "/robot")]


class Said:
    """A channel of Foxglove that keeps what is logged."""

    def __init__(self, topic: str, **_: Any) -> None:
        self.topic = topic
        CHANNELS[topic] = self.messages = []

    def log(self, message: Any, log_time: int) -> None:
        self.messages.append((log_time, message))


CHANNELS: dict[str, list[tuple[int, Any]]] = {}


@pytest.fixture
def file() -> FoxgloveFile:
    """A file whose messages are plain objects."""
    made = FoxgloveFile.__new__(FoxgloveFile)
    kinds = SimpleNamespace(All="all")
    plain = ("Vector3", "Quaternion", "FrameTransform", "FrameTransforms", "SceneUpdate", "SceneEntity")
    more = ("Point3", "Color", "TriangleListPrimitive")
    messages: dict[str, Any] = {name: SimpleNamespace for name in (*plain, *more)}
    messages["Timestamp"] = lambda seconds, nanoseconds: (seconds, nanoseconds)

    class Deletion(SimpleNamespace):
        pass

    messages["SceneEntityDeletion"], messages["SceneEntityDeletionType"] = Deletion, kinds
    made._messages, made._context = SimpleNamespace(**messages), None  # type: ignore[assignment]
    made._channels = SimpleNamespace(SceneUpdateChannel=Said, FrameTransformsChannel=Said)  # type: ignore[assignment]
    CHANNELS.clear()
    return made


def test_a_scene_has_shapes_where_their_colours_change_places_and_marks_at_every_picture_and_clouds_where_they_change(
    file: FoxgloveFile,
) -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    clouds = [Mark(f"map {k}", "cloud", np.full((4, 3), float(k)), (0.1, 0.2, 0.3, 1.0)) for k in (0, 1)]
    ball = Mark("zmp", "ball", np.array([[0.5, 0.25, 0.0]]), (0.9, 0.8, 0.7, 0.6), 0.02)

    def picture(tick: int) -> Picture:
        data.qpos[:] = [0.1 * tick, -0.2 * tick, 1.0, 0.6, 0.0, 0.8, 0.0]
        mujoco.mj_kinematics(model, data)
        soft = {1: (0.0, 0.0, 1.0, 1.0)} if tick == 3 else {}  # as a sole that is set to another stiffness
        return Picture(float(TIME[tick]), [ball, clouds[tick // 2]], colours=soft)  # type: ignore[arg-type]

    stage: Any = SimpleNamespace(model=model, data=data)
    scene = file.scene(stage)
    for tick in range(4):
        scene.draw(picture(tick))
    times = [round(1e9 * time) for time in TIME[:4]]
    (begun, robot), *later = CHANNELS["/robot"]
    assert begun == times[0]
    ((changed, update),) = later
    (painted,) = update.entities
    assert changed == times[3] and painted.frame_id == "box"
    tint = painted.triangles[0].color
    assert (tint.r, tint.g, tint.b, tint.a) == (0.0, 0.0, 1.0, 1.0)
    shapes = {shape.id: shape for shape in robot.entities}
    assert {shape.frame_id for shape in shapes.values()} == {"world", "box"}
    assert all(shape.frame_locked for shape in shapes.values())
    (name,) = [name for name, shape in shapes.items() if shape.frame_id == "box"]
    assert name.startswith("box/")
    (triangles,) = shapes[name].triangles
    corners = np.array([(p.x, p.y, p.z) for p in triangles.points])
    np.testing.assert_allclose(np.ptp(corners, axis=0), [0.2, 0.4, 0.6], atol=1e-6)
    assert len(triangles.indices) % 3 == 0 and max(triangles.indices) < len(corners)
    colour = triangles.color
    assert (colour.r, colour.g, colour.b, colour.a) == pytest.approx((1.0, 0.5, 0.0, 0.5))
    assert [time for time, _ in CHANNELS["/tf"]] == times
    for tick, (_, message) in enumerate(CHANNELS["/tf"]):
        (place,) = message.transforms
        assert place.parent_frame_id == "world" and place.child_frame_id == "box"
        at = place.translation
        assert (at.x, at.y, at.z) == pytest.approx((0.1 * tick, -0.2 * tick, 1.0))
        turn = place.rotation
        assert (turn.w, turn.x, turn.y, turn.z) == pytest.approx((0.6, 0.0, 0.8, 0.0))
        assert place.timestamp == divmod(times[tick], 10**9)
    assert [time for time, _ in CHANNELS["/marks"]] == times
    for _, update in CHANNELS["/marks"]:
        assert [entity.id for entity in update.entities] == ["zmp"]
        assert [gone.type for gone in update.deletions] == ["all"]
        assert update.entities[0].frame_id == "world" and not update.entities[0].frame_locked
    ground = CHANNELS["/map"]
    assert [time for time, _ in ground] == [times[0], times[2]]
    assert [[entity.id for entity in update.entities] for _, update in ground] == [["map 0"], ["map 1"]]


def test_times_are_nanoseconds_and_none_before_the_epoch(file: FoxgloveFile) -> None:
    assert foxglove._nanoseconds(1.5) == 1_500_000_000 and foxglove._nanoseconds(-2.0) == 0
    assert foxglove._nanoseconds(1.2345678912) == 1_234_567_891
    assert foxglove._timestamp(file._messages, 3.25) == (3, 250_000_000)
