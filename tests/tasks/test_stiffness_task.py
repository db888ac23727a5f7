"""The stiffness task: timing, policies, actuator, fallbacks and records, along synthetic swings over known ground."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.lib.stride_tricks import sliding_window_view
from properties import examples

from wbc.base.errors import InputError, WbcError
from wbc.core.frames import Sole
from wbc.core.robot import Robot
from wbc.core.signals import Measurement
from wbc.feet import StiffnessActuator
from wbc.feet.sensing.roughness import roughness
from wbc.feet.sensing.scan import PROFILE_STEP
from wbc.feet.soles.actuator import StiffnessState
from wbc.feet.soles.soft import VariableStiffnessFoot, toe_sensor
from wbc.feet.stiffness.model import ModelSettings, ProfileRecipe, StiffnessModel
from wbc.robots import load
from wbc.sim.terrain.spec import Terrain, terrain
from wbc.tasks.scheduling.policies import FixedPolicy, GroundPolicy, ModelPolicy, SwingScan
from wbc.tasks.scheduling.stiffness import StepStiffness, StiffnessScheduler, StiffnessTiming
from wbc.walking import WalkingControl

DT = 0.005
WINDOW = ProfileRecipe().window
assert WINDOW is not None
SINGLE, DOUBLE = 0.8, 0.3
FOOT = VariableStiffnessFoot(stiffness=5.0)
QUICK = VariableStiffnessFoot(stiffness=5.0, actuator=StiffnessActuator.instantaneous())


def floating_feet() -> Robot:
    """A base whose left sole is the base itself, the right sole beside it: moving the base moves the swing foot."""
    model = pin.Model()
    model.name = "feet"
    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.appendBodyToJoint(root, pin.Inertia.Random(), pin.SE3.Identity())
    model.addFrame(pin.Frame("body", root, 0, pin.SE3.Identity(), pin.FrameType.BODY))
    model.addFrame(pin.Frame("left_sole", root, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    side = pin.SE3(np.eye(3), np.array([0.0, -0.15, 0.0]))
    model.addFrame(pin.Frame("right_sole", root, 0, side, pin.FrameType.OP_FRAME))
    joint = model.addJoint(root, pin.JointModelRX(), pin.SE3.Identity(), "dummy")
    model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    q = pin.neutral(model)
    soles = [
        Sole(f"{side}_sole", f"{side}_sole", name=f"{side}_foot", length=0.278, width=0.1045)
        for side in ("left", "right")
    ]
    return Robot(model, soles, q)


ROBOT = floating_feet()
TOE = toe_sensor(FOOT)


class Rig:
    """Swings a foot over a ground, tick by tick, with the range that a sensor under the toe would read."""

    def __init__(
        self,
        task: StiffnessScheduler,
        ground: Terrain | None = None,
        *,
        tamper: Callable[[float, float], float] = lambda progress, reading: reading,
        yaw: float = 0.0,
    ) -> None:
        self.task, self.ground, self.tamper, self.yaw = task, ground, tamper, yaw
        self.time, self.x = 0.0, 0.4
        self.landing: np.ndarray | None = None
        self.states = [task.actuator.at_rest(float(k)) for k in task.command]
        self.commands: list[np.ndarray] = []
        self.readings: list[float] = []

    def height(self, x: float, y: float) -> float:
        if self.ground is None:
            return 0.0
        # The ground is turned with the walk, so that every direction of travel sees the same.
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return float(self.ground.height(c * x + s * y, c * y - s * x))

    def tick(self, swing: str | None, progress: float, time_left: float, place: np.ndarray) -> None:
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        turn = pin.Quaternion(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
        q = np.array(ROBOT.half_sitting)
        q[:3], q[3:7] = turn.toRotationMatrix() @ place, turn.coeffs()
        ROBOT.update(q, np.zeros(ROBOT.nv))
        ranges = np.full(2, np.nan)
        for i, name in enumerate(("left_sole", "right_sole")):
            p = ROBOT.placement(name).act(TOE)
            ranges[i] = self.tamper(progress, p[2] - self.height(p[0], p[1]))
        self.readings.append(float(ranges[0]))
        measured = np.array([state.actual for state in self.states])
        measurement = Measurement(
            self.time, np.zeros(1), np.zeros(1), np.zeros(3), np.zeros(3), np.zeros((2, 6)), ranges, measured
        )
        landing = None if self.landing is None else turn.toRotationMatrix() @ self.landing
        command = self.task.update(swing, progress, time_left, ROBOT, measurement, landing)
        self.commands.append(command)
        advance = self.task.actuator.advance
        self.states = [advance(s, float(k), DT) for s, k in zip(self.states, command, strict=True)]
        self.time += DT

    def step(self, side: str = "left", stride: float = 0.29, until: float = 1.0) -> StepStiffness:
        """Both feet down, a swing (given up at `until`), both feet down; the record of it."""
        start = self.x
        for _ in range(round(DOUBLE / DT)):
            self.tick(None, 0.0, 0.0, np.array([start, 0.0, 0.0]))
        n = round(SINGLE / DT)
        self.landing = np.array([start + stride, 0.0, 0.0])
        for i in range(n):
            u = i / n
            if u >= until:
                break
            s = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
            place = np.array([start + stride * s, 0.0, 0.05 + 0.06 * math.sin(math.pi * u) ** 2])
            self.tick(side, u, SINGLE * (1.0 - u), place)
        self.x = start + stride
        self.tick(None, 0.0, 0.0, np.array([self.x, 0.0, 0.0]))
        return self.task.steps[-1]


def make_task(
    policy: object = None, foot: VariableStiffnessFoot = FOOT, **timing: object
) -> StiffnessScheduler:
    chosen = FixedPolicy(20.0) if policy is None else policy
    return StiffnessScheduler(ROBOT, foot, chosen, StiffnessTiming(**{**PAPER, **timing}))  # type: ignore[arg-type]


PAPER: dict[str, object] = {"decide_at": 0.75, "early_landing": 0.0}
"""The paper decides at three quarters of the single support, and feet land in time."""


@pytest.fixture(scope="module")
def model() -> StiffnessModel:
    """Stiff on cobbles, soft on cylinders, in between on random ground; lower where it is higher."""
    values, stiffness = [], []
    for name, best in (
        ("cobble_stones", 60.0),
        ("cylinder_obstacles", 6.0),
        ("random", 30.0),
        ("flat", 45.0),
    ):
        for amplitude in (0.0,) if name == "flat" else (0.02, 0.025, 0.03):
            for lane in (-0.2, 0.0, 0.2):
                ground = terrain(name, amplitude=amplitude, seed=4)
                z = sliding_window_view(ground.profile(y=lane)[1], round(WINDOW / PROFILE_STEP) + 1)[::29]
                values.append(roughness(PROFILE_STEP * np.arange(z.shape[1]), z).values)
                stiffness += [best * (1.0 - 10.0 * amplitude)] * len(z)
    settings = ModelSettings(("sqrt(Sz)", "sqrt(P)", "Sku", "K"))
    return StiffnessModel.fit(np.concatenate(values), stiffness, stiffness, settings)


# --- timing -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("decide_at", "side"), [(0.4, "left"), (0.9, "right")])
def test_the_stiffness_changes_at_its_time_and_on_the_swinging_foot_alone(
    decide_at: float, side: str
) -> None:
    task = make_task(foot=QUICK, decide_at=decide_at)
    rig = Rig(task)
    record = rig.step(side)
    mine, other = (0, 1) if side == "left" else (1, 0)
    commands = np.array(rig.commands)
    np.testing.assert_array_equal(commands[:, other], 5.0)
    first = int(np.argmax(commands[:, mine] == 20.0))
    assert first == round(DOUBLE / DT) + math.ceil(round(decide_at * SINGLE / DT, 6))
    assert (commands[:first, mine] == 5.0).all() and (commands[first:, mine] == 20.0).all()
    assert (record.side, record.step, record.requested, record.commanded) == (side, 0, 20.0, 20.0)
    assert record.decided_before == pytest.approx((1 - decide_at) * SINGLE, abs=DT + 1e-9)
    assert record.planned_before == pytest.approx(record.decided_before, abs=DT + 1e-9)
    assert record.reached and record.actual == pytest.approx(20.0, abs=0.5) and record.fallback is None


def test_a_walk_takes_a_scheduler_of_its_robot_alone() -> None:
    with pytest.raises(InputError, match="for the robot that walks, 'hrp4_class'"):
        WalkingControl(load("hrp4_class").robot(), None, 0.005, stiffness=make_task())


def test_feet_take_turns_and_keep_what_they_have() -> None:
    wanted = iter([10.0, 30.0, 50.0, 70.0])
    task = make_task(lambda swing: next(wanted))
    rig = Rig(task)
    for side in ("left", "right", "left", "right"):
        rig.step(side)
    assert [(r.side, r.step, r.commanded) for r in task.steps] == [
        ("left", 0, 10.0),
        ("right", 1, 30.0),
        ("left", 2, 50.0),
        ("right", 3, 70.0),
    ]
    np.testing.assert_array_equal(task.command, [50.0, 70.0])
    assert all(r.reached for r in task.steps)
    task.begin(ROBOT)  # another walk
    assert not task.steps and (task.command == [50.0, 70.0]).all()


# --- scan -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_the_profile_is_the_ground_under_the_toe(yaw: float) -> None:
    ground = terrain("cobble_stones", amplitude=0.03, seed=1)
    seen: list[SwingScan] = []

    def policy(swing: SwingScan) -> float:
        seen.append(swing)
        return 7.0

    rig = Rig(make_task(policy), ground, yaw=yaw)
    rig.step()
    (swing,) = seen
    profile = swing.profile
    assert profile is not None
    truth = [rig.height(x, y) for x, y, _ in profile.points]
    assert np.abs(profile.z - truth).mean() < 5e-4 and np.ptp(truth) > 0.01
    np.testing.assert_allclose(profile.forward, [math.cos(yaw), math.sin(yaw)], atol=1e-12)
    # At three quarters of this swing the toe has gone 0.896 of its way.
    s = 0.75**3 * (10 - 15 * 0.75 + 6 * 0.75**2)
    assert profile.x[0] == pytest.approx(0.4 + TOE[0], abs=PROFILE_STEP)
    assert 0.0 <= 0.4 + 0.29 * s + TOE[0] - profile.x[-1] < 1.5 * PROFILE_STEP
    assert (swing.side, swing.step, swing.actual) == ("left", 0, 5.0)
    assert swing.time_left == pytest.approx(0.2)
    assert np.hypot(*swing.position[:2]) == pytest.approx(0.4 + 0.29 * s, abs=2e-3)


def test_between_two_readings_of_a_slow_sensor_the_scan_stays_as_it_is() -> None:
    """A sensor that reads at every fourth tick sees the same ground, however the foot moves in between."""
    ground = terrain("slope", amplitude=0.1, seed=0)
    calls = itertools.count()  # for both feet at every tick

    def slow(progress: float, reading: float) -> float:
        return reading if next(calls) % 8 < 2 else math.nan

    rig = Rig(make_task(), ground, tamper=slow)
    profile = rig.step().profile
    assert profile is not None
    assert np.abs(profile.z - [rig.height(x, y) for x, y, _ in profile.points]).max() < 1e-6


# --- policies ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_model_decides_what_it_would_say_of_the_profile(model: StiffnessModel) -> None:
    for name, amplitude, least, most in (
        ("cobble_stones", 0.025, 30.0, 60.0),
        ("cylinder_obstacles", 0.025, 0.0, 62.0),
    ):
        rig = Rig(make_task(ModelPolicy(model)), terrain(name, amplitude=amplitude, seed=4))
        rig.step()
        record = rig.step()
        assert record.decision is not None and record.profile is not None
        window = record.profile.last(WINDOW)
        said = model.predict(roughness(window.x, window.z).values)
        assert (record.decision.stiffness, record.decision.cluster) == (said.stiffness, said.cluster)
        assert record.decision.distance == said.distance
        assert tuple(record.decision.features) == model.settings.features
        assert least <= record.requested <= most, name


def test_the_oracle_is_asked_about_the_place() -> None:
    """Stiff beyond x = 0.85 m: the second step lands there, and no scan is needed."""
    blind = lambda progress, reading: math.nan  # noqa: E731
    # The feet land at 0.69 and at 0.98 m; when the first is decided it is 0.1 m short of that.
    rig = Rig(make_task(GroundPolicy(lambda x, y: 60.0 if x > 0.68 else 8.0), decide_at=0.5), tamper=blind)
    assert rig.step("left").requested == 60.0
    rig = Rig(make_task(GroundPolicy(lambda x, y: 60.0 if x > 0.97 else 8.0), decide_at=0.5), tamper=blind)
    assert rig.step("left").requested == 8.0
    assert rig.step("left").requested == 60.0
    assert all(r.profile is None and r.fallback is None for r in rig.task.steps)


def test_what_is_commanded_is_reached_even_by_an_early_landing() -> None:
    """A jump that the planned time is enough for is cut to what an earlier landing leaves time for."""
    whole, sure = (
        make_task(FixedPolicy(2000.0), decide_at=0.65, early_landing=early) for early in (0.0, 0.15)
    )
    commands = []
    for task in (whole, sure):
        rig = Rig(task, terrain("cobble_stones", amplitude=0.02, seed=4))
        rig.step()
        commands.append(rig.task.command[0])
    assert commands[0] == 2000.0 and 20.0 < commands[1] < 1000.0
    state = StiffnessState(5.0, 5.0, 5.0)
    assert FOOT.actuator.advance(state, commands[1], 0.28 - 0.15).actual == pytest.approx(
        commands[1], rel=0.05
    )


# --- no decision ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cause", ["short", "blind", "thin", "strange", "silent", "error", "nan"])
def test_without_a_decision_a_sole_keeps_its_stiffness(cause: str, model: StiffnessModel) -> None:
    def broken(swing: SwingScan) -> float:
        raise WbcError("out of order")

    policy, tamper, stride, reason = {
        "short": (lambda s: 50.0, lambda p, r: r, 0.1, "scan too short: 0.0"),
        "blind": (lambda s: 50.0, lambda p, r: math.nan, 0.29, "scan too short: no profile: 0 hits"),
        "thin": (
            lambda s: 50.0,
            lambda p, r: r if round(200 * p) % 5 == 0 else math.nan,
            0.5,
            "scan too thin",
        ),
        "strange": (
            ModelPolicy(model),
            lambda p, r: r + 0.3 * math.sin(60 * p),
            0.29,
            "unlike any known ground",
        ),
        "silent": (lambda s: None, lambda p, r: r, 0.29, "no opinion"),
        "error": (broken, lambda p, r: r, 0.29, "the policy failed: out of order"),
        "nan": (lambda s: math.nan, lambda p, r: r, 0.29, "the policy failed: stiffness that a policy wants"),
    }[cause]
    rig = Rig(make_task(policy, min_coverage=0.8), tamper=tamper)
    record = rig.step(stride=stride)
    assert record.fallback is not None and reason in record.fallback
    assert (record.requested, record.commanded) == (5.0, 5.0)
    assert record.reached and record.actual == pytest.approx(5.0, abs=0.5)


# --- actuator ---------------------------------------------------------------------------------------------------------


@given(
    wanted=st.floats(1.0, 2000.0),
    rate=st.floats(1.0, 100.0),
    lag=st.floats(0.0, 0.1),
    decide_at=st.sampled_from([0.5, 0.75, 0.9]),
)
@examples(10)
def test_what_is_commanded_is_reached(wanted: float, rate: float, lag: float, decide_at: float) -> None:
    """Whatever rate and lag: the command is what the actuator can settle to, so it is reached when the foot lands."""
    foot = VariableStiffnessFoot(stiffness=40.0, actuator=StiffnessActuator(rate, lag))
    task = make_task(FixedPolicy(wanted), foot, decide_at=decide_at)
    record = Rig(task).step()
    assert record.reached, (record.commanded, record.actual)
    assert min(40.0, wanted) <= record.commanded <= max(40.0, wanted)
    if rate * record.planned_before < 0.5 * abs(math.log10(wanted / 40.0)):
        assert record.commanded != wanted


# --- records and bad input --------------------------------------------------------------------------------------------
