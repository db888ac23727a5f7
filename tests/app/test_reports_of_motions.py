"""Reports of motion clips: measures, options that are refused, filtered clips and their joints."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from wbc.app.cli import RAN, main
from wbc.app.commands import motion as motion_command
from wbc.base.errors import InputError
from wbc.motion.measures import MotionMeasures
from wbc.sim.trial.spec import WallClock

Said = pytest.CaptureFixture[str]


def measures(**values: Any) -> MotionMeasures:
    parts = {"joint_excess": {"a": 0.1}, "joint_speed": {"a": 1.0, "b": 1.0}, "joint_torque": {}}
    figures = dict.fromkeys(("slide_speed", "sole_depth", "zmp_outside", "friction"), 0.5) | {
        "single_support": 0.25
    }
    return MotionMeasures(
        **parts | figures | {"infeasible_frames": np.array([True, False, False, False, True])} | values
    )


def feasible_motion(shortened: float) -> Any:
    return SimpleNamespace(
        clip="made",
        after=measures(),
        before=measures(),
        stretched=1.5,
        shortened=shortened,
        changes={"a": 0.1},
        unfinished=(),
    )


def test_measures_of_a_clip_are_told_in_percent_and_before_and_after() -> None:
    after = measures(single_support=1.0, joint_excess={}, infeasible_frames=np.zeros(5, dtype=bool))
    rows = [re.split(r" {2,}", line.strip()) for line in motion_command._table(measures(), after)]
    found = {
        label: [float(v) for v in values[:2]]
        for label, *values in (r[:1] + " ".join(r[1:]).split() for r in rows)
    }
    assert found["time on one foot"] == [25.0, 100.0] and found["frames that are not feasible"] == [40.0, 0.0]
    assert found["joints over their limits"] == [1.0, 0.0] and found["joints over the speed allowed"] == [
        2.0,
        2.0,
    ]
    names = [f"joint_{i}" for i in range(9)]
    result: Any = SimpleNamespace(
        before=measures(),
        after=after,
        changes={name: 0.1 * i for i, name in enumerate(names)},
        shortened=0.012,
        stretched=1.5,
        unfinished=("ZMP", "arms"),
    )
    head, *_, most, undone = motion_command._changes(SimpleNamespace(name="clip"), result)  # type: ignore[arg-type]
    assert head.startswith("clip: feasible; 1.50 x its time") and head.endswith("12 mm")
    assert (
        re.findall(r"joint_(\d) ([\d.]+)", most)[:2] == [("8", "45.8"), ("7", "40.1")]
        and most.count("joint_") == 6
    )
    assert "ZMP, arms" in undone


def test_options_of_a_clip_that_do_not_belong_to_it_are_refused(tmp_path: Path, capsys: Said) -> None:
    clip = tmp_path / "clip.npz"
    for words, said in (
        (["check", str(clip), "-o", "a.npz"], "'motion check'"),
        (["track", str(clip), "-o", "a.npz"], "'motion track'"),
        (["filter", str(clip)], "--out"),
    ):
        np.savez(clip, x=np.zeros(3))
        assert main(["motion", *words]) == 2
        assert said in capsys.readouterr().err


@pytest.mark.parametrize(("standing", "feasible"), [(True, True), (True, False), (False, True)])
def test_a_clip_is_filtered_before_it_is_tracked_unless_it_is_feasible_and_stands(
    standing: bool, feasible: bool, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    clip: Any = SimpleNamespace(name="clip", standing=np.ones(3) if standing else None)
    robot, tracked = SimpleNamespace(), []
    monkeypatch.setattr(motion_command.ClipOptions, "read", lambda self, file, name: (robot, clip))
    monkeypatch.setattr(motion_command, "check_motion", lambda *_: SimpleNamespace(feasible=feasible))
    made = feasible_motion(shortened=0.01)
    monkeypatch.setattr(motion_command, "make_feasible", lambda *_: made)

    class Tracked:
        hooks: list[Any] = []  # noqa: RUF012
        last = None

        def __init__(self, given: Any, spec: Any, **_: Any) -> None:
            tracked.append(given)

        def run(self, hooks: Any) -> Any:
            from wbc.sim.balance.tracking import TrackResult  # noqa: PLC0415

            ticks = {"median": 1.0, "p99": 2.0}
            told = {
                "motion": "clip",
                "mode": "position",
                "completed": True,
                "clip_seconds": 1.0,
                "fall": None,
            }
            told |= {"joint_rms": math.radians(1.0), "worst_joint": "a", "worst_joint_rms": math.radians(2.0)}
            told |= {
                "joint_error_max": math.radians(3.0),
                "com_rms": 0.004,
                "foot_slide": 0.005,
                "landings": 2,
            }
            told |= {"clock": WallClock(1.0, 2.0, ticks)}
            return TrackResult(robot="g1", seed=0, seconds=1.0, failures=0, **told)  # type: ignore[arg-type]

    monkeypatch.setattr(motion_command, "TrackTrial", Tracked)
    assert main(["motion", "track", "clip.npz"]) == RAN
    said = capsys.readouterr().out
    assert tracked == [clip if standing and feasible else "made"]
    assert ("1.50 x its time" in said) is not (standing and feasible) and "tracked to its end" in said


def test_a_filtered_clip_is_written_and_told_in_degrees_and_millimetres(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    clip: Any = SimpleNamespace(name="clip")
    made = feasible_motion(shortened=0.012)
    written: list[Any] = []
    monkeypatch.setattr(motion_command.ClipOptions, "read", lambda self, file, name: (None, clip))
    monkeypatch.setattr(motion_command, "make_feasible", lambda *_: made)
    monkeypatch.setattr(motion_command, "write_motion", lambda *what: written.append(what))
    words = ["motion", "filter", str(tmp_path / "a.csv"), "-o", str(tmp_path / "b.npz")]
    assert main([*words, "--json"]) == RAN
    facts = json.loads(capsys.readouterr().out)
    assert facts["steps_shortened_mm"] == pytest.approx(12.0) and facts["stretched"] == 1.5
    assert facts["changed_most_deg"] == {"a": pytest.approx(math.degrees(0.1))}
    assert main(words) == RAN
    assert capsys.readouterr().out.splitlines()[-1] == f"written to {tmp_path / 'b.npz'}"
    assert written == [("made", tmp_path / "b.npz")] * 2


@pytest.mark.parametrize(("given", "taken"), [(("a", "b"), ("a", "b")), ((), None)])
def test_the_joints_of_a_clip_are_those_that_are_given(
    given: Any, taken: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    clip = SimpleNamespace(configurations=lambda robot: None)
    monkeypatch.setattr(motion_command, "shows_person", lambda file: False)
    monkeypatch.setattr(
        motion_command, "read_motion", lambda file, rate, joints: asked.append((rate, joints)) or clip
    )
    options = motion_command.ClipOptions(joint=given, rate=30.0)
    assert options.read(Path("a.csv"), "g1")[1] is clip and asked == [(30.0, taken)]
    for option in ({"begin": 1.0}, {"end": 2.0}, {"up": "y"}):
        with pytest.raises(InputError, match="person"):
            motion_command.ClipOptions(**option).read(Path("a.csv"), "g1")


def test_the_joints_of_a_person_are_named_by_their_parts() -> None:
    options = motion_command.ClipOptions(joint=("left_knee=LKnee", "right_knee=R=Knee"))
    assert dict(options._joint_of_person()) == {"left_knee": "LKnee", "right_knee": "R=Knee"}
    with pytest.raises(InputError, match="LKnee"):
        dict(motion_command.ClipOptions(joint=("LKnee",))._joint_of_person())
