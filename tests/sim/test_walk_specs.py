"""Consequences of the spec of a walk: delays, times, pushes, seeds, policies, limits."""

from __future__ import annotations

import math
import types
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from properties import by_default

from wbc.base.errors import InputError
from wbc.base.files import stamped_file
from wbc.sim.simulation.machine import Machine
from wbc.sim.terrain.families.patchwork import stretches
from wbc.sim.terrain.spec import terrain
from wbc.sim.trial.push import WalkPush
from wbc.sim.walks import spec as module
from wbc.sim.walks.plan import WalkPlan
from wbc.sim.walks.presets import over
from wbc.sim.walks.spec import SEED_LIMIT, TOE_GAIT, WalkSpec
from wbc.sim.walks.stiffness_policy import make_policy
from wbc.sim.walks.trained import driven, turned
from wbc.sim.walks.trial import WalkTrial
from wbc.walking.control import WalkingControl
from wbc.walking.plans.gait import Gait

SHORT = WalkPlan(distance=0.3)


def test_delays_of_the_machine_are_known_to_the_observer_unless_it_is_told_others() -> None:
    machine = Machine(measurement_delay=0.002, command_delay=0.003)
    for changes, delays in (
        ({}, (0.002, 0.003)),
        ({"observer.command_delay": 0.001}, (0.002, 0.001)),
        ({"observer.measurement_delay": 0.0}, (0.0, 0.003)),
    ):
        settings = WalkSpec(plan=SHORT, machine=machine, changes=changes).settings().observer  # type: ignore[arg-type]
        assert (settings.measurement_delay, settings.command_delay) == delays
    still = WalkSpec(plan=SHORT, machine=Machine(friction=1.0), changes={"observer.command_delay": 0.001})  # type: ignore[arg-type]
    assert (still.settings().observer.measurement_delay, still.settings().observer.command_delay) == (
        0,
        0.001,
    )


def test_a_push_is_at_a_step_and_a_time_of_the_walk() -> None:
    """Planned steps are counted; a walk that decides its steps as it goes has any number of them."""
    planned = WalkSpec(plan=SHORT, mode="position")
    steps, limit = len(planned.prepare().plan), planned.prepare().time_limit

    def pushed(spec: WalkSpec, **when: Any) -> bool:
        try:
            replace(spec, pushes=(WalkPush(impulse=0.1, **when),))
        except InputError:
            return False
        return True

    assert pushed(planned, step=1) and pushed(planned, step=steps) and not pushed(planned, step=steps + 1)
    assert pushed(planned, time=0.0) and pushed(planned, time=limit - 1e-6)
    assert not pushed(planned, time=limit) and not pushed(planned, time=limit + 1.0)
    rows = ((0.0, 0.1, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    for spec in (WalkSpec(plan=SHORT, mode="torque"), WalkSpec(plan=WalkPlan(drive=rows), mode="position")):
        assert pushed(spec, step=steps + 100)
    with pytest.raises(InputError):
        WalkSpec(plan=SHORT, pushes=(WalkPush(impulse=0.1, time=1.0, body="tail"),))


def test_seeds_are_below_their_limit_and_sensors_may_have_their_own() -> None:
    last = SEED_LIMIT - 1
    assert SEED_LIMIT == 2**63
    assert WalkSpec(plan=SHORT, seed=last, noise_seed=last).seed == last
    for bad in (lambda: WalkSpec(seed=last + 1), lambda: WalkSpec(noise_seed=last + 1)):
        with pytest.raises(InputError):
            bad()
    read = {}
    for seed, noise_seed in ((1, None), (1, 1), (1, 2), (3, 2)):
        spec = WalkSpec(plan=SHORT, seed=seed, noise_seed=noise_seed, noise="realistic")
        read[seed, noise_seed] = tuple(WalkTrial(spec, visuals=False).plant.measure().joint_position.tolist())
    assert read[1, None] == read[1, 1] and read[1, 2] == read[3, 2]
    assert len(set(read.values())) == 2


def test_free_steps_are_decided_every_two_milliseconds_and_planned_ones_every_five() -> None:
    periods = {
        "position": WalkSpec(plan=SHORT, mode="position").period,
        "torque": WalkSpec(plan=SHORT, mode="torque").period,
        "given": WalkSpec(plan=SHORT, mode="torque", control_period=0.004).period,
    }
    assert list(periods.values()) == [0.005, 0.002, 0.004]


def test_a_ramp_is_written_and_counts_where_it_is_not_the_usual_one() -> None:
    usual = terrain("stones", 0.02)
    for params, stored in (
        ({}, ()),
        ({"ramp": usual.ramp}, ()),
        ({"ramp": 2.0 * usual.ramp}, (("ramp", 2.0 * usual.ramp),)),
    ):
        spec = WalkSpec(plan=SHORT, terrain="stones", amplitude=0.02, terrain_params=params)  # type: ignore[arg-type]
        assert spec.terrain_params == stored
        assert spec.to_json()["terrain_params"]["ramp"] == spec.ground().ramp
    assert WalkSpec(plan=SHORT, terrain_params={"ramp": 0.5}).terrain_params == ()  # type: ignore[arg-type]


def test_a_walk_with_free_steps_takes_the_time_of_its_way_its_turn_and_its_steps() -> None:
    """Steps at low speed for landings that are given, 0.7 of the cruise for a way, half of the fastest turn."""

    def prepared(plan: WalkPlan, **fields: Any) -> tuple[float, Any]:
        made = WalkSpec(plan=plan, mode="torque", **fields).prepare()
        return made.nominal_time, made

    _, some = prepared(SHORT)
    source: Any = WalkingControl(some.robot(), some.plan, 0.002, some.settings).source
    s, shift = source.settings, source.constants.stand.shift_time
    pause = shift + 8.0 * s.slow_time
    for distance in (0.4, -1.3):
        assert prepared(WalkPlan(distance=distance))[0] == pytest.approx(
            abs(distance) / (0.7 * s.cruise) + pause
        )
    for start in (0.0, 2.0):
        for turn in (0.7, -0.9):
            time, made = prepared(WalkPlan(turn=turn), start=(0.0, 0.0, start))
            (x, y), (x_, y_) = made.arrival().track[0], made.arrival().goal[:2]
            away = math.hypot(x_ - x, y_ - y)
            assert time == pytest.approx(
                2.0 * abs(turn) / s.fastest_turn + away / (0.7 * s.cruise) + pause, rel=1e-6
            )
    time, made = prepared(WalkPlan(velocity=(0.1, 0.0, 0.1), steps=4))
    end = shift + 4 * s.slow_time
    assert made.orders == ((0.0, 0.1, 0.0, 0.1), (pytest.approx(end), 0.0, 0.0, 0.0))
    assert time == pytest.approx(end + pause)
    steps = WalkSpec(plan=SHORT, mode="position").prepare().plan.steps
    time, _ = prepared(WalkPlan(footsteps=steps))
    assert time == pytest.approx(len(steps) * s.slow_time + pause)


def test_a_ground_is_as_long_as_the_way_of_planned_or_of_free_steps() -> None:
    """Free steps of a velocity take 0.8 s at most, planned ones what their gait says."""
    plan, ground = WalkPlan(velocity=(0.3, 0.0, 0.0), steps=40), {"terrain": "stones", "amplitude": 0.01}
    cycle = Gait.for_speed((0.3, 0.0, 0.0), Gait()).full.cycle
    for mode, time in (("position", cycle), ("torque", 0.8)):
        spec = WalkSpec(plan=plan, mode=mode, **ground)  # type: ignore[arg-type]
        assert spec.ground().length == max(3.0, math.ceil(40 * 0.3 * time - 0.3)), mode
    assert math.ceil(12.0 * cycle - 0.3) != math.ceil(12.0 * 0.8 - 0.3)
    stairs = {"direction": "up", "tread": 0.3, "length": 1.2}
    climb = WalkSpec(terrain="steps", terrain_params=stairs, plan=WalkPlan(stairs="together"))  # type: ignore[arg-type]
    assert climb.ground().length == 1.2


def test_steps_are_planned_in_position_control_and_free_in_torque_and_hybrid_control() -> None:
    steps = WalkSpec(plan=SHORT, mode="position").prepare().plan.steps
    given = WalkPlan(footsteps=steps)
    for plan, mode, free in (
        (SHORT, "position", False),
        (SHORT, "torque", True),
        (SHORT, "hybrid", True),
        (given, "torque", True),
        (given, "position", False),
    ):
        spec = WalkSpec(plan=plan, mode=mode)  # type: ignore[arg-type]
        assert spec.free == free
        assert len(spec.prepare().plan) == (len(steps) if plan is given or not free else 0)
    assert WalkSpec(plan=SHORT, eyes="toes").prepare().plan.gait.full.apex == TOE_GAIT.full.apex
    own = Gait(apex=0.6)
    assert WalkSpec(plan=SHORT, eyes="toes", gait=own).prepare().plan.gait.full.apex == 0.6


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"mode": "torque", "gait": Gait(apex=0.5)}, "no gait, got apex.*mode='position'"),
        ({"mode": "hybrid", "gains": "frizza"}, "'frizza'.*mode='position'"),
        ({"mode": "position", "changes": {"stepping.cruise": 0.1}}, "'stepping.cruise'.*mode='torque'"),
        ({"mode": "torque", "changes": {"gains.dcm_p": 4.0}}, "'gains.dcm_p'.*mode='position'"),
    ],
)
def test_what_steps_of_the_mode_do_not_have_is_refused_with_the_mode_that_has_it(
    given: dict[str, Any], named: str
) -> None:
    with pytest.raises(InputError, match=named):
        WalkSpec(plan=SHORT, **given)


def test_the_file_of_a_policy_is_known_by_its_content_and_that_of_its_description(tmp_path: Path) -> None:
    file = tmp_path / "walk.onnx"
    file.write_bytes(b"network")
    alone = stamped_file(str(file), "policy", ".toml")
    assert alone.startswith(f"{file}#") and stamped_file(alone, "policy", ".toml") == alone
    file.with_suffix(".toml").write_text("described", encoding="utf-8")
    both = stamped_file(str(file), "policy", ".toml")
    assert both != alone and stamped_file(both, "policy", ".toml") == both
    file.write_bytes(b"another")
    for old in (alone, both):
        with pytest.raises(InputError, match="has changed"):
            stamped_file(old, "policy", ".toml")
    with pytest.raises(InputError, match=r"none\.onnx"):
        stamped_file(str(tmp_path / "none.onnx"), "policy", ".toml")


def test_the_plan_of_a_trained_policy_is_its_velocity_after_a_second() -> None:
    """A distance is walked at 0.3 m/s, steps of a velocity take 0.8 s; all take at least 0.1 s."""
    for plan, rows in (
        (WalkPlan(distance=0.6), ((1.0, 0.3, 0.0, 0.0), (3.0, 0.0, 0.0, 0.0))),
        (WalkPlan(distance=-0.9), ((1.0, -0.3, 0.0, 0.0), (4.0, 0.0, 0.0, 0.0))),
        (WalkPlan(distance=0.003), ((1.0, 0.3, 0.0, 0.0), (1.1, 0.0, 0.0, 0.0))),
        (
            WalkPlan(velocity=(0.2, 0.1, -0.3), steps=5),
            ((1.0, 0.2, 0.1, -0.3), (5.0, 0.0, 0.0, 0.0)),
        ),
    ):
        found = driven(plan)
        assert found.drive is not None
        np.testing.assert_allclose(found.drive, rows, atol=1e-12)
        assert turned(found.drive) == pytest.approx(rows[0][3] * (rows[1][0] - rows[0][0]))
        assert driven(found) is found
    assert turned(((0.0, 0.0, 0.0, 0.5), (2.0, 0.0, 0.0, -0.1), (5.0, 0.0, 0.0, 0.0))) == pytest.approx(0.7)
    assert turned(()) == turned(((0.0, 0.0, 0.0, 0.0),)) == 0
    with pytest.raises(InputError):
        driven(WalkPlan(turn=1.0))


def test_an_oracle_has_the_stiffness_of_the_family_under_a_landing() -> None:
    ground = terrain("patchwork", seed=3)
    parts = stretches(ground)
    values = {name: 3.0 + i for i, name in enumerate(sorted({name for name, *_ in parts}))}
    known: Any = make_policy("oracle", tuple(values.items()), ground)
    assert len(values) > 1
    for name, begin, end in parts:
        for x in (begin + 1e-6, 0.5 * (begin + end), end - 1e-6):
            assert known.function(x, 5.0) == values[name]
    assert known.function(parts[0][1] - 10.0, 0.0) == values[parts[0][0]]
    assert known.function(parts[-1][2] + 10.0, 0.0) == values[parts[-1][0]]
    for wrong in (list(values.items())[1:], [*values.items(), ("moon", 3.0)]):
        with pytest.raises(InputError):
            make_policy("oracle", tuple(wrong), ground)


@pytest.mark.parametrize("direction", by_default(["up", "down"], "down"))
def test_a_robot_that_starts_high_up_or_deep_down_has_fallen_as_far_from_there(direction: str) -> None:
    """The height of a fall is that over the soles: behind stairs of 0.3 m as in front of them."""
    stairs = {"terrain": "steps", "amplitude": 0.3, "terrain_params": {"direction": direction, "length": 3.2}}
    limits = []
    for x in (0.0, 3.9):
        spec = WalkSpec(plan=WalkPlan(turn=0.3), noise="none", start=(x, 0.0, 0.0), **stairs)  # type: ignore[arg-type]
        trial = WalkTrial(spec, visuals=False)
        assert trial.ground == pytest.approx(
            0.0 if x == 0.0 else 0.3 if direction == "up" else -0.3, abs=1e-5
        )
        assert trial.true_fall() is None
        limits.append(trial.falls.height)
    assert limits[0] == pytest.approx(limits[1], abs=1e-5)


def test_a_walk_that_goes_down_has_room_for_its_fall_below_its_height() -> None:
    """The lowest CoM is the drop of a fall below that at the start, or below that of a walk that is lower."""
    drops = {}
    for height in (None, 0.75, 0.72):
        changes = {} if height is None else {"com_height": height}
        trial = WalkTrial(WalkSpec(plan=SHORT, noise="none", changes=changes), visuals=False)  # type: ignore[arg-type]
        start = trial.plant.com_height - trial.ground
        drops[height] = start - trial.falls.height
        scale = trial.plant.robot.length_scale
        assert trial.falls.tilt == trial._prepared.settings.falls.tilt
    least = 0.18 * scale
    assert drops[0.72] - drops[0.75] == pytest.approx(0.03)
    assert drops[None] == pytest.approx(least, abs=0.02) and drops[None] >= least - 1e-9


def test_parts_of_a_preset_stay_under_those_that_are_given_but_for_what_belongs_to_a_value() -> None:
    """Settings of one name are one, with and without the name of their group; a new foot has its own stiffness."""
    lower = {
        "foot": "soft",
        "stiffness": 5.0,
        "terrain": "stones",
        "amplitude": 0.02,
        "changes": {"gains.dcm_p": 3.0, "dcm_i": 1.0, "mpc.rate": 2.0},
        "plan": {"distance": 2.0},
        "gait": {"apex": 0.05},
    }
    assert over({}, lower) == lower
    assert over({"amplitude": 0.03}, lower) == {**lower, "amplitude": 0.03}
    same = over({"foot": "soft"}, lower)
    assert same == lower
    other = over({"foot": "rigid", "terrain": "flat"}, lower)
    assert {"stiffness", "amplitude"}.isdisjoint(other) and other["gait"] == {"apex": 0.05}
    for given, kept in (
        ({"dcm_p": 4.0}, {"dcm_i": 1.0, "mpc.rate": 2.0}),
        ({"gains.dcm_p": 4.0}, {"dcm_i": 1.0, "mpc.rate": 2.0}),
        ({"gains.dcm_i": 4.0}, {"gains.dcm_p": 3.0, "mpc.rate": 2.0}),
        ({"p": 4.0, "cruise": 1.0}, {"gains.dcm_p": 3.0, "dcm_i": 1.0, "mpc.rate": 2.0}),
    ):
        assert over({"changes": given}, lower)["changes"] == {**kept, **given}
    assert over({"plan": {"distance": 1.0}}, lower)["plan"] == {"distance": 1.0}
    assert over({"plan": {"turn": 1.0}}, lower)["plan"] == {"turn": 1.0}
    assert over({"changes": None}, lower)["changes"] is None


@pytest.mark.parametrize("seeing", [False, True])
def test_a_trained_policy_has_the_eyes_that_it_needs_and_its_own_mode_and_gait(
    seeing: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "described", lambda name: types.SimpleNamespace(joints=()))
    monkeypatch.setattr(module, "policy_columns", lambda robot, joints: None)
    monkeypatch.setattr(module, "sees", lambda name: seeing)
    blind = WalkSpec(plan=SHORT)
    for eyes in ("none", "depth", "toes"):
        spec = replace(blind, eyes=eyes)
        if (eyes != "none") == seeing:
            assert spec._check_trained("made up") == "made up"
            continue
        rule = "depth or toes: it sees the ground" if seeing else "none: it does not see the ground"
        with pytest.raises(
            InputError, match=f"eyes of a walk by a trained policy must be {rule}, got '{eyes}'"
        ):
            spec._check_trained("made up")
    right = replace(blind, eyes="depth" if seeing else "none")
    for mode, good in (("torque", True), (None, True), ("position", False), ("hybrid", False)):
        spec = replace(right, mode=mode)
        if good:
            spec._check_trained("made up")
            continue
        with pytest.raises(InputError, match=f"mode of a walk by a trained policy .* got '{mode}'"):
            spec._check_trained("made up")
    with pytest.raises(InputError, match="gait of a walk by a trained policy must be left out"):
        replace(right, gait=Gait(apex=0.6))._check_trained("made up")


def test_a_trained_policy_is_to_end_at_the_heading_that_its_orders_ask_for() -> None:
    """Its heading at the start and the turn of its velocities; a controller of the library has a reference."""
    trial: Any = WalkTrial(WalkSpec(plan=SHORT, start=(0.0, 0.0, 0.4)), visuals=False)
    orders = ((0.5, 0.1, 0.0, 0.3), (1.5, 0.0, 0.0, 0.0))
    assert trial._travel(None)["yaw_error"] == pytest.approx(0.0, abs=1e-9)
    heading = trial._heading()
    assert heading == pytest.approx(0.4)
    made = types.SimpleNamespace(
        spec=types.SimpleNamespace(start=(0.0, 0.0, 0.4), trained="made up"),
        plant=trial.plant,
        meter=trial.meter,
        control=None,
        _origin=trial._origin,
        _heading=trial._heading,
        _prepared=types.SimpleNamespace(orders=orders),
    )
    travel: Any = WalkTrial._travel
    assert travel(made, None)["yaw_error"] == pytest.approx(-0.3)
    made._prepared.orders = None
    assert travel(made, None)["yaw_error"] == pytest.approx(0.0, abs=1e-9)
