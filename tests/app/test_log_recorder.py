"""A recorder writes down what happens in a tick, all of it, and changes nothing."""

from __future__ import annotations

import json
import logging
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded import GAIT, SECONDS, make_walk, recorded_scans, recorded_stand, recorded_walk, run

import wbc
from wbc.app.log.plain import from_plain, to_plain
from wbc.app.log.reader import Log
from wbc.app.log.recorder import Recorder
from wbc.app.plot.figures import draw
from wbc.core.errors import InputError
from wbc.core.qp.solution import Solution
from wbc.core.signals import Command, Measurement
from wbc.feet import foot
from wbc.feet.soles.catalog import foot_names
from wbc.sim import WalkPlan, WalkSpec, walk
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.terrain.spec import terrain
from wbc.tasks.balance import balance_controller
from wbc.tasks.stabilizer.admittance import FootCorrection
from wbc.walking.control import WalkingControl
from wbc.walking.planning.phases import Event

EXACT = 2e-7
"""Numbers are kept with 24 bits: half of the last one is 6e-8 of them."""


class Witness:
    """Keeps copies of everything, so that nothing can change behind them."""

    def __init__(self) -> None:
        self.kept: dict[str, list[Any]] = {}

    def __call__(
        self, plant: wbc.Plant, walk: WalkingControl, measurement: Measurement, command: Command
    ) -> None:
        truth, estimate, solution = plant.truth(), walk.control.observer.robot, walk.control.solution
        assert walk.reference is not None and walk.output is not None and solution is not None
        pendulum, output = walk.reference.pendulum, walk.output
        now = {
            "time": measurement.time,
            "joint/position": measurement.joint_position,
            "joint/velocity": measurement.joint_velocity,
            "imu/angular_velocity": measurement.angular_velocity,
            "imu/specific_force": measurement.specific_force,
            "foot/right/wrench_measured": measurement.sole_wrench[1],
            "foot/left/stiffness": measurement.sole_stiffness[0],
            "joint/torque_command": command.joint_torque,
            "joint/position_reference": command.joint_position,
            "joint/velocity_reference": command.joint_velocity,
            "base/estimated/position": estimate.q[:3],
            "base/estimated/orientation": estimate.q[3:7],
            "base/estimated/linear_velocity": estimate.v[:3],
            "base/estimated/angular_velocity": estimate.v[3:6],
            "base/commanded/position": walk.control.q[:3],
            "com/estimated": estimate.com,
            "com/estimated_velocity": estimate.com_velocity,
            "dcm/estimated": (estimate.com + estimate.com_velocity / pendulum.omega)[:2],
            "foot/left/estimated/position": estimate.placement(estimate.soles[0].frame).translation,
            "com/reference": pendulum.com,
            "com/reference_velocity": pendulum.com_velocity,
            "com/reference_acceleration": pendulum.com_acceleration,
            "dcm/reference": pendulum.dcm[:2],
            "zmp/reference": pendulum.zmp,
            "zmp/desired": output.zmp,
            "zmp/measured": output.measured_zmp,
            "foot/left/wrench_desired": output.feet.wrenches[0],
            "foot/right/wrench_solved": solution.wrenches["right_foot"],
            "foot/right/wrench_desired": output.feet.wrenches[1],
            "foot/left/wrench_solved": solution.wrenches["left_foot"],
            "foot/left/wrench_measured": measurement.sole_wrench[0],
            "foot/left/contact": walk.reference.contact[0],
            "foot/right/contact": walk.reference.contact[1],
            "foot/left/correction": correction(output.corrections[0]),
            "foot/right/correction": correction(output.corrections[1]),
            "foot/left/reference/position": walk.reference.feet[0].placement.translation,
            "foot/left/reference/linear_velocity": walk.reference.feet[0].velocity[:3],
            "foot/left/reference/angular_velocity": walk.reference.feet[0].velocity[3:],
            "foot/right/estimated/position": estimate.placement(estimate.soles[1].frame).translation,
            "truth/foot/left/position": site(plant, 0),
            "truth/foot/right/position": site(plant, 1),
            "step/landing": landing(walk),
            "pendulum/omega": pendulum.omega,
            "walk/heading": walk.reference.heading,
            "walk/steps_done": walk.steps_done,
            "walk/lean": [] if walk.lean is None else walk.lean.angle,
            "stabilizer/bias": [] if walk.bias is None else walk.bias.bias,
            "stabilizer/in_air": output.in_air,
            "stabilizer/dcm_error_average": output.errors.average,
            "stabilizer/dcm_error_rate": output.errors.rate,
            "stabilizer/com_acceleration": output.com_acceleration,
            "stabilizer/com_offset": output.com_offset,
            "foot/right/reference/position": walk.reference.feet[1].placement.translation,
            "stabilizer/dcm_error": output.errors.dcm,
            "stabilizer/net_wrench": output.net_wrench,
            "solver/iterations": solution.iterations,
            "solver/residual/com": np.linalg.norm(solution.residuals["com"]),
            "solver/residual/posture": np.linalg.norm(solution.residuals["posture"]),
            "tick/solve": solution.timings.solve,
            "walk/step": walk.reference.step,
            "truth/base/position": truth.q[:3],
            "truth/base/orientation": truth.q[3:7],
            "truth/base/linear_velocity": truth.v[:3],
            "truth/base/angular_velocity": truth.v[3:6],
            "truth/com": truth.com,
            "truth/com_velocity": truth.com_velocity,
            "truth/dcm": (truth.com + truth.com_velocity / pendulum.omega)[:2],
            "truth/joint/torque": truth.joint_torque,
            "truth/joint/torque_ratio": truth.joint_torque / plant.description.torque_limit,
            "truth/qpos": plant.data.qpos,
            "text: step/side": walk.walk.phases.plan.steps[walk.reference.step].side,
            "text: walk/phase": walk.reference.phase.value,
            "text: walk/event": "; ".join(event.value for event in walk.reference.events) or None,
            "text: solver/status": solution.status.value,
            "text: solver/active_limits": "; ".join(solution.active_limits) or None,
        }
        for name, value in now.items():
            self.kept.setdefault(name, []).append(value if name.startswith("text") else np.array(value))


def correction(of: FootCorrection) -> list[float]:
    return [of.roll, of.pitch, of.height]


def site(plant: wbc.Plant, foot: int) -> np.ndarray:
    return plant.data.site_xpos[plant.model.site(plant.feet[foot].wrench_site).id]


def landing(walk: WalkingControl) -> list[float]:
    assert walk.reference is not None
    step = walk.walk.phases.plan.steps[walk.reference.step]
    return [step.x, step.y, step.z, step.yaw]


def test_log_holds_what_was_to_see_in_every_tick(tmp_path: Path) -> None:
    plant, walk = make_walk(velocity_ratio=0.25)  # so that limits push
    witness = Witness()
    with Recorder(tmp_path / "walk.arrow") as record:
        run(plant, walk, 1.5, record, witness)
    log = Log.open(tmp_path / "walk.arrow")
    assert len(log) == 300
    for name, values in witness.kept.items():
        if name == "truth/qpos":
            continue
        if name.startswith("text: "):
            assert log.texts(name.removeprefix("text: ")).tolist() == values, name
            assert len(set(values)) > 1 or "status" in name
            continue
        else:
            expected = np.array(values)
            scale = np.nanmax(np.abs(expected), initial=1e-3, axis=0)
            np.testing.assert_array_less(
                np.nan_to_num(np.abs(log[name] - expected)),
                np.broadcast_to(EXACT * scale, expected.shape),
                name,
            )
            assert (np.isnan(log[name]) == np.isnan(expected)).all()
    positions = ("truth/joint/position/", "truth/sole/")
    joints = [name for name in log if name.startswith(positions)]
    assert len(joints) == plant.model.nq - 7
    assert sum(name.startswith(positions[0]) for name in joints) == plant.robot.na
    final = {plant.model.joint(i).name: plant.model.joint(i).qposadr[0] for i in range(1, plant.model.njnt)}
    for prefix in positions:
        for name in (each for each in joints if each.startswith(prefix)):
            address = final.pop(name.removeprefix(prefix))
            kept = np.array(witness.kept["truth/qpos"])[:, address]
            np.testing.assert_allclose(log[name], kept, atol=EXACT)
    assert not final
    assert log.events[0] == (0.0, Event.STARTED.value)


@pytest.mark.parametrize("mode", ["position", pytest.param("torque", marks=pytest.mark.slow)])
def test_recording_changes_nothing(tmp_path: Path, mode: str) -> None:
    runs = []
    for recorded in (False, True):
        plant, walk = make_walk(mode)
        states: list[np.ndarray] = []

        def watch(plant: wbc.Plant, walk: object, m: object, command: Command, into: Any = states) -> None:
            into.append(np.concatenate([plant.data.qpos, plant.data.qvel, command.joint_torque]))

        if recorded:
            with Recorder(tmp_path / "walk.arrow") as record:
                run(plant, walk, 1.2, record, watch)
        else:
            run(plant, walk, 1.2, watch)
        runs.append(np.array(states))
    assert runs[0].shape[0] > 200
    assert (runs[0] == runs[1]).all()  # to the last bit
    assert np.ptp(runs[0], axis=0).max() > 0.1


def test_header_says_where_the_numbers_come_from() -> None:
    log = Log.open(recorded_walk())
    header = log.header
    assert header["seed"] == 3 and header["control_period"] == 0.005 and header["title"] == "a short walk"
    assert from_plain(header["spec"]) == {"gait": GAIT}
    assert {"wbc", "mujoco", "pin", "numpy", "python", "pyarrow"} <= set(header["versions"])
    assert header["robot"]["name"] == "hrp4_class"
    assert header["robot"]["torque_limit_Nm"]["left_knee_pitch"] > 0.0
    assert log.time[-1] == pytest.approx(SECONDS - 0.005)
    assert (log["own/answer"] == 42.0).all() and log.units["own/answer"] == "m"


def test_every_number_has_a_unit_and_every_signal_a_meaning() -> None:
    known = {"1", "s", "1/s", "m", "m/s", "m/s²", "rad", "rad/s", "N", "Nm", "Nm/rad"}
    signals = Log.open(recorded_walk()).signals
    for name, signal in signals.items():
        assert signal.about, name
        if not name.startswith("solver/residual"):
            assert signal.unit in known, name
    for task, unit in {"com": "m/s²", "posture": "rad/s²", "left_foot swing": "m/s²|rad/s²"}.items():
        assert signals[f"solver/residual/{task}"].unit == unit


@pytest.mark.parametrize("torque", [False, True])
@pytest.mark.parametrize("with_plant", [False, True])
def test_controllers_that_do_not_walk_are_recorded_too(
    tmp_path: Path, torque: bool, with_plant: bool
) -> None:
    log = recorded_stand(
        tmp_path / "stand.arrow",
        ticks=20,
        control=wbc.TorqueControl if torque else wbc.PositionControl,
        shown=lambda plant: plant if with_plant else None,
        control_period=0.002,
    )
    assert len(log) == 20 and log.events == []
    assert ("truth/com/x" in log) is with_plant
    assert ("base/commanded/position/x" in log) is not torque
    assert np.isnan(log["joint/position_reference"]).all() == torque
    assert np.isfinite(log["foot/left/wrench_solved/fz"]).all()
    assert (log["com/estimated/z"] > 0.5).all()


def test_tasks_that_come_and_go_leave_right_numbers_and_gaps(tmp_path: Path) -> None:
    plant = wbc.Plant(wbc.load_robot("hrp4_class"), control_period=0.002)
    controller = balance_controller(plant.description.robot(), 0.002)
    control = wbc.TorqueControl(controller)
    solved: list[Solution] = []
    with Recorder(tmp_path / "stand.arrow") as record:
        for i in range(10):
            if i == 4:
                controller.add(wbc.PositionTask(plant.robot.torso_frame, name="late", weight=0.1))
            if i == 7:
                controller.remove(controller.task("posture"))
            measurement = plant.measure()
            command = control.command(measurement)
            record(plant, control, measurement, command)
            plant.step(command)
            assert control.solution is not None
            solved.append(control.solution)
    log = Log.open(tmp_path / "stand.arrow")
    norms = [np.linalg.norm(solution.residuals["com"]) for solution in solved]
    assert log["solver/residual/com"] == pytest.approx(norms)
    forces = [solution.wrenches["left_foot"][2] for solution in solved]
    assert log["foot/left/wrench_solved/fz"] == pytest.approx(forces)
    assert np.isfinite(log["solver/residual/posture"]).tolist() == [True] * 7 + [False] * 3
    assert set(log.texts("solver/status")) == {"solved"}
    assert np.isfinite(log["com/estimated"]).all()


def record_standing(path: Path, ticks: int, *signals: Any, **options: Any) -> Log:
    plant = wbc.Plant(wbc.load_robot("hrp4_class"))
    control = wbc.PositionControl(balance_controller(plant.description.robot(), plant.control_period))
    measurement, command = plant.measure(), plant.hold()
    with Recorder(path) as record:
        record.add(*signals, **options)
        for _ in range(ticks):
            record(plant, control, measurement, command)
    return Log.open(path)


def test_own_signals_of_every_kind(tmp_path: Path) -> None:
    path = tmp_path / "own.arrow"
    count = iter(range(100))
    assert record_standing(path, 3, "own/count", lambda: next(count), "Nm")["own/count"].tolist() == [0, 1, 2]
    array = record_standing(path, 2, "own/place", lambda: np.array([1.0, 2.0, 3.0]), unit="m")
    assert array.parts("own/place") == ["own/place/x", "own/place/y", "own/place/z"]
    assert array["own/place"].tolist() == [[1.0, 2.0, 3.0]] * 2 and array.units["own/place/y"] == "m"
    assert record_standing(path, 1, "a", lambda: [1, 2, 3, 4]).parts("a") == ["a/0", "a/1", "a/2", "a/3"]
    assert record_standing(path, 2, "on", lambda: True)["on"].tolist() == [1.0, 1.0]
    states = iter(["calm", None, "calm"])
    assert record_standing(path, 3, "state", lambda: next(states)).texts("state").tolist() == [
        "calm",
        None,
        "calm",
    ]
    log = record_standing(path, 2, "own/height", lambda tick: tick.plant.truth().com[2], "m")
    assert log["own/height"] == pytest.approx(log["truth/com/z"])


@pytest.mark.parametrize(
    ("signal", "words"),
    [
        (("com/estimated/x", lambda: 1.0), "there is a signal 'com/estimated/x' already"),
        (("a//b", lambda: 1.0), "parts separated by '/'"),
        (("com/estimated", lambda: 1.0), "there is a group 'com/estimated' already"),
        (("time/own", lambda: 1.0), "there is a signal 'time' already"),
        (("a", 3.0), "needs a function that gives its value"),
        (("a", lambda: slice(0)), "cannot keep"),
        (("a", lambda: np.zeros((2, 2))), "one dimension"),
    ],
)
def test_own_signals_that_cannot_be_kept_say_so(tmp_path: Path, signal: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        record_standing(tmp_path / "own.arrow", 1, *signal)


def test_own_signal_must_keep_its_length_and_come_in_time(tmp_path: Path) -> None:
    lengths = iter([2, 2, 1])
    with pytest.raises(InputError, match=r"'a' has changed from shape \(2,\) to \(1,\)"):
        record_standing(tmp_path / "own.arrow", 3, "a", lambda: np.zeros(next(lengths)))
    assert len(Log.open(tmp_path / "own.arrow")) == 2  # what was recorded before is there
    plant = wbc.Plant(wbc.load_robot("hrp4_class"))
    control = wbc.PositionControl(balance_controller(plant.description.robot(), plant.control_period))
    with Recorder(tmp_path / "own.arrow") as record:
        record.add("a", lambda: 1.0)
        with pytest.raises(InputError, match="'a' already"):
            record.add("a", lambda: 1.0)
        record(plant, control, plant.measure(), plant.hold())
        with pytest.raises(InputError, match="too late"):
            record.add("b", lambda: 1.0)


def test_own_signals_of_functions_with_defaults_and_of_c(tmp_path: Path) -> None:
    with_default = record_standing(tmp_path / "one.arrow", 2, "a", lambda i=7: float(i))
    assert with_default["a"].tolist() == [7.0, 7.0]
    assert record_standing(tmp_path / "two.arrow", 2, "a", time.time)["a"][0] > 1e9


def test_a_recording_that_has_ended_takes_no_more(tmp_path: Path) -> None:
    plant = wbc.Plant(wbc.load_robot("hrp4_class"))
    control = wbc.PositionControl(balance_controller(plant.description.robot(), plant.control_period))
    with Recorder(tmp_path / "own.arrow") as record:
        record(plant, control, plant.measure(), plant.hold())
    with pytest.raises(InputError, match=r"own.arrow has ended; make another Recorder"):
        record(plant, control, plant.measure(), plant.hold())
    spec = WalkSpec(terrain="flat", plan=WalkPlan(distance=0.3))
    with pytest.raises(InputError, match="has ended"):
        walk(spec, hooks=[record])


def test_two_recordings_of_one_name_are_refused(tmp_path: Path) -> None:
    with (
        Recorder(tmp_path / "own.arrow"),
        pytest.raises(InputError, match=r"own.part.arrow is being written already"),
    ):
        Recorder(tmp_path / "own.arrow")
    Recorder(tmp_path / "own.arrow").close()


def test_run_that_breaks_off_leaves_its_log(tmp_path: Path) -> None:
    plant, walk = make_walk()
    with pytest.raises(ZeroDivisionError), Recorder(tmp_path / "walk.arrow") as record:
        run(plant, walk, 0.1, record)
        _ = 1 / 0
    log = Log.open(tmp_path / "walk.arrow")
    assert len(log) == 20 and log.broken is None


def test_what_soles_have_seen_and_decided_is_recorded_once_a_step() -> None:
    path, steps = recorded_scans()
    log = Log.open(path)
    sides = log.texts("stiffness/side")
    landed = [i for i, side in enumerate(sides) if side is not None]
    assert len(landed) == len(steps) >= 2
    seen = 0
    for i, step in zip(landed, steps, strict=True):
        assert sides[i] == step.side and log["stiffness/commanded"][i] == pytest.approx(step.commanded)
        assert log["stiffness/actual"][i] == pytest.approx(step.actual)
        assert log.texts("stiffness/fallback")[i] == step.fallback
        if step.profile is None:
            assert log.lists("stiffness/scan/x")[i] is None
            continue
        seen += 1
        np.testing.assert_allclose(log.lists("stiffness/scan/x")[i], step.profile.x, atol=1e-6)
        np.testing.assert_allclose(log.lists("stiffness/scan/z")[i], step.profile.z, atol=1e-6)
        np.testing.assert_allclose(log.lists("stiffness/scan/lateral")[i], step.profile.lateral, atol=1e-6)
        if step.decision is not None:
            assert log["stiffness/cluster"][i] == 2.0
            assert json.loads(log.texts("stiffness/features")[i]) == dict(step.decision.features)
    assert seen >= 2
    others = np.setdiff1d(np.arange(len(log)), landed)
    assert np.isnan(log["stiffness/commanded"][others]).all()
    commanded = log["foot/left/stiffness_command"]
    assert np.ptp(commanded[np.isfinite(commanded)]) + np.ptp(log["foot/right/stiffness"]) > 1.0
    assert np.isfinite(log["foot/left/range"]).mean() > 0.5
    figure = draw("stiffness", [log])
    lines = [line.get_ydata() for line in figure.axes[2].get_lines()]
    assert any(
        np.array_equal(line, 1e3 * z)
        for z in log.lists("stiffness/scan/z")
        if z is not None
        for line in lines
    )


def test_refused_measurement_leaves_a_gap(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    plant, walk = make_walk()
    good = plant.measure()
    bad = Measurement(
        good.time,
        np.full_like(good.joint_position, np.nan),
        good.joint_velocity,
        good.angular_velocity,
        good.specific_force,
        good.sole_wrench,
    )
    with caplog.at_level(logging.CRITICAL), Recorder(tmp_path / "walk.arrow") as record:
        record(plant, walk, bad, walk.command(bad))
        record(plant, walk, good, walk.command(good))
    log = Log.open(tmp_path / "walk.arrow")
    assert np.isnan(log["joint/position"]).all(axis=1).tolist() == [True, False]
    assert np.isnan(log["com/reference/x"]).tolist() == [True, False]
    assert log.texts("walk/phase")[0] is None and log.texts("walk/phase")[1] is not None
    assert log["solver/failures"].tolist() == [1.0, 1.0]


def test_plain_values_come_back() -> None:
    things = [
        *(foot(name) for name in foot_names()),
        *(terrain(name, seed=4) for name in terrain_families() if name != "image"),
        terrain("image", source=np.outer(np.arange(4.0), np.arange(5.0)), metres_per_pixel=0.1),
        GAIT,
        Path("a/b"),
        Event.STARTED,
        (1, 2.5, "x", None, True, [float("inf")]),
        {"a": {"b": b"bytes"}},
    ]
    for thing in things:
        assert from_plain(to_plain(thing)) == thing
    array = np.arange(6, dtype=np.float32).reshape(2, 3)
    back = from_plain(to_plain(array))
    assert back.dtype == array.dtype and (back == array).all()
    for name in ("hrp4_class", "talos"):
        robot = wbc.load_robot(name)
        again = from_plain(to_plain(robot))
        assert again.urdf == robot.urdf and again.half_sitting == robot.half_sitting
        assert (again.kp == robot.kp).all() and again.soles == robot.soles


def test_classes_are_written_without_their_modules() -> None:
    plain = to_plain(foot("soft"))
    assert plain["$class"] == "wbc:SoftFoot" and plain["contact"]["$class"] == "wbc:ContactSpheres"
    assert to_plain(Event.STARTED) == {"$enum": "wbc:Event", "name": "STARTED"}


@pytest.mark.parametrize(
    ("plain", "words"),
    [
        ({"$class": "somewhere.else:Thing"}, "import somewhere.else first"),
        ({"$class": "wbc:SoftFeet"}, "no class of wbc .*did you mean 'SoftFoot'"),
        ({"$class": "wbc:Plant"}, "no class of wbc"),
        ({"$class": "subprocess:Popen", "args": "true"}, "cannot be made|only the text"),
        ({"$class": "wbc.feet.soles.soft:SoftFoot", "stiffness": -1.0}, "stiffness"),
        ({"$text": "<object>"}, "only the text"),
    ],
)
def test_plain_values_that_cannot_be_trusted_are_refused(plain: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        from_plain(plain)
