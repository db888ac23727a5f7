"""Reports of commands: every figure stands in the unit that its text says."""

from __future__ import annotations

import dataclasses
import io
import json
import logging
import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from wbc.app import live
from wbc.app.cli import RAN, main
from wbc.app.commands import foot as foot_command
from wbc.app.commands import stand as stand_command
from wbc.app.commands.settings import settings_of
from wbc.app.live import LiveDrive, LiveView, ProgressLine, ending, shown_progress, with_changes
from wbc.app.output import Report, facts_text, reports
from wbc.app.walk_report import walk_text
from wbc.base.errors import InputError, WbcError
from wbc.feet import foot as foot_by_name
from wbc.sim import WalkPlan, WalkSpec
from wbc.sim.trial.spec import WallClock
from wbc.sim.walks.result import Energy, Fall, Spread, Touchdowns, WalkResult
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
    speed=0.126,
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
    clock=WallClock(1.0, 2.5, {"median": 120.4, "p99": 310.6}, {"median": 40.0, "max": 90.0}),
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
    assert told["walked"] == "8 of 9 steps in 12.3 s, 0.21 m from the goal"
    assert told["errors"] == "ZMP 12.3 ± 4.5, CoM 6.7 ± 1.1, DCM – mm, at most 89 mm"
    assert told["landing"] == "2 early, 3 on time, 1 late, 4 without ground; at most 1.75 x weight"
    assert (
        told["distance"] == "1.25 m, -3.1 cm to the left, heading off by +5.7°, 0.13 m/s over its middle half"
    )
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
    driven_walk = replace(WALKED, goal_error=None)
    free = lines_of(driven_walk, WalkSpec(plan=WalkPlan(velocity=(0.1, 0.0, 0.0), steps=4), mode="torque"))
    assert ("free steps" in free[""]) == (free["walked"] == "8 steps in 12.3 s")
    driven = WalkSpec(plan=WalkPlan(drive=((0.0, 0.1, 0.0, 0.0), (2.0, 0.0, 0.0, 0.0))), mode="torque")
    assert driven.free
    told = lines_of(driven_walk, driven)
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
    def lossy() -> Report:
        return Report({"a": 1}, "a is 1", WbcError("lost"))

    with pytest.raises(WbcError, match="lost"):
        lossy()
    assert capsys.readouterr().out == "a is 1\n"


@pytest.mark.parametrize(("words", "level"), [({}, logging.WARNING), ({"verbose": True}, logging.INFO)])
def test_more_is_logged_when_asked_for(words: Any, level: int, monkeypatch: pytest.MonkeyPatch) -> None:
    set_to: list[int] = []
    monkeypatch.setattr(logging, "basicConfig", lambda level, handlers: set_to.append(level))

    @reports
    def quiet() -> Report:
        return Report({}, "")

    quiet(**words)
    assert set_to == [level]


# ---- live runs ------------------------------------------------------------------------------------------------------


def test_a_run_is_shown_by_the_viewer_that_is_named_and_driven_from_the_workbench() -> None:
    assert LiveView().view is None and LiveView(view="rerun").view == "rerun"
    assert LiveDrive(drive=True).view == LiveDrive(drive=True, view="workbench").view == "workbench"
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
    shown: list[Any] = []
    asks = [True, True, False]

    class Page:
        def __init__(self, **options: Any) -> None:
            self.options, self.closed, self.stays = options, False, False

        def ended(self, how: str) -> bool:
            assert how == "ended 7"
            return asks.pop(0)

        def close(self) -> None:
            self.closed = True

    def make() -> Any:
        made.append(SimpleNamespace(hooks=[], stop=lambda: None))
        return made[-1]

    monkeypatch.setattr("wbc.app.Workbench", Page)

    def run(options: LiveView) -> Any:
        return options.run(
            make,
            lambda trial, hooks: shown.append((trial, *hooks)) or 7,  # type: ignore[func-returns-value]
            lambda ended: f"ended {ended}",
        )

    result, trial, hooks = run(LiveView())
    assert (result, trial, hooks, len(made)) == (7, made[0], [], 1)
    result, trial, (page,) = run(LiveView(view="workbench", port=0))
    assert len(made) == 4 and trial is made[3] and page.closed and not asks
    assert shown == [(made[0],), *((each, page) for each in made[1:])]
    assert page.stays and page.options["port"] == 0 and page.options["speed"] == 1.0


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
        "com_error": 0.00123,
        "zmp_noise": 0.00045,
        "clock": WallClock(1.0, 2.5, {"median": 100.0, "p99": 200.0}),
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


def test_options_of_a_press_are_those_of_its_test(monkeypatch: pytest.MonkeyPatch, capsys: Said) -> None:
    pressed: list[Any] = []

    def stop(test: Any) -> Any:
        pressed.append(test)
        raise InputError("it would press now")

    monkeypatch.setattr(foot_command, "press", stop)
    assert main(["foot", "press", "--stiffness", "7", "--settle", "0.1"]) == 2
    (test,) = pressed
    assert test.settle == 0.1 and test.foot.stiffness == 7.0 and test.robot_sole == foot_command.HRP4C_SOLE
    assert main(["foot", "press", "--robot", "g1"]) == 2
    assert pressed[1].robot_sole != foot_command.HRP4C_SOLE
    assert pressed[1].foot == foot_by_name("soft")
    assert main(["foot", "press", "--stiffness", "7", "--foot-param", "stiffness=8"]) == 2
    assert "the stiffness of a foot" in capsys.readouterr().err and len(pressed) == 2


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
        sole = next(iter(facts["soles"].values()))["size_m"]
        assert [float(length), float(width)] == pytest.approx(1e3 * np.array(sole), abs=0.5)


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
