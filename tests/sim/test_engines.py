"""Loops of one's own in trials: other physics engines, models of one's own, by name and over processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from in_air import InAir

import wbc
from wbc.base.errors import InputError
from wbc.core.robot import GRAVITY
from wbc.core.signals import Command
from wbc.sim import (
    EngineContacts,
    EngineLoop,
    EnginePush,
    Machine,
    MujocoLoop,
    WalkPlan,
    WalkSpec,
    register_loop,
    stand,
)
from wbc.sim.balance.standing import StandSpec, StandTrial
from wbc.sim.studies import Journal, sweep
from wbc.sim.studies.outcomes import trial_from_json
from wbc.sim.trial.loops import LOOPS, trial_loop

OWN_MODEL = '''
import mujoco
import wbc
from wbc.sim import MujocoLoop

def of_ones_own(description, *, control_period, timestep, noise, seed, machine):
    """A MuJoCo model of one's own: the plant's, taken as it is."""
    plant = wbc.Plant(description, timestep=timestep, control_period=control_period)
    return MujocoLoop(
        description, plant.model, control_period=control_period, noise=noise, seed=seed, machine=machine
    )
no_loop = 7
def too_few(description, *, control_period): ...
def hollow(description, *, control_period, timestep, noise, seed, machine):
    return object()
'''


def limp(loop: EngineLoop) -> Command:
    return Command(np.zeros(loop.robot.na))


@pytest.fixture
def file(tmp_path: Path) -> str:
    path = tmp_path / "theirs.py"
    path.write_text(OWN_MODEL, encoding="utf-8")
    return str(path)


def test_sensors_of_another_engine_are_what_a_falling_robot_feels() -> None:
    loop = InAir("hrp4_class")
    assert loop.measure().specific_force == pytest.approx([0.0, 0.0, GRAVITY])  # it is said to stand
    half = [0.0, 0.0, 0.5 * loop.robot.mass * GRAVITY, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(loop.measure().sole_wrench, [half, half])
    aloft = loop.truth().q.copy()
    aloft[2] += 0.1
    loop.reset(aloft)
    assert not loop.measure().sole_wrench.any()
    loop.reset()
    height = loop.com_height
    for _ in range(10):
        loop.step(loop.hold())
    measured, truth = loop.measure(), loop.truth()
    assert measured.time == pytest.approx(0.02) and not measured.wrenches.any()
    assert np.linalg.norm(measured.specific_force) < 0.1 and np.linalg.norm(measured.angular_velocity) < 0.1
    assert truth.com_velocity == pytest.approx([0.0, 0.0, -GRAVITY * 0.02], abs=1e-6)
    assert height - loop.com_height == pytest.approx(0.5 * GRAVITY * 0.02 * 0.021, rel=1e-3)
    robot = loop.robot.clone()
    robot.update(truth.q, truth.v)
    for side, sole in enumerate(robot.soles):
        centre, rotation = loop.sole_pose(side)
        place = robot.placement(sole.frame)
        np.testing.assert_allclose(centre, place.translation, atol=1e-12)
        np.testing.assert_allclose(rotation, place.rotation, atol=1e-12)


class Touched(InAir):
    """A robot that is touched by made-up contacts, which do not move it."""

    touches: Any = ([], [], [])

    def contacts(self) -> EngineContacts:
        return EngineContacts(*self.touches)


def test_wrenches_of_another_engine_are_those_of_its_contacts_about_each_sole() -> None:
    """Points and forces in the world, of left sole, right sole and neither: as Pinocchio moves a force to a frame."""
    loop, rng = Touched("hrp4_class", timestep=0.001, control_period=0.001), np.random.default_rng(0)
    q = loop.on_ground(loop.robot.half_sitting)
    q[3:7] = pin.Quaternion(pin.exp3(np.array([0.2, -0.3, 0.8]))).coeffs()
    loop.reset(q)
    soles = np.array([0, 1, -1, 0, 1, 1])
    points, forces = rng.normal(size=(6, 3)), 100.0 * rng.normal(size=(6, 3))
    loop.touches = points, forces, soles
    loop.step(limp(loop))
    robot, truth = loop.robot.clone(), loop.truth()
    robot.update(truth.q, truth.v)
    for side, sole in enumerate(robot.soles):
        mine = soles == side
        about = pin.Force(forces[mine].sum(axis=0), np.cross(points[mine], forces[mine]).sum(axis=0))
        expected = robot.placement(sole.frame).actInv(about).vector
        np.testing.assert_allclose(truth.sole_wrench[side], expected, atol=1e-9)
        np.testing.assert_allclose(loop.measure().sole_wrench[side], expected, atol=1e-9)
    np.testing.assert_allclose(truth.other_force, forces[2])
    np.testing.assert_array_equal(truth.contact_position, points)
    slow = Touched("hrp4_class", timestep=0.001, control_period=0.004)
    slow.touches = points[:1], forces[:1], soles[:1]
    slow.step(limp(slow))
    found = []
    one = Touched("hrp4_class", timestep=0.001, control_period=0.001)
    one.touches = slow.touches
    for _ in range(4):
        one.step(limp(one))
        found.append(one.measure().sole_wrench)
    np.testing.assert_allclose(slow.measure().sole_wrench, np.mean(found, axis=0), atol=1e-9)


@pytest.mark.parametrize("periods", [1, 3])
def test_an_imu_of_another_engine_feels_what_the_body_that_carries_it_does(periods: int) -> None:
    """A robot that tumbles: the acceleration of its IMU less gravity, and its rates, in the axes of the IMU."""
    loop = InAir("hrp4_class", timestep=0.0005, control_period=0.001)
    rng = np.random.default_rng(2)
    robot, v = loop.robot.clone(), rng.normal(size=loop.robot.nv)
    q = robot.half_sitting.copy()
    q[3:7] = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
    loop.reset(q)
    loop._state = q.copy(), v
    for _ in range(periods + 1):  # the first period has begun at rest
        loop.step(limp(loop))
    measured, (q, v) = loop.measure(), loop.state()
    data, model = robot.model.createData(), robot.model
    a = pin.aba(model, data, q, v, np.zeros(robot.nv))
    pin.forwardKinematics(model, data, q, v, a)
    imu = robot.frame_id(robot.imu_frame)
    place = pin.updateFramePlacement(model, data, imu)
    acceleration = pin.getFrameClassicalAcceleration(model, data, imu, pin.LOCAL).linear
    felt = acceleration + place.rotation.T @ [0.0, 0.0, GRAVITY]
    np.testing.assert_allclose(
        measured.angular_velocity, pin.getFrameVelocity(model, data, imu, pin.LOCAL).angular, atol=1e-9
    )
    assert np.abs(felt).max() > 0.3  # it is off the centre of mass
    np.testing.assert_allclose(measured.specific_force, felt, atol=0.05 * np.linalg.norm(felt) + 0.05)
    np.testing.assert_allclose(measured.joint_velocity, v[6:], atol=1e-12)


def test_another_engine_keeps_torques_within_limits_and_has_the_sensors_and_errors_of_its_machine() -> None:
    one = InAir("hrp4_class", noise="realistic", seed=3, machine=Machine(force_sensors=False))
    off = np.abs(one.measure().joint_position - one.joint_position)
    assert 0.0 < off.max() < 0.01 and one.measure().sole_wrench is None and one.measure().joint_torque is None
    one.step(Command(np.full(one.robot.na, 1e5)))
    np.testing.assert_allclose(one.joint_torque, one.robot.torque_upper)


@pytest.mark.parametrize("gains", [(), ("kp",), ("kp", "kd")])
@pytest.mark.parametrize("references", [(), ("joint_position",), ("joint_position", "joint_velocity")])
def test_drives_of_another_engine_take_the_gains_of_a_command(
    gains: tuple[str, ...], references: tuple[str, ...]
) -> None:
    """It is kp (q_ref − q) + kd (q̇_ref − q̇) + τ; without a reference of the position gains are refused."""
    loop, rng = InAir("hrp4_class", control_period=0.001), np.random.default_rng(5)
    q, v = loop.state()
    loop._state = q, rng.uniform(-0.5, 0.5, loop.robot.nv)
    loop.step(limp(loop))
    q, v, na = loop.joint_position.copy(), loop.joint_velocity.copy(), loop.robot.na
    values: dict[str, Any] = {name: rng.uniform(0.5, 2.0, na) for name in gains}
    values |= {name: rng.normal(0.0, 0.1, na) for name in references}
    torque = rng.normal(size=na)
    if gains and not references:
        with pytest.raises(InputError, match="needs a position reference"):
            loop.step(Command(torque, **values))
        return
    loop.step(Command(torque, **values))
    kp = values.get("kp", np.array(loop.description.kp)) if references else 0.0
    kd = values.get("kd", np.array(loop.description.kd)) if references else 0.0
    law = torque + kp * (values.get("joint_position", q) - q) + kd * (values.get("joint_velocity", 0.0) - v)
    law = np.clip(law, loop.robot.torque_lower, loop.robot.torque_upper)
    np.testing.assert_allclose(loop.joint_torque, law, atol=1e-12)


def test_what_another_engine_cannot_take_is_refused_and_a_divergence_is_named() -> None:
    own = wbc.Plant("hrp4_class", visuals=False).model
    for machine in (Machine(friction=1.0), Machine(payload=1.0), Machine(hand_sensors=True)):
        with pytest.raises(InputError):
            MujocoLoop("hrp4_class", own, control_period=0.005, machine=machine)
        with pytest.raises(InputError, match="leave friction, payload and hand_sensors"):
            InAir("g1", machine=machine)
    with pytest.raises(InputError, match="two feet"):
        InAir("go1")
    loop = InAir("hrp4_class")
    with pytest.raises(InputError, match="body"):
        loop.push("nose", [1.0, 0.0, 0.0], 0.1)
    assert loop.time == 0.0
    loop._state = loop.truth().q * np.nan, loop.truth().v
    loop.step(limp(loop))
    assert loop.diverged is not None


def returning(change: Callable[[InAir, np.ndarray, np.ndarray], Any]) -> type[InAir]:
    """Make an engine that returns a changed state."""

    class Changed(InAir):
        def state(self) -> Any:
            return change(self, *super().state())

    return Changed


class Careless(InAir):
    """Returns lists and arrays that it goes on using, and writes into what it gets."""

    held: tuple[np.ndarray, np.ndarray] | None = None

    def place(self, q: np.ndarray) -> None:
        super().place(q.copy())
        q[:], self.points = np.nan, np.zeros((1, 3))

    def state(self) -> Any:
        q, v = super().state()
        if self.held is None:
            self.held = q.copy(), v.copy()
        self.held[0][:], self.held[1][:] = q, v
        return self.held[0], v.tolist()

    def advance(self, torque: np.ndarray, pushes: Sequence[EnginePush]) -> None:
        super().advance(torque, pushes)
        torque[:] = np.nan
        self.points += 1.0

    def contacts(self) -> EngineContacts:
        return EngineContacts(self.points, [[0.0, 0.0, 1.0]], [-1])


def test_an_engine_may_return_lists_and_go_on_with_its_arrays() -> None:
    loops, truths = (InAir("hrp4_class"), Careless("hrp4_class")), []
    for loop in loops:
        for _ in range(3):
            loop.step(Command(np.zeros(loop.robot.na), 1.01 * loop.hold().joint_position))
            truths.append((loop.truth(), loop.measure()))
    for (one, read), (other, again) in zip(truths[:3], truths[3:], strict=True):
        for name in ("q", "v", "joint_torque", "com"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        np.testing.assert_array_equal(read.specific_force, again.specific_force)
    assert [truth.contact_position[0, 0] for truth, _ in truths[3:]] == [2.0, 4.0, 6.0]


def moved(q: np.ndarray, index: int, by: float) -> np.ndarray:
    return q + by * (np.arange(q.size) == index)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda loop, q, v: (np.r_[q[:3] + loop.robot.model.inertias[1].lever, q[3:]], v),
            "[xyz] is .* not its centre of mass",
        ),
        (lambda loop, q, v: (np.concatenate([q[:7], q[:6:-1]]), v), "joints are in the robot's order"),
        (lambda loop, q, v: (q[7:], v[6:]), r"shapes \(41,\) and \(40,\)"),
        (lambda loop, q, v: (moved(q, 1, 1e-3), v), r"Changed\.state .* y is 0\.001"),
        (lambda loop, q, v: (moved(q, 9, 1.1e-4), v), "joint|instead of"),
        (lambda loop, q, v: (moved(q, 9, -1.1e-4), v), "joint|instead of"),
        (lambda loop, q, v: (q, moved(v, 4, -1.1e-4)), r"largest velocity is 0\.00011"),
    ],
)
def test_an_engine_that_returns_another_state_than_it_was_put_into_is_refused(
    change: Any, message: str
) -> None:
    """From a tenth of a millimetre on, in m and rad, and their speeds alike."""
    with pytest.raises(InputError, match=message):
        returning(change)("hrp4_class")


def test_an_engine_may_be_off_by_rounding_and_have_the_quaternion_of_its_base_with_either_sign() -> None:
    """Both are the same rotation."""
    returning(lambda loop, q, v: (np.r_[q[:3], -q[3:7], q[7:]], v))("hrp4_class")
    returning(lambda loop, q, v: (moved(q, 9, 9e-5), moved(v, 4, -9e-5)))("hrp4_class")


ROWS, COLUMNS, LEFT = np.ones((6, 3)), np.ones((3, 6)), np.zeros(6, int)
BAD_CONTACTS: list[tuple[tuple[Any, Any, Any], str]] = [
    (([], [[0.0, 0.0, 100.0]], [0]), r"got \(0,\), \(1, 3\), \(1,\)"),
    ((COLUMNS, ROWS, LEFT), r"\(n, 3\), \(n, 3\) and \(n,\), got \(3, 6\)"),
    ((ROWS, COLUMNS, LEFT), r"got \(6, 3\), \(3, 6\)"),
    ((ROWS, ROWS, LEFT.reshape(3, 2)), r"got .*\(3, 2\)"),
    ((ROWS[:2], ROWS[:2], [1, 2]), r"0 for the left sole, 1 for the right one .* got \["),
    ((ROWS[:2], ROWS[:2], [0, -2]), r"0 for the left sole, 1 for the right one .* got \["),
]
"""Contacts without all parts, of other shapes, and of soles that the robot has not."""


@pytest.mark.parametrize(("touches", "message"), BAD_CONTACTS)
def test_contacts_that_are_none_are_refused(touches: tuple[Any, Any, Any], message: str) -> None:
    loop = Touched("hrp4_class")
    loop.touches = touches
    with pytest.raises(InputError, match=message):
        loop.step(limp(loop))


def test_a_stand_in_a_model_of_ones_own_is_that_in_the_plant(file: str) -> None:
    spec = StandSpec(robot="hrp4_class", mode="torque", seconds=0.1)
    theirs = StandSpec(robot="hrp4_class", mode="torque", seconds=0.1, loop=f"{file}:of_ones_own")
    assert StandSpec.from_json(theirs.to_json()) == theirs != spec
    here, there = stand(spec), stand(theirs)
    assert there.upright and there.failures == 0
    assert there.com_error == pytest.approx(here.com_error, abs=1e-4)


def test_a_loop_is_named_by_its_file_with_what_is_in_it(file: str) -> None:
    spec = WalkSpec(robot="hrp4_class", loop=f"{file}:of_ones_own")
    assert spec.loop.startswith(f"{file}:of_ones_own#")
    Path(file).write_text(OWN_MODEL + "\n# other\n", encoding="utf-8")
    with pytest.raises(InputError, match="has changed"):
        WalkSpec.from_json(spec.to_json())
    assert WalkSpec(robot="hrp4_class", loop=f"{file}:of_ones_own") != spec


BAD: dict[str, Callable[[str], object]] = {
    "no loop 'bullet'": lambda file: StandSpec(loop="bullet"),
    "no loop ''": lambda file: StandSpec(loop=""),
    "gone.py": lambda file: StandSpec(loop="gone.py:Loop"),
    "of_ones_own": lambda file: StandSpec(loop=f"{file}:other"),
    "got 7": lambda file: StandSpec(loop=f"{file}:no_loop"),
    "takes no timestep, noise, seed, machine": lambda file: StandSpec(loop=f"{file}:too_few"),
    "lacks base_pose": lambda file: stand(seconds=0.1, loop=f"{file}:hollow"),
    "no option 'foot'": lambda file: StandSpec(foot="soft", loop=f"{file}:of_ones_own"),
    "no option 'terrain'": lambda file: WalkSpec(terrain="stones", loop=f"{file}:of_ones_own"),
    "no option 'scene'": lambda file: WalkSpec(scene="table", loop=f"{file}:of_ones_own"),
    "no option 'eyes'": lambda file: WalkSpec(eyes="depth", loop=f"{file}:of_ones_own"),
    "no option 'physics'": lambda file: WalkSpec(
        changes={"physics.impratio": 5.0}, loop=f"{file}:of_ones_own"
    ),
    "payload of the machine can be set in a wbc.Plant alone": lambda file: StandSpec(
        machine=Machine(payload=2.0), loop=f"{file}:of_ones_own"
    ),
    "no loop 'none'": lambda file: trial_from_json(
        {"kind": "stand_push_limit", "seconds": 1.0, "push": {"direction": 0.0}, "loop": "none"}
    ),
    "registered already": lambda file: register_loop("plant", InAir),
    "must be text": lambda file: register_loop(" ", InAir),
    "factory": lambda file: register_loop("other", 7),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("message", BAD)
def test_a_loop_that_is_none_is_refused_before_anything_runs(message: str, file: str) -> None:
    with pytest.raises(InputError, match=message):
        BAD[message](file)


def test_a_file_that_cannot_be_run_is_named(tmp_path: Path) -> None:
    path = tmp_path / "broken.py"
    path.write_text("import no_such_module\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"broken\.py cannot be run: ModuleNotFoundError"):
        trial_loop(f"{path}:Loop")


def test_a_loop_that_advances_by_another_period_is_refused_with_both() -> None:
    register_loop("slower", lambda description, **options: InAir(description, control_period=0.004))
    try:
        with pytest.raises(InputError, match="period of 2 ms .* has 4 ms"):
            stand(loop="slower", mode="torque")
    finally:
        del LOOPS["slower"]


def test_an_engine_diverges_at_ten_thousand_and_stands_up_to_a_millimetre_above_the_ground() -> None:
    """Speeds in m/s and rad/s alike."""
    loop = InAir("hrp4_class", control_period=0.001)
    for speed, diverged in ((9.9e3, False), (1.01e4, True), (-1.01e4, True)):
        loop.reset()
        q, v = loop.state()
        loop.advance = lambda torque, pushes, v=v, q=q, to=speed: setattr(  # type: ignore[method-assign, misc]
            loop, "_state", (q, np.where(np.arange(len(v)) == 2, to, 0.0))
        )
        loop.step(limp(loop))
        assert (loop.diverged is not None) == diverged
    loop = InAir("hrp4_class")
    low = loop.truth().q
    for height, stands in ((9e-4, True), (1.1e-3, False)):
        loop.reset(moved(low, 2, height))
        assert bool(loop.measure().wrenches.any()) == stands


def test_a_push_of_another_engine_acts_at_the_centre_of_mass_of_its_link_or_where_it_is_told() -> None:
    """Momentum and angular momentum about the centre of mass of all: F t, and (p − c) × F t, gravity aside."""
    for point in (None, [0.1, -0.2, 0.3]):
        loop = InAir("hrp4_class", timestep=0.001, control_period=0.002)
        robot, data = loop.robot, loop.robot.model.createData()
        force, start = np.array([30.0, -20.0, 10.0]), loop.truth().q
        loop.push("torso", force, 1.0, point)
        loop.step(limp(loop))
        q, v = loop.state()
        momentum = pin.computeCentroidalMomentum(robot.model, data, q, v)
        gravity = np.array([0.0, 0.0, -robot.mass * GRAVITY])
        assert momentum.linear == pytest.approx(0.002 * (force + gravity), rel=1e-3)
        pin.framesForwardKinematics(robot.model, data, start)
        frame = robot.frame_id(robot.torso_frame)
        link = data.oMf[frame]
        lever = robot.model.inertias[robot.model.frames[frame].parentJoint].lever
        place = (
            data.oMi[robot.model.frames[frame].parentJoint].act(lever)
            if point is None
            else link.act(np.array(point))
        )
        about = np.cross(place - pin.centerOfMass(robot.model, data, start), 0.002 * force)
        assert momentum.angular == pytest.approx(about, rel=1e-3, abs=1e-5)
        assert loop.base_pose == tuple(q[:7].tolist())
        assert np.array_equal(loop.joint_position, q[7:]) and np.array_equal(loop.joint_velocity, v[6:])


def test_a_registered_loop_is_found_by_its_name() -> None:
    register_loop("in the air", InAir)
    try:
        trial = StandTrial(StandSpec(mode="torque", loop="in the air"))
        with trial.running():
            trial.advance(0.02)
        assert isinstance(trial.plant, InAir) and trial.plant.time == pytest.approx(0.02)
    finally:
        del LOOPS["in the air"]


@pytest.mark.slow
def test_a_loop_in_a_file_goes_over_processes(file: str, tmp_path: Path) -> None:
    plan = WalkPlan(distance=0.145)
    specs = [WalkSpec(plan=plan, noise="none", seed=k, loop=f"{file}:of_ones_own") for k in (1, 2)]
    with Journal(tmp_path / "journal.jsonl") as journal:
        summary = sweep(specs, journal, workers=2)
        assert summary.counts == {"done": 2}, [entry.error for entry in journal.entries.values()]


@pytest.mark.slow
def test_the_robot_stands_takes_a_push_and_steps_in_another_engine() -> None:
    pytest.importorskip("dartpy")
    place = Path(__file__).parents[2] / "examples" / "other_engine.py"
    loop = trial_loop(f"{place}:DartLoop").make(
        wbc.load_robot("g1"), control_period=0.002, timestep=0.001, noise="none", seed=0, machine=Machine()
    )
    control = wbc.TorqueControl(wbc.balance_controller(loop.robot.clone(), loop.control_period))
    start = loop.truth().com
    for tick in range(750):  # stands, and takes a push that needs no step
        if tick == 250:
            loop.push("torso", [0.2 * loop.robot.mass / 0.1, 0.0, 0.0], 0.1)
        loop.step(control.command(loop.measure()))
    assert control.failures == 0 and np.linalg.norm(loop.truth().com - start) < 0.05
    weight = loop.robot.mass * GRAVITY
    assert loop.measure().wrenches[:, 2].sum() == pytest.approx(weight, rel=0.2)
    result = wbc.walk(
        robot="g1", mode="torque", distance=0.5, noise="realistic", seed=5, loop=f"{place}:DartLoop"
    )
    assert result.outcome == "completed" and result.steps_done > 3 and result.failures == 0
