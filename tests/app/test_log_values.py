"""Values that figures, replays and repetitions read of a log of known numbers: stances, support, drift, differences."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from known_walk import (
    ROBOT,
    SOLE,
    STANDS,
    TICKS,
    TIME,
    TURN,
    YAW,
    about,
    other,
    place,
    walk_columns,
)
from log_writing import made_log
from scipy.spatial.transform import Rotation

from wbc.app.drift import MIN_LOAD, Drift, yaw_of
from wbc.app.log.reader import Log
from wbc.app.log.signals import foot_names, joint_units, torque_units
from wbc.app.log.stances import level_corners, stances, support_box
from wbc.app.plot.figures import missing
from wbc.app.repeat import RepeatWalk, first_difference, interventions_of, recorded_walk
from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.robots import load


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Log:
    return made_log(tmp_path_factory.mktemp("made") / "walked.arrow", walk_columns(), robot=ROBOT)


def rectangle(centre: np.ndarray, yaw: float, size: tuple[float, float]) -> np.ndarray:
    c, s, (x, y) = math.cos(yaw), math.sin(yaw), 0.5 * np.array(size)
    local = np.array([(x, y), (-x, y), (-x, -y), (x, -y)])
    return np.asarray(centre[:2] + local @ np.array([(c, s), (-s, c)]))


# ---- stances and support --------------------------------------------------------------------------------------------


def test_soles_from_above_are_rectangles_counter_clockwise() -> None:
    centre, yaw = np.array([(1.0, 2.0, 9.0), (0.0, 0.0, 0.0)]), np.array([0.3, -1.2])
    found = level_corners((0.2, 0.1), centre, yaw)
    for i in range(2):
        np.testing.assert_allclose(found[i], rectangle(centre[i], yaw[i], (0.2, 0.1)))
    x, y = found[0].T
    assert 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)) == pytest.approx(0.02)


def test_stances_go_from_touch_down_to_lift_off_where_the_foot_is_in_the_middle_of_them(walked: Log) -> None:
    """As planned, the place of the estimate's world at the touch-down; the true one as it was."""
    spans = [("left", 0, 20), ("right", 10, 40), ("left", 30, 40)]
    for which, turn in (("reference", YAW), ("truth", {side: yaw + TURN for side, yaw in YAW.items()})):
        found = stances(walked, which)
        assert [(stance.side, stance.start, stance.end) for stance in found] == spans
        for stance in found:
            middle = place(stance.side)[(stance.start + stance.end) // 2]
            wanted = rectangle(middle, YAW[stance.side], SOLE[stance.side])
            wanted = about(np.column_stack([wanted, np.full(4, 0.02)]))
            np.testing.assert_allclose(stance.corners, wanted, atol=1e-9, err_msg=f"{which} {turn}")


def test_the_support_is_the_box_around_the_soles_that_stand(walked: Log, tmp_path: Path) -> None:
    low, high = support_box(walked)
    for tick in (0, 15, 25, 35):
        points = np.concatenate(
            [rectangle(place(side)[tick], YAW[side], SOLE[side]) for side in SOLE if STANDS[side][tick]]
        )
        np.testing.assert_allclose(low[tick], points.min(axis=0), atol=1e-9)
        np.testing.assert_allclose(high[tick], points.max(axis=0), atol=1e-9)


def test_without_a_plan_the_soles_that_bear_a_share_of_the_weight_stand(tmp_path: Path) -> None:
    weight = 50.0 * GRAVITY
    force = np.zeros((TICKS, 6))
    force[:10, 2], force[10:20, 2], force[20:, 2] = 1.01 * MIN_LOAD * weight, 0.99 * MIN_LOAD * weight, np.nan
    changed = {"foot/left/wrench_measured": force, "foot/right/wrench_measured": np.zeros((TICKS, 6))}
    log = other(tmp_path, changed, "foot/left/contact", "foot/right/contact")
    low, high = support_box(log)
    assert np.isnan(low[10:]).all() and np.isnan(high[10:]).all()
    sole = rectangle(place("left")[0], YAW["left"], SOLE["left"])
    np.testing.assert_allclose([low[3], high[3]], [sole.min(axis=0), sole.max(axis=0)], atol=1e-9)


def test_only_a_robot_with_two_soles_has_stances(tmp_path: Path) -> None:
    for soles in ([], ROBOT["soles"][:1], [*ROBOT["soles"], ROBOT["soles"][0]]):  # type: ignore[index]
        log = other(tmp_path, robot=ROBOT | {"soles": soles})
        with pytest.raises(InputError, match=f"{len(soles)} soles"):
            stances(log)
        assert "two soles" in (missing("balance", log) or "")


def test_the_drift_is_that_of_the_middle_of_the_feet_and_of_the_heading(walked: Log, tmp_path: Path) -> None:
    drift = Drift.of(walked)
    np.testing.assert_allclose(drift.turn, TURN)
    middle = 0.5 * (place("left") + place("right"))
    np.testing.assert_allclose(drift.size, np.linalg.norm((about(middle) - middle)[:, :2], axis=1))
    points = np.random.default_rng(0).normal(size=(TICKS, 3))
    np.testing.assert_allclose(drift(points), about(points), atol=1e-9)
    blind = other(tmp_path, None, "truth/base")
    assert not Drift.of(blind).size.any() and not Drift.of(blind).turn.any()
    lost = other(tmp_path, None, "base/estimated")
    assert not Drift.of(lost).size.any()


def test_headings_are_those_of_tilted_frames_too() -> None:
    turns = Rotation.from_euler("ZYX", [(1.2, 0.3, -0.4), (-2.5, -0.6, 0.2)])
    np.testing.assert_allclose(yaw_of(turns.as_quat()), [1.2, -2.5], atol=1e-12)


def test_no_angle_is_minus_nothing() -> None:
    still = Drift(np.array([-1e-4]), np.zeros((1, 3)), np.zeros((1, 3)))
    assert still.text(0) == "estimate 0 mm and +0.0° off"
    assert (
        Drift(np.array([-0.1]), np.zeros((1, 3)), np.array([[0.03, 0.04, 9.0]])).text(0)
        == "estimate 50 mm and -5.7° off"
    )


# ---- repetition -----------------------------------------------------------------------------------------------------


def test_two_logs_differ_first_where_one_of_their_signals_does(tmp_path: Path) -> None:
    columns: dict[str, Any] = {"time": TIME, "a": TIME, "b": np.where(TIME > 2.0, np.nan, TIME)}
    columns |= {"state": ["x"] * TICKS, "rows": [np.array([1.0, np.nan])] * TICKS, "tick/solve": TIME}

    def log(name: str, ticks: int = TICKS, **changed: Any) -> Log:
        values = {key: value[:ticks] for key, value in (columns | changed).items()}
        return made_log(tmp_path / f"{name}.arrow", values)

    def from_tick(tick: int, value: float) -> np.ndarray:
        return np.where(np.arange(TICKS) >= tick, value, TIME)

    first = log("first")
    assert first_difference(first, log("same")) is None
    assert first_difference(first, log("clocks", **{"tick/solve": 2.0 * TIME})) is None, "time on the wall"
    for changed, said in (
        ({"a": from_tick(7, 9.0)}, "from 0.700 s on, first in a"),
        ({"a": from_tick(7, 9.0), "b": from_tick(5, 8.0)}, "from 0.500 s on, first in b"),
        ({"a": from_tick(3, 9.0), "b": from_tick(5, 8.0)}, "from 0.300 s on, first in a"),
        ({"state": ["x"] * 12 + ["y"] * 28}, "from 1.200 s on, first in state"),
        (
            {"rows": [np.array([1.0, np.nan])] * 9 + [np.array([2.0, np.nan])] * 31},
            "from 0.900 s on, first in rows",
        ),
        ({"b": np.where(TIME > 3.0, np.nan, TIME)}, "from 2.100 s on, first in b"),
    ):
        assert first_difference(first, log("other", **changed)) == said
    short = log("short", 30)
    assert first_difference(first, short) == "40 ticks, and 30 when repeated"
    first.broken = "cut off"
    assert first_difference(first, short) is None, "as far as it goes"
    unlike = {"own": TIME, "view/change": [""] * TICKS}
    assert (
        first_difference(log("whole"), log("more", **unlike)) == "only in signals that one of them lacks: own"
    )


def test_a_repetition_ends_with_the_tick_at_which_the_walk_was_ended() -> None:
    push = {"time": 0.3, "what": "push", "direction": "left", "impulse": 0.1}
    ends = [{"time": 0.5, "what": "end"}, {"time": 0.4, "what": "end"}]
    stopped: list[float] = []

    def trial(time: float) -> Any:
        plant = SimpleNamespace(time=time, control_period=0.005)
        return SimpleNamespace(plant=plant, stop=lambda: stopped.append(time))

    repeat = RepeatWalk([push, *ends])
    assert [*repeat._changes] == [push]
    for time in (0.0, 0.395, 0.397, 0.398, 0.4, 0.405):
        repeat.after(trial(time))
    assert stopped == [0.398, 0.4, 0.405], "half a period before: times are sums of periods"
    RepeatWalk([push]).after(trial(1e9))
    assert len(stopped) == 3


def test_a_walk_whose_log_was_cut_off_ends_with_its_last_tick(tmp_path: Path) -> None:
    from wbc.sim import WalkSpec  # noqa: PLC0415

    change = ['[{"what": "stop", "time": 0.2}]', "", *[None] * 38]
    log = made_log(tmp_path / "a.arrow", {"time": TIME, "view/change": change}, spec=WalkSpec().to_json())
    assert interventions_of(log) == [{"what": "stop", "time": 0.2}]
    assert recorded_walk(log)[1] == interventions_of(log)
    log.broken = "cut off"
    assert recorded_walk(log)[1][1:] == [{"time": TIME[-1], "what": "end"}]


# ---- sources --------------------------------------------------------------------------------------------------------


def test_joints_that_slide_are_logged_in_metres_and_newtons(tmp_path: Path) -> None:
    robot = load("panda").robot()
    units = dict(
        zip(robot.joint_names, zip(joint_units(robot), torque_units(robot), strict=True), strict=True)
    )
    fingers = {name for name in units if "finger" in name}
    assert fingers and all(units[name] == ("m", "N") for name in fingers)
    assert all(pair == ("rad", "Nm") for name, pair in units.items() if name not in fingers)
    assert foot_names(load("g1").robot()) == ["left", "right"]
