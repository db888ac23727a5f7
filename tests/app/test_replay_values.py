"""Replays and films of logs whose numbers are known: which tick, where the camera, which marks from when to when."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from log_writing import made_log

from wbc.app.drift import Drift
from wbc.app.log.reader import Log
from wbc.app.replay import film
from wbc.app.replay.film import FOLLOW_TIME
from wbc.app.replay.replay import MOST_PICTURES, Replay, _lists, _planned, _walk_marks
from wbc.app.replay.rerun_file import RerunFile
from wbc.app.view.marks import LIFT, Mark, Picture, Scale
from wbc.app.view.mujoco_view import MujocoMarks
from wbc.base.errors import InputError

TIME = 0.1 * np.arange(30)
STILL = Drift(np.zeros(30), np.zeros((30, 3)), np.tile([1.0, 0.0, 0.0], (30, 1)))
"""A drift of one metre along x."""


def test_pictures_are_those_of_the_nearest_ticks(tmp_path: Path) -> None:
    """Of ticks at 0, 0.1, 0.35 and 1 s, those nearest to every quarter of a second: of two as near, the later one."""
    replay = Replay.__new__(Replay)
    replay.log = made_log(tmp_path / "a.arrow", {"time": np.array([0.0, 0.1, 0.35, 1.0])})
    assert replay.ticks(4.0) == [0, 2, 2, 3, 3]
    assert replay.ticks(20.0, 2.0) == [0, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3]
    replay.log = made_log(tmp_path / "b.arrow", {"time": np.array([5.0, 6.0, 7.0])})
    assert replay.ticks(2.0) == [0, 1, 1, 2, 2]
    assert replay.ticks(1.0, 2.0) == [0, 2] and replay.ticks(0.1) == [0]
    for rate, speed in ((60.0, 0.1), (30.0, 0.05), (0.49 * MOST_PICTURES, 1.0)):
        ticks = replay.ticks(rate, speed)
        assert abs(len(ticks) - 2.0 * rate / speed) <= 1.0 and sorted(set(ticks)) == [0, 1, 2]
    with pytest.raises(InputError, match="at most"):
        replay.ticks(0.51 * MOST_PICTURES)


def test_the_last_event_is_told_for_two_seconds_with_program_phase_and_drift() -> None:
    replay: Any = Replay.__new__(Replay)
    events = [(1.0, "first"), (1.5, "second"), (4.0, "third")]
    steps = np.array([0.0, np.nan, 3.0])
    columns = {"walk/steps_done": steps, "truth/com/x": steps}

    class Columns(dict[str, Any]):
        """A log."""

    Columns.events = events  # type: ignore[attr-defined]
    replay.log, replay._marks = Columns(columns), []
    replay._texts = {
        "program/state": [None, "walks", "stands"],
        "walk/phase": ["single support", None, "double"],
    }
    replay._texts["step/side"] = ["left", None, "right"]
    replay._drift = SimpleNamespace(text=lambda tick: f"off by {tick}")

    def told(time: float, tick: int = 1) -> Any:
        now = SimpleNamespace(time=time, text=[])
        replay._tell(now, tick)
        return now

    for time, text in (
        (0.9, []), (1.0, ["first"]), (1.6, ["second"]), (3.49, ["second"]), (3.51, []), (4.5, ["third"]), (6.1, []),
    ):  # fmt: skip
        assert told(time).text == ["walks", *text]
    phases = ["single support, left foot swings, 0 steps done"], ["walks"], ["stands", "double, 3 steps done"]
    assert tuple(told(0.0, tick).text for tick in range(3)) == phases
    replay._marks = [(0, 9, None)]
    assert told(1.2, 2).text == [*phases[2], "off by 2", "first"]


def test_planned_points_lie_on_the_level_of_the_planned_zmp(tmp_path: Path) -> None:
    zmp = np.column_stack([TIME, -TIME, 0.2 + TIME])
    columns: dict[str, Any] = {
        "time": TIME,
        "zmp/reference": zmp,
        "dcm/reference": np.column_stack([2.0 * TIME, TIME]),
    }
    found = dict(_planned(made_log(tmp_path / "a.arrow", columns), STILL))
    np.testing.assert_allclose(found["ZMP"], zmp + (1.0, 0.0, 0.0))
    np.testing.assert_allclose(found["DCM"], np.column_stack([1.0 + 2.0 * TIME, TIME, 0.2 + TIME]))
    for gone in ("zmp/reference", "dcm/reference"):
        rest = {name: values for name, values in columns.items() if name != gone}
        assert not dict(_planned(made_log(tmp_path / "b.arrow", rest), STILL))


def gaps(**values: np.ndarray) -> list[np.ndarray | None]:
    rows: list[np.ndarray | None] = [None] * 30
    for tick, row in values.items():
        rows[int(tick[1:])] = row
    return rows


def test_scans_stay_from_their_tick_on_and_maps_until_the_next_one(tmp_path: Path) -> None:
    """A scan is turned to its heading: along it, to its left, and up."""
    heading = np.full(30, np.nan)
    heading[4], heading[9] = 0.5 * math.pi, 0.0
    along, across, up = np.array([1.0, 2.0]), np.array([0.1, 0.2]), np.array([0.01, 0.02])
    one = np.array([1.0])
    columns: dict[str, Any] = {"time": TIME, "stiffness/scan/heading": heading}
    for axis, values in (("x", along), ("lateral", across), ("z", up)):
        columns[f"stiffness/scan/{axis}"] = gaps(t4=values, t7=one, t9=values)
        columns[f"ground/map/{'y' if axis == 'lateral' else axis}"] = gaps(t5=values, t20=2.0 * values)
    log = made_log(tmp_path / "a.arrow", columns)
    assert [tick for tick, _ in _lists(log, "stiffness/scan", ("x", "lateral", "z"))] == [4, 9], (
        "one point is no line"
    )
    assert _lists(log, "nothing", ("x",)) == []
    marks = {
        mark.name + str(start): (start, end, mark.points) for start, end, mark in _walk_marks(log, STILL, [])
    }
    spans = [(start, end) for start, end, _ in marks.values()]
    assert spans == [(4, 30), (9, 30), (5, 20), (20, 30)]
    turned = np.column_stack([1.0 - across, along, up + LIFT])  # looking along y, its left is −x
    np.testing.assert_allclose(marks["scan 04"][2], turned, atol=1e-6)
    np.testing.assert_allclose(
        marks["scan 19"][2], np.column_stack([1.0 + along, across, up + LIFT]), atol=1e-6
    )
    np.testing.assert_allclose(
        marks["known ground20"][2],
        np.column_stack([1.0 + 2.0 * along, 2.0 * across, 2.0 * up + LIFT]),
        atol=1e-6,
    )


# ---- films ----------------------------------------------------------------------------------------------------------


def geoms_of(*marks: Mark, room: int = 100) -> list[Any]:
    model = mujoco.MjSpec().compile()
    scene = mujoco.MjvScene(model, maxgeom=room)
    MujocoMarks(scene).add(marks)
    return [scene.geoms[i] for i in range(scene.ngeom)]


def test_marks_beyond_the_room_are_left_out() -> None:
    ball = Mark("m", "ball", np.zeros((1, 3)), (1.0, 0.0, 0.0, 1.0), 0.1)
    arrow = Mark("a", "arrow", np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]), (1.0, 0.0, 0.0, 1.0), 0.1)
    assert len(geoms_of(ball, ball, arrow, room=3)) == 3
    assert len(geoms_of(ball, ball, arrow, ball, room=2)) == 2


def test_the_camera_follows_the_robot_with_its_time_constant(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a jump of 1 m, exp(−t/T) of it are left, in steps of a picture."""
    places = np.zeros((30, 3))
    places[0], places[1:] = (0.5, 0.2, 0.8), (1.5, 0.2, 0.8)
    seen: list[Any] = []

    class Drawn:
        def __enter__(self) -> Any:
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def draw(self, replay: Any, picture: Picture, camera: Any) -> Any:
            seen.append((camera.lookat.copy(), camera.distance))
            return np.zeros((36, 48, 3), dtype=np.uint8)

    monkeypatch.setattr(film, "renderer", lambda *_: Drawn())
    replay: Any = SimpleNamespace(
        stage=SimpleNamespace(scale=Scale(0.8, 400.0), floor=-0.1, model=None),
        base_places=places,
        title="t",
        picture=lambda tick: Picture(0.1 * tick, text=["told"]),
    )
    made = list(film._pictures(replay, range(30), 10.0, (48, 36)))
    assert (
        len(made) == 30
        and seen[0][0] == pytest.approx([0.5, 0.2, -0.1 + 0.85 * 0.8])
        and seen[0][1] == pytest.approx(3.2 * 0.8)
    )
    left = np.array([1.5 - place[0] for place, _ in seen])
    np.testing.assert_allclose(left, np.exp(-TIME / FOLLOW_TIME), atol=0.02)
    assert any(picture.any() for picture in made), "the caption is drawn"


def test_sizes_of_a_film_are_even_and_not_too_small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film, "check_film", lambda path, inputs: Path(path))
    replay = Replay.__new__(Replay)
    replay.log = made_log(tmp_path / "a.arrow", {"time": TIME})
    for size in ((17, 16), (16, 17), (14, 100), (100, 14)):
        with pytest.raises(InputError, match="even"):
            film.render_video(replay, tmp_path / "a.mp4", size=size)


# ---- files for Rerun ------------------------------------------------------------------------------------------------


class Rerun:
    """Record of all that a stream of Rerun is given."""

    def __init__(self) -> None:
        self.logged: list[tuple[str, Any]] = []
        self.columns: dict[str, tuple[Any, Any]] = {}

    def log(self, entity: str, value: Any, static: bool = False) -> None:
        self.logged.append((entity, value))

    def send_columns(self, entity: str, times: Any, columns: Any) -> None:
        self.columns[entity] = (np.asarray(times[0]), columns)

    TimeColumn = staticmethod(lambda name, duration: duration)
    SeriesLines = staticmethod(lambda names: names)

    class Scalars:
        """Numbers."""

        @staticmethod
        def columns(scalars: Any) -> Any:
            return SimpleNamespace(partition=lambda sizes: (scalars.reshape(len(sizes), -1), sizes))

    class TextLog:
        """Events."""

        @staticmethod
        def columns(text: Any) -> Any:
            return "events", list(text)

    class StateChange:
        """States."""

        @staticmethod
        def columns(state: Any) -> Any:
            return "states", list(state)

    class Mesh3D(SimpleNamespace):
        """A mesh."""

        @classmethod
        def from_fields(cls, **values: Any) -> Any:
            """Return a part of one."""
            return "part", values


@pytest.fixture
def told(tmp_path: Path) -> Iterator[tuple[Log, Rerun]]:
    state = ["a"] * 10 + ["b"] * 5 + ["a"] * 15
    event: list[Any] = [None] * 30
    event[3], event[8] = "up", "down"
    columns = {
        "time": TIME,
        "v/x": TIME,
        "v/no": np.full(30, np.nan),
        "v/one y": -TIME,
        "state": state,
        "event": event,
    }
    yield made_log(tmp_path / "a.arrow", columns), Rerun()


def file_of(log: Log, rerun: Any) -> Any:
    """A file that writes into a record."""
    file = RerunFile.__new__(RerunFile)
    file._log, file._rerun, file._stream = log, rerun, rerun
    return file


def test_numbers_of_a_group_are_one_entity(told: tuple[Log, Rerun]) -> None:
    log, rerun = told
    file = file_of(log, rerun)
    file.write_numbers("v", [log.signals[name] for name in ("v/x", "v/one y")])
    assert rerun.logged == [("v", ["x (m)", "one_y (m)"])]
    times, (values, sizes) = rerun.columns["v"]
    np.testing.assert_array_equal(times, TIME)
    np.testing.assert_allclose(values, np.column_stack([TIME, -TIME]))
    assert (sizes == 2).all()


def test_texts_of_every_tick_are_states_and_others_events(told: tuple[Log, Rerun]) -> None:
    log, rerun = told
    for name in ("state", "event"):
        file_of(log, rerun).write_texts(name)
    times, columns = rerun.columns["state"]
    assert times == pytest.approx([0.0, 1.0, 1.5]) and columns == ("states", ["a", "b", "a"])
    times, columns = rerun.columns["event"]
    assert times == pytest.approx([0.3, 0.8]) and columns == ("events", ["up", "down"])
