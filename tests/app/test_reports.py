"""Reports of commands: every figure stands in the unit that its text says."""

from __future__ import annotations

import dataclasses
import io
import json
import logging
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from wbc.app import live
from wbc.app.cli import BAD_INPUT, RAN, main
from wbc.app.commands import foot as foot_command
from wbc.app.commands import motion as motion_command
from wbc.app.commands import stand as stand_command
from wbc.app.commands.settings import settings_of
from wbc.app.commands.study import run as run_command
from wbc.app.live import LiveDrive, LiveView, ProgressLine, ending, shown_progress, with_changes
from wbc.app.output import Output, Report, facts_text, reports
from wbc.app.walk_report import walk_text
from wbc.base.errors import InputError, WbcError
from wbc.feet import foot as foot_by_name
from wbc.motion.measures import MotionMeasures
from wbc.sim import WalkPlan, WalkSpec
from wbc.sim.studies.journal import Entry
from wbc.sim.studies.provenance import provenance
from wbc.sim.studies.study import Study
from wbc.sim.walks.result import Energy, Fall, Spread, Touchdowns, WalkResult, WallClock
from wbc.walking import Gait

Said = pytest.CaptureFixture[str]
EXACT = Spread(0.0, 0.0)

WALKED = WalkResult(
    robot="g1",
    seed=7,
    seconds=12.34,
    failures=3,
    foot="soft",
    sole_stiffness=25.0,
    policy=None,
    terrain="stones",
    amplitude=0.02,
    outcome="completed",
    steps_planned=9,
    steps_done=8,
    J=0.0,
    fell=False,
    fall_reason=None,
    fall=None,
    diverged=None,
    distance=1.25,
    drift=-0.031,
    yaw_error=0.1,
    goal_error=0.21,
    track_error=0.32,
    zmp_error=Spread(0.0123, 0.0045),
    com_error=Spread(0.0067, 0.0011),
    dcm_error=Spread(None, 0.1),
    dcm_error_max=0.089,
    peak_torque_ratio=0.57,
    peak_torque_joint="left_knee",
    cost_of_transport=0.4,
    energy=Energy(80.0, 20.0),
    vibration=43210.0,
    slip=0.012,
    torque_ratio=EXACT,
    touchdowns=Touchdowns(2, 3, 1, 4, 0),
    impact=1.75,
    sole_roll=EXACT,
    sole_pitch=EXACT,
    contact_area=EXACT,
    stiffness=None,
    notes=("shorter steps",),
    clock=WallClock(1.0, 2.5, {"median": 120.4, "p99": 310.6}, 0.5, {"median": 40.0, "max": 90.0}),
)
LEVEL = WalkSpec(plan=WalkPlan(distance=0.5))


def lines_of(result: WalkResult, spec: WalkSpec = LEVEL) -> dict[str, str]:
    """Return the lines of the text by their first words; the first line under an empty name."""
    first, *rest = walk_text(result, spec).splitlines()
    return {"": first} | {line.split()[0]: line.split(None, 1)[1] for line in rest}


def test_the_text_of_a_walk_has_its_figures_in_their_units() -> None:
    told = lines_of(WALKED)
    assert told[""].startswith("g1 on soft feet of 25 Nm/rad, stones, 20 mm, seed 7, ")
    assert "free" not in told[""] and told[""].endswith(f"control, noise {LEVEL.noise}")
    assert told["note"] == "shorter steps"
    assert told["walked"] == "8 of 9 steps in 12.3 s"
    assert told["errors"] == "ZMP 12.3 ± 4.5, CoM 6.7 ± 1.1, DCM – mm, at most 89 mm"
    assert told["landing"] == "2 early, 3 on time, 1 late, 4 without ground; at most 1.75 x weight"
    assert told["distance"] == "1.25 m, -3.1 cm to the left, heading off by +5.7°"
    assert told["torque"] == "up to 57 % of its limit (left_knee)"
    assert (
        told["cost"] == ("of transport 0.40: 100 J, 80 J of them in the legs; vibration 4.32e+04 rad/s²")
        and "SLIPPED" not in told
    )
    assert lines_of(replace(WALKED, slip=0.1234))["SLIPPED"].startswith("123 mm")
    assert lines_of(replace(WALKED, cost_of_transport=None))["cost"].startswith("100 J")
    assert told["speed"] == "2.50 x real time; a tick takes 120 us, 99 % less than 311 us; 3 failed"
    bare = lines_of(
        replace(WALKED, amplitude=0.0, sole_stiffness=None, impact=None, dcm_error_max=None, clock=None)
    )
    assert "g1 on soft feet, stones, seed 7" in bare[""] and "weight" not in bare["landing"]
    assert not {"errors", "speed"} & bare.keys()
    assert lines_of(replace(WALKED, zmp_error=Spread(0.1, None)))["errors"].startswith("ZMP –")


def test_the_text_says_how_a_walk_has_ended() -> None:
    strayed = lines_of(replace(WALKED, outcome="strayed"))["STRAYED"]
    assert strayed == "8 of 9 steps in 12.3 s, 0.21 m from the goal, up to 0.32 m off the track"
    fall = Fall("tilt", 12.0, 11.0, 5, "single support", 0.25, None, None, "left", 0.1, -0.2)
    fell = lines_of(replace(WALKED, outcome="fell", fall=fall))
    assert fell["FELL"].startswith("after 8 of 9 steps and 12.3 s (it tilted)") and "walked" not in fell
    assert "to the left at 25 % of the single support of step 5" in fell["FELL"]
    assert "5.7° roll, -11.5° pitch" in fell["FELL"]
    lost = walk_text(replace(WALKED, diverged="NaN"), LEVEL).splitlines()
    assert lost[-1] == "  DIVERGED  after 8 of 9 steps: NaN"


def test_steps_of_a_walk_that_plans_none_are_counted_alone() -> None:
    free = lines_of(WALKED, WalkSpec(plan=WalkPlan(velocity=(0.1, 0.0, 0.0), steps=4), mode="torque"))
    assert ("free steps" in free[""]) == (free["walked"] == "8 steps in 12.3 s")
    driven = WalkSpec(plan=WalkPlan(drive=((0.0, 0.1, 0.0, 0.0), (2.0, 0.0, 0.0, 0.0))), mode="torque")
    assert driven.free
    told = lines_of(WALKED, driven)
    assert ", free steps, torque control" in told[""] and told["walked"] == "8 steps in 12.3 s"


def step_of(
    commanded: float, fallback: str | None = None, reached: bool = True, **error: float
) -> dict[str, Any]:
    return {
        "commanded_nm_per_rad": commanded,
        "fallback": fallback,
        "reached": reached,
        "profile_error_m": error or None,
    }


def test_the_text_says_what_soles_decided() -> None:
    steps = (
        step_of(10.0, mean=0.001, p95=0.004),
        step_of(20.0, mean=0.003, p95=0.006),
        step_of(60.0, reached=False),
        step_of(99.0, "too late: 3 ms"),
        step_of(99.0, "too late, again"),
    )
    text = walk_text(replace(WALKED, stiffness=steps, policy="model"), LEVEL)
    assert "soft feet, stones" in text, "the stiffness of the start is not that of the walk"
    assert "'model': decided in 3 of 5 swings, 10 … 60 Nm/rad, median 20" in text
    assert "fell back in the others (2 too late); stiffness reached before the landing in 4 of 5" in text
    assert "2.0 mm from the true ground, 95 % of a scan within 5.0 mm; decided in 40 us, 90 at most" in text
    without = walk_text(replace(WALKED, stiffness=(step_of(9.0, "blind"),), clock=None), LEVEL)
    assert "decided in 0 of 1 swings\n" in without and "true ground" not in without
    told = walk_text(replace(WALKED, stiffness=(step_of(9.0),)), LEVEL)
    assert "fell back" not in told and "scan" not in told
    assert "soles" not in walk_text(replace(WALKED, stiffness=()), LEVEL)


def test_facts_are_a_name_and_a_value_a_line() -> None:
    facts = {
        "a": 1.23456,
        "b": {"c": [1, 2.0], "d": {"e": "x"}},
        "gone": None,
        "rows": [[1.0]],
        "gaps": [1, None],
    }
    found = [line.split() for line in facts_text(facts).splitlines()]
    assert found == [["a", "1.235"], ["b.c", "1", "2"], ["b.d.e", "x"]]


def test_a_report_is_printed_before_the_failure_of_a_part(capsys: Said) -> None:
    @reports
    def lossy(*, output: Output) -> Report:
        return output.report({"a": 1}, "a is 1", WbcError("lost"))

    with pytest.raises(WbcError, match="lost"):
        lossy()
    assert capsys.readouterr().out == "a is 1\n"


@pytest.mark.parametrize(("words", "level"), [({}, logging.WARNING), ({"verbose": True}, logging.INFO)])
def test_more_is_logged_when_asked_for(words: Any, level: int, monkeypatch: pytest.MonkeyPatch) -> None:
    set_to: list[int] = []
    monkeypatch.setattr(logging, "basicConfig", lambda level, handlers: set_to.append(level))

    @reports
    def quiet(*, output: Output) -> Report:
        return output.report({}, "")

    quiet(**words)
    assert set_to == [level]


# ---- live runs ------------------------------------------------------------------------------------------------------


def test_a_run_is_shown_by_the_viewer_that_is_named_and_driven_from_the_workbench() -> None:
    assert LiveView().viewer is None and LiveView(view="rerun").viewer == "rerun"
    assert LiveDrive(drive=True).viewer == LiveDrive(drive=True, view="workbench").viewer == "workbench"
    assert LiveView(view="meshcat", port=7001).port == LiveDrive(drive=True, port=7001).port == 7001
    for options in (
        {"port": 7001},
        {"port": 7001, "view": "mujoco"},
        {"view": "meshcat", "drive": True},
        {"view": "x"},
    ):
        with pytest.raises(InputError, match="workbench"):
            LiveDrive(**options)  # type: ignore[arg-type]


def test_a_run_without_a_page_runs_once_and_one_with_a_page_as_often_as_it_asks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made: list[Any] = []
    asks = [True, True, False]

    class Hook:
        def __init__(self, viewer: str, **options: Any) -> None:
            self.viewer, self.options, self.opened, self.closed = viewer, options, [], False

        def open(self, trial: Any) -> None:
            self.opened.append(trial)

        def restarted(self, how: str) -> bool:
            assert how == "ended 7"
            return asks.pop(0)

        def close(self) -> None:
            self.closed = True

    def make() -> Any:
        made.append(SimpleNamespace(hooks=[], stop=lambda: None))
        return made[-1]

    monkeypatch.setattr("wbc.app.view.walk_hook.WatchWalk", Hook)

    def run(options: LiveView) -> Any:
        return options.run(make, lambda trial, hooks: 7, lambda ended: f"ended {ended}")  # type: ignore[arg-type]

    result, trial, hooks = run(LiveView())
    assert (result, trial, hooks, len(made)) == (7, made[0], [], 1)
    result, trial, (hook,) = run(LiveView(view="workbench", port=0))
    assert len(made) == 4 and trial is made[3] and hook.opened == made[1:] and hook.closed and not asks
    assert hook.viewer == "workbench" and hook.options["port"] == 0


def test_changes_from_the_page_and_the_end_by_ctrl_c_stand_in_the_result() -> None:
    push = {"time": 1.0, "what": "push", "direction": "left", "impulse": 0.3}
    hooks: Any = [
        SimpleNamespace(controls=None),
        SimpleNamespace(controls=SimpleNamespace(interventions=[push])),
    ]
    running, stopped = (SimpleNamespace(last=last) for last in (None, 2.5))
    data, text = with_changes([], running, {"a": 1}, "told")  # type: ignore[arg-type]
    assert data == {"a": 1, "interactive": False} and text == "told"
    data, text = with_changes(hooks, stopped, {"a": 1}, "told")  # type: ignore[arg-type]
    assert data["interactive"] and data["interventions"] == [push, {"time": 2.5, "what": "end"}]
    assert text.startswith("told\n") and "1.00 s: pushed left with 0.3 Ns/kg" in text
    assert ending(running) == []  # type: ignore[arg-type]


@pytest.mark.parametrize(("terminal", "watched"), [(True, False), (True, True), (False, False)])
def test_progress_is_shown_on_a_terminal_unless_a_page_shows_it(
    terminal: bool, watched: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rich.console import Console  # noqa: PLC0415

    console = Console(force_terminal=terminal, file=io.StringIO())
    monkeypatch.setattr(live, "progress_console", lambda: console)
    trial: Any = SimpleNamespace(hooks=[])
    with shown_progress(trial, watched=watched):
        assert [type(hook) for hook in trial.hooks] == ([ProgressLine] if terminal and not watched else [])


# ---- stands, clips, feet, robots ------------------------------------------------------------------------------------


def stand_result(**values: Any) -> Any:
    result = {
        "robot": "g1",
        "seed": 0,
        "seconds": 3.0,
        "failures": 0,
        "mode": "position",
        "upright": True,
        "com_error_mm": 1.23,
        "zmp_noise_mm": 0.45,
        "real_time_factor": 2.5,
        "tick_us": {"median": 100.0, "p99": 200.0},
        "steps_taken": 4,
        "noise": "none",
        "foot": "flat",
        "control_period": 0.005,
    }
    from wbc.sim.balance.standing import StandResult  # noqa: PLC0415

    return StandResult(**result | values)


def test_the_text_of_a_stand_says_how_it_ended(capsys: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    results: list[Any] = []

    class Stood:
        hooks: list[Any] = []  # noqa: RUF012
        last = None
        drives = SimpleNamespace(reason="it is why")

        def __init__(self, spec: Any, **_: Any) -> None:
            self.spec = spec

        def run(self, hooks: Any) -> Any:
            return results[-1]

    monkeypatch.setattr(stand_command, "StandTrial", Stood)
    for changes, state, more, failed in (
        ({}, "stood 3 s\n", [], ""),
        ({"upright": False}, "FELL after 3 s", [], ""),
        (
            {"failures": 2},
            "FAILED within 3 s",
            ["--control-period", "0.005"],
            "2 of 600 ticks failed: it is why",
        ),
        ({}, "stood 3 s, 4 steps", ["--steps", "allowed"], ""),
    ):
        results.append(stand_result(**changes))
        assert main(["stand", "--robot", "g1", *more]) == (1 if failed else RAN)
        said = capsys.readouterr()
        assert state in said.out and failed in said.err, said


def measures(**values: Any) -> MotionMeasures:
    parts = {"joint_excess": {"a": 0.1}, "joint_speed": {"a": 1.0, "b": 1.0}, "joint_torque": {}}
    figures = dict.fromkeys(("foot_slide", "penetration", "zmp_worst", "friction"), 0.5) | {
        "single_support": 0.25
    }
    return MotionMeasures(
        **parts | figures | {"infeasible_frames": np.array([True, False, False, False, True])} | values
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
    )
    head, *_, most = motion_command._changes(SimpleNamespace(name="clip"), result)  # type: ignore[arg-type]
    assert head.startswith("clip: feasible; 1.50 x its time") and head.endswith("12 mm")
    assert (
        re.findall(r"joint_(\d) ([\d.]+)", most)[:2] == [("8", "45.8"), ("7", "40.1")]
        and most.count("joint_") == 6
    )


def test_options_of_a_clip_that_do_not_belong_to_it_are_refused(tmp_path: Path, capsys: Said) -> None:
    clip = tmp_path / "clip.npz"
    for words, said in (
        (["check", str(clip), "-o", "a.npz"], "'motion check'"),
        (["track", str(clip), "-o", "a.npz"], "'motion track'"),
        (["filter", str(clip)], "--out"),
        (["check", str(tmp_path / "person.bvh"), "--joint", "LKnee"], "LKnee"),
    ):
        np.savez(clip, x=np.zeros(3))
        (tmp_path / "person.bvh").write_text("HIERARCHY")
        assert main(["motion", *words]) == 2
        assert said in capsys.readouterr().err or "bvh" in words[1]


def test_a_clip_is_checked_filtered_and_tracked_by_its_verb(
    capsys: Said, monkeypatch: pytest.MonkeyPatch
) -> None:
    called: list[str] = []

    def note(verb: str) -> Any:
        def run(file: Path, options: Any, *rest: Any) -> Report:
            called.append(verb)
            return rest[-1].report({}, "")

        return run

    for verb in ("check", "filter", "track"):
        monkeypatch.setattr(motion_command, f"_{verb}", note(verb))
        assert main(["motion", verb, "clip.npz"]) == RAN
    assert called == ["check", "filter", "track"]


@pytest.mark.parametrize(("standing", "feasible"), [(True, True), (True, False), (False, True)])
def test_a_clip_is_filtered_before_it_is_tracked_unless_it_is_feasible_and_stands(
    standing: bool, feasible: bool, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    clip: Any = SimpleNamespace(name="clip", standing=np.ones(3) if standing else None)
    robot, tracked = SimpleNamespace(), []
    monkeypatch.setattr(motion_command.TrackOptions, "read", lambda self, file: (robot, clip))
    monkeypatch.setattr(motion_command, "check_motion", lambda *_: SimpleNamespace(feasible=feasible))
    made = SimpleNamespace(
        clip="made", after=measures(), before=measures(), stretched=1.5, shortened=0.01, changes={"a": 0.1}
    )
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
            told |= {"joint_rms_deg": 1.0, "worst_joint": "a", "worst_joint_rms_deg": 2.0, "largest_deg": 3.0}
            told |= {"com_rms_mm": 4.0, "foot_slide_mm": 5.0, "landings": 2, "tick_us": ticks}
            return TrackResult(robot="g1", seed=0, seconds=1.0, failures=0, **told)  # type: ignore[arg-type]

    monkeypatch.setattr(motion_command, "TrackTrial", Tracked)
    assert main(["motion", "track", "clip.npz"]) == RAN
    said = capsys.readouterr().out
    assert tracked == [clip if standing and feasible else "made"]
    assert ("1.50 x its time" in said) is not (standing and feasible) and "tracked to its end" in said


def test_the_list_of_feet_is_in_millimetres_and_kilograms(capsys: Said) -> None:
    """Of a soft foot under g1: 278 x 104 mm, the ankle 30 mm behind its middle."""
    assert main(["foot", "--robot", "g1", "--json"]) == RAN
    fits = {entry["name"]: entry["fits"]["g1"] for entry in json.loads(capsys.readouterr().out)["feet"]}
    assert main(["foot", "--robot", "g1"]) == RAN
    lines = capsys.readouterr().out.splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("soft:"))
    figures = [float(each) for each in re.findall(r"-?\d+(?:\.\d+)?", lines[at + 1].partition("g1")[2])]
    length, width, behind, up, mass, higher = figures
    fit = fits["soft"]
    assert [length, width] == pytest.approx(1e3 * np.array(fit["footprint_m"]), abs=0.5) and length > 200.0
    assert [-behind, up] == pytest.approx(
        1e3 * np.array(fit["ankle_in_sole_m"])[[0, 2]], abs=0.5
    ) and behind > 0.0
    assert mass == pytest.approx(fit["added_mass_kg"], abs=0.005)
    assert higher == pytest.approx(1e3 * fit["height_change_m"], abs=0.5)
    shared = lines[lines.index("How all of them touch the ground:") + 1 :]
    assert shared and all("contact." in line for line in shared)
    assert not any("contact." in line for line in lines[at:] if line not in shared)


def test_options_of_a_press_are_those_of_its_test(monkeypatch: pytest.MonkeyPatch, capsys: Said) -> None:
    pressed: list[Any] = []

    def stop(test: Any) -> Any:
        pressed.append(test)
        raise InputError("it would press now")

    monkeypatch.setattr(foot_command, "press", stop)
    assert main(["foot", "press", "--yaw", "90", "--stiffness", "7", "--timestep", "0.001"]) == 2
    (test,) = pressed
    assert test.yaw == pytest.approx(math.pi / 2.0) and test.foot.stiffness == 7.0
    assert test.physics.timestep == 0.001 and test.robot_sole == foot_command.HRP4C_SOLE
    assert main(["foot", "press", "--robot", "g1"]) == 2
    assert pressed[1].robot_sole != foot_command.HRP4C_SOLE
    assert pressed[1].foot == foot_by_name("soft")
    assert main(["foot", "press", "--stiffness", "7", "--foot-param", "stiffness=8"]) == 2
    assert "twice" in capsys.readouterr().err and len(pressed) == 2


def test_the_table_of_robots_has_four_figures_and_soles_in_millimetres(capsys: Said) -> None:
    assert main(["robots", "--json"]) == RAN
    robots = {each["name"]: each for each in json.loads(capsys.readouterr().out)["robots"]}
    assert main(["robots"]) == RAN
    rows = {line.split()[0]: line.split()[1:] for line in capsys.readouterr().out.splitlines()}
    for name, facts in robots.items():
        mass, height, com, joints, length, _, width = rows[name]
        assert float(mass) == pytest.approx(facts["mass_kg"], rel=1e-3) and int(joints) == facts["dof"]
        assert float(height) == pytest.approx(facts["height_m"], rel=1e-3)
        assert float(com) == pytest.approx(facts["com_height_m"], rel=1e-3)
        assert [float(length), float(width)] == pytest.approx(1e3 * np.array(facts["sole_m"]), abs=0.5)


def test_settings_are_listed_by_their_full_names_with_their_defaults(capsys: Said) -> None:
    @dataclasses.dataclass(frozen=True)
    class Inner:
        """Inner settings.

        Attributes:
            size: Its size, m.
            open: None by default.
        """

        size: float = 0.25
        open: float | None = None

    @dataclasses.dataclass(frozen=True)
    class Outer:
        """Outer settings.

        Attributes:
            pair: Two numbers.
            name: A name.
        """

        inner: Inner = dataclasses.field(default_factory=Inner)
        pair: tuple[float, float] = (1.0, 1e-5)
        name: str = "a"
        unsaid: int = 3

    for path, prefix in (("", ""), ("all", "all.")):
        assert [(row.owner, row.name, row.default) for row in settings_of(Outer, path)] == [
            ("Outer", f"{prefix}pair", "1, 1e-05"),
            ("Outer", f"{prefix}name", "a"),
            ("Inner", f"{prefix}inner.size", "0.25"),
            ("Inner", f"{prefix}inner.open", "–"),
        ]
    assert {row.name for row in settings_of(Gait, "gait")} >= {"gait.single_support", "gait.double_support"}
    assert main(["settings", "swing_height", "--json"]) == RAN
    found = json.loads(capsys.readouterr().out)["settings"]
    assert found and all("swing_height" in name for name in found)
    assert main(["settings", "nothing_of_this_name"]) == 2


# ---- studies --------------------------------------------------------------------------------------------------------

PLAIN = {"name": "s", "cells": {"a": {}}, "arms": {"b": {}}, "seeds": list(range(8)), "metric": "steps_done"}


def test_trials_without_a_result_are_named_with_their_commands(tmp_path: Path) -> None:
    study = Study.from_json(PLAIN)
    trials = list(study.trials())
    entries = [
        Entry(trial.plain, status, {"steps_done": 1} if status == "done" else None, None, None, provenance())
        for trial, status in zip(trials, ("done", "crashed", "timeout"), strict=False)
    ]
    found = run_command.reruns(study, {entry.key: entry for entry in entries}, tmp_path / "a b.jsonl")
    assert [(each["status"], each["seed"]) for each in found] == [("crashed", 1), ("timeout", 2)]
    assert found[0]["command"].endswith(f"--key {entries[1].key[: run_command.KEY_LENGTH]}")
    assert "'" in found[0]["command"], "a name with a space is one word"


@pytest.mark.parametrize("failures", [0, 1, 5, 7])
def test_the_text_of_a_sweep_names_the_first_failures(
    failures: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    (tmp_path / "s.json").write_text(json.dumps(PLAIN))
    failed = [
        {"command": f"run {i}", "status": "crashed", "cell": "a", "arm": "b", "seed": i}
        for i in range(failures)
    ]
    counts = {"done": 8 - failures} | ({"crashed": failures} if failures else {})
    summary = SimpleNamespace(
        counts=counts,
        per_hour=36.4,
        total=8,
        found=1,
        run=7,
        seconds=12.4,
        to_json=lambda: {"counts": counts},
    )
    monkeypatch.setattr(run_command, "run_trials", lambda *_, **__: summary)
    monkeypatch.setattr(run_command, "read_journal", lambda *_, **__: {})
    monkeypatch.setattr(run_command, "reruns", lambda *_: failed)
    words = ["study", "run", str(tmp_path / "s.json"), "--journal", str(tmp_path / "j.jsonl")]
    assert main(words) == RAN
    lines = capsys.readouterr().out.splitlines()
    assert "8 trials, 1 were in" in lines[0] and lines[0].endswith("7 run in 12 s (36 an hour)")
    assert [line.split()[1] for line in lines if "# crashed" in line] == [
        str(i) for i in range(min(failures, 5))
    ]
    assert sum("--json" in line for line in lines) == (failures > 5) and (
        failures < 7 or "and 2 more" in lines[-1]
    )
    assert main([*words, "--json"]) == RAN
    assert json.loads(capsys.readouterr().out)["without_result"] == failed


def test_a_key_of_a_journal_is_given_as_far_as_it_is_the_only_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    trials = list(Study.from_json(PLAIN | {"seeds": list(range(30))}).trials())
    entries = [Entry(trial.spec.to_json(), "done", {}, None, None, {}) for trial in trials]
    journal = tmp_path / "j.jsonl"
    journal.write_bytes(b"".join(entry.line() for entry in entries))
    outcome = SimpleNamespace(status="done", result={}, error=None, clock=None)
    monkeypatch.setattr(run_command, "run_trial", lambda *_: outcome)
    first = [entry.key[0] for entry in entries]
    common = next(letter for letter in first if first.count(letter) > 1)
    words = ["study", "run", "--journal", str(journal), "--key"]
    assert main([*words, common]) == BAD_INPUT
    assert f"{first.count(common)} keys of the journal begin with '{common}'" in capsys.readouterr().err
    entry = entries[first.index(common)]
    assert main([*words, entry.key]) == RAN
    assert f"{entry.key}: done, the same as in the journal (done)" in capsys.readouterr().out
    assert main([*words, "none"]) == BAD_INPUT
    assert "key of the journal" in capsys.readouterr().err


def test_a_trial_is_the_same_when_status_and_result_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    trial = next(iter(Study.from_json(PLAIN).trials()))
    entry = Entry(trial.spec.to_json(), "done", {"steps_done": 1}, None, None, {})
    journal = tmp_path / "j.jsonl"
    journal.write_bytes(entry.line())
    words = ["study", "run", "--journal", str(journal), "--key", entry.key[:6]]
    for status, result, same in (
        ("done", {"steps_done": 1}, True),
        ("done", {"steps_done": 2}, False),
        ("crashed", {"steps_done": 1}, False),
        ("crashed", None, False),
    ):
        outcome = SimpleNamespace(
            status=status, result=result, error="one\ntwo" if result is None else None, clock=None
        )
        monkeypatch.setattr(run_command, "run_trial", lambda *_, outcome=outcome: outcome)
        assert main(words) == RAN
        said = capsys.readouterr().out
        assert ("not the same" not in said) is same
        assert ("steps_done" in said) is (result is not None) and ("two" in said) is (result is None)
        assert main([*words, "--json"]) == RAN
        assert json.loads(capsys.readouterr().out)["same"] is same
    assert main([*words, "-o", str(tmp_path / "spec.json")]) == RAN
    written = (tmp_path / "spec.json").read_text(encoding="utf-8")
    assert json.loads(written) == entry.spec and written.endswith("}\n")
    capsys.readouterr()

    study = tmp_path / "study.json"
    study.write_text(json.dumps(PLAIN), encoding="utf-8")
    words = ["study", "table", str(study), "--journal", str(journal), "--any-code"]
    assert main([*words, "--json"]) == RAN
    data = json.loads(capsys.readouterr().out)
    assert main([*words, "-o", str(tmp_path / "table.json")]) == RAN
    capsys.readouterr()
    written = (tmp_path / "table.json").read_text(encoding="utf-8")
    assert json.loads(written) == data and written.endswith("}\n")


def test_a_filtered_clip_is_written_and_told_in_degrees_and_millimetres(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    clip: Any = SimpleNamespace(name="clip")
    made = SimpleNamespace(
        clip="made", after=measures(), before=measures(), stretched=1.5, shortened=0.012, changes={"a": 0.1}
    )
    written: list[Any] = []
    monkeypatch.setattr(motion_command.TrackOptions, "read", lambda self, file: (None, clip))
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
    options = motion_command.TrackOptions(robot="g1", joint=given, rate=30.0)
    assert options.read(Path("a.csv"))[1] is clip and asked == [(30.0, taken)]
    for option in ({"begin": 1.0}, {"end": 2.0}, {"up": "y"}):
        with pytest.raises(InputError, match="person"):
            motion_command.TrackOptions(robot="g1", **option).read(Path("a.csv"))


def test_the_joints_of_a_person_are_named_by_their_parts() -> None:
    options = motion_command.TrackOptions(robot="g1", joint=("left_knee=LKnee", "right_knee=R=Knee"))
    assert dict(options._joint_of_person()) == {"left_knee": "LKnee", "right_knee": "R=Knee"}
    with pytest.raises(InputError, match="LKnee"):
        dict(motion_command.TrackOptions(robot="g1", joint=("LKnee",))._joint_of_person())
