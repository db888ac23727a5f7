"""The tour of the G1: its random numbers, what they decide, and the first seconds of runs."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any, get_args

import model
import mujoco
import numpy as np
import pytest
import tour
from _runs import Run
from generator import Generator, seed_sequence
from made_policies import write_network
from table import PUBLISHED, table
from task import (
    COMMANDS,
    DELAY,
    DURATION,
    POINTS,
    SEGMENT,
    Effort,
    MovingArms,
    Teleoperator,
    punches,
    standing,
    waypoints,
)

import wbc
from wbc.base.settings import from_json, to_json
from wbc.sim.studies import trial_from_json

LIBSTDCXX = {
    (0, 2): (3825457058, 706492411, 2134599173, 1489500560, 883974307),
    (1, 3): (1809848369, 2997353437, 511698448, 4158610213, 3119858389),
    (127, 4): (1126346880, 3741318458, 1746886362, 155140534, 850640379),
    (10000, 2): (2484273330, 689842731, 1233685217, 1182079408, 2466235712),
}
"""Seeds → the first five numbers of std::mt19937 seeded by std::seed_seq{seeds…}, by g++ 12's library."""


def test_draws_are_those_of_cxx() -> None:
    """The example of std::seed_seq on cppreference, and draws of the reference library."""
    assert seed_sequence((1, 2, 3, 4, 5), 10) == [
        4204997637,
        4246533866,
        1856049002,
        1129615051,
        690460811,
        1075771511,
        46783058,
        3904109078,
        1534123438,
        1495905678,
    ]
    for seeds, expected in LIBSTDCXX.items():
        draws = Generator(*seeds)
        assert tuple(draws.word() for _ in expected) == expected
    draws = Generator(127, 4)
    assert [draws.word() for _ in range(1000)][-1] == 752077959


def test_the_ten_thousandth_number_is_the_standards() -> None:
    """[rand.predef]: the 10000th of a default-constructed std::mt19937 is 4123659995; its words are by Knuth."""
    words = [5489]
    for k in range(1, 624):
        words.append((1812433253 * (words[-1] ^ words[-1] >> 30) + k) & 0xFFFFFFFF)
    draws = Generator(0)
    draws._bits.state = {
        "bit_generator": "MT19937",
        "state": {"key": np.array(words, dtype=np.uint32), "pos": 624},
    }
    assert [draws.word() for _ in range(10_000)][-1] == 4123659995


def test_waypoints_and_punches_are_those_of_the_task() -> None:
    found = [(waypoints(run), punches(run)) for run in range(200)]
    places = np.array([point for points, _ in found for point in points])
    off = np.hypot(places[:, 0] - 0.3, places[:, 1])
    assert len(found[0][0]) == POINTS and off.max() <= 1.0
    assert np.mean(off < math.sqrt(0.5)) == pytest.approx(0.5, abs=0.03)  # uniform over the disc
    assert np.abs(places[:, 2]).max() <= math.pi
    blows = [(k, punch) for _, each in found for k, punch in enumerate(each)]
    for k, punch in blows:
        assert punch.time == pytest.approx(DELAY + SEGMENT * k) and punch.joint in model.JOINTS
        ceiling = 500.0 * min(1.0 / 3.0 + 2.0 / 3.0 * 5.0 * k / 60.0, 1.0)
        assert 0.5 * ceiling - 1e-6 <= np.linalg.norm(punch.force) <= ceiling + 1e-6
    ups = np.array([punch.force[2] / np.linalg.norm(punch.force) for _, punch in blows])
    assert abs(ups.mean()) < 0.03 and np.mean(np.abs(ups) < 0.5) == pytest.approx(0.5, abs=0.03)
    assert max(np.linalg.norm(punch.force) for _, punch in blows) * DURATION / 35.1 > 1.1


def test_the_harness_sends_the_robot_to_its_waypoint_in_its_own_axes() -> None:
    operator, (ahead, left, turn) = Teleoperator(3, (0.5, 0.25, 0.5)), waypoints(3)[0]
    operator.command(0.0, 5.0, 2.0, 1.0)
    x = 5.0 + math.cos(1.0) * ahead - math.sin(1.0) * left
    y = 2.0 + math.sin(1.0) * ahead + math.cos(1.0) * left
    assert operator.command(0.02, x, y, 1.0 + turn) == (0.0, 0.0, 0.0)
    assert operator.command(0.04, x - 0.19, y, 1.0 + turn + 0.11) == (0.0, 0.0, 0.0)  # still there
    forward, aside, turning = operator.command(0.06, x - 0.21, y, math.pi / 2)
    assert forward == pytest.approx(0.0, abs=1e-9) and aside == -0.25  # it faces +y, and the place is at +x
    assert abs(turning) <= 0.5
    operator.command(SEGMENT, x, y, 1.0 + turn)
    assert operator.errors == [
        (pytest.approx(0.21), pytest.approx(abs(math.remainder(1.0 + turn - math.pi / 2, math.tau))))
    ]


def test_the_robot_is_the_benchmarks() -> None:
    simulated = model.load()
    robot = wbc.RobotDescription.from_mjcf(simulated).robot()
    assert robot.mass == pytest.approx(35.11, abs=0.01) and robot.na == 29
    assert set(robot.joint_names) == set(model.JOINTS)
    assert simulated.dof_armature[simulated.joint("left_knee_joint").dofadr[0]] == pytest.approx(
        0.0251, abs=1e-4
    )
    hulls = simulated.geom_type == mujoco.mjtGeom.mjGEOM_MESH  # of 27 links, the hands among them
    assert hulls.sum() == 27 and (simulated.mesh_vertnum == 8).all()
    assert (simulated.geom_contype == 1).all() and (simulated.geom_conaffinity == 1).all()
    spheres = simulated.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE
    assert np.count_nonzero(spheres) == 8 and np.allclose(simulated.geom_size[spheres, 0], 0.005)
    arms = MovingArms(10_001, robot)
    start = arms.target
    for tick in range(100):
        arms.move(0.02 * tick)
    assert 0.05 < np.abs(arms.target - start).max() < 1.5
    assert np.isfinite(standing(robot)).all()


def test_legs_that_cross_collide() -> None:
    """Shins that are moved into each other are pushed apart: the depth of the contact goes down."""
    simulated = model.load()
    data = mujoco.MjData(simulated)
    data.qpos[2] = 2.0  # in the air
    for name, angle in (("left_hip_roll_joint", -0.30), ("right_hip_roll_joint", 0.30)):
        data.joint(name).qpos[0] = angle
    mujoco.mj_forward(simulated, data)
    legs = ("hip", "knee", "ankle")
    touching = [
        {simulated.body(simulated.geom_bodyid[geom]).name for geom in contact.geom}
        for contact in data.contact
    ]
    assert any(
        all(any(part in body for part in legs) for body in pair) and len({body[0] for body in pair}) == 2
        for pair in touching
    )
    deepest = min(contact.dist for contact in data.contact)
    for _ in range(100):
        mujoco.mj_step(simulated, data)
    assert min((contact.dist for contact in data.contact), default=0.0) > 0.5 * deepest


def test_energy_and_vibration_are_those_of_a_turning_joint() -> None:
    """A sine of speed with a constant torque: ∫|τq̇| dt and Σ|Δa|, closed forms of sampled values."""
    effort, times = Effort(["left_knee_joint", "waist_yaw_joint"]), COMMANDS * np.arange(1001)
    speed, torque = 2.0 * np.sin(math.pi * times), np.array([5.0, -3.0])
    for value in speed:
        effort.add(torque, np.array([value, 0.0]))
    found = effort.by_group()
    assert found["energy"]["legs"] == pytest.approx(
        5.0 * 2.0 * 20.0 * 2.0 / math.pi, rel=1e-3
    )  # 20 s of |sin|
    # The second difference of a sine is −4 sin²(πT/2) of it.
    second = 2.0 * 4.0 * math.sin(math.pi * COMMANDS / 2.0) ** 2 / COMMANDS
    assert found["vibration"]["legs"] == pytest.approx(second * 999 * 2.0 / math.pi, rel=2e-3)
    assert found["energy"]["waist"] == found["vibration"]["waist"] == found["energy"]["arms"] == 0.0


def test_a_table_has_intervals_and_the_published_rows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [
        {
            "run": k,
            "survived": 90.0 - 10.0 * (k % 3),
            "completed": k % 3 == 0,
            "position_error": 0.1,
            "heading_error": 0.1,
            "energy": {"legs": 5000.0, "arms": 1000.0 * (1 + k % 3)},
            "vibration": {"legs": 1.2e6},
        }
        for k in range(9)
    ]
    text = table(rows)
    assert "| 6 | 1.2 |" in text.replace(" [6, 6]", "").replace(
        " [1.2, 1.2]", ""
    )  # of the completed runs alone
    assert "80 [" in text and "33 [" in text and all(policy.name in text for policy in PUBLISHED)
    assert text.index("gr00t_wbc") < text.index("**wbc**") < text.index("homie")  # by survival
    file = tmp_path / "rows.jsonl"
    file.write_text("\n".join(json.dumps(row) for row in rows), encoding="utf-8")
    assert tour.main([str(file)]) == rows and "**wbc**, 9 runs" in capsys.readouterr().out


def test_setups_are_rows_of_the_table_and_another_engine_is_its_column() -> None:
    def row(setup: tour.Setup, survived: float) -> dict[str, Any]:
        errors = {"position_error": 0.1, "heading_error": 0.1}
        return {
            "setup": setup.name,
            "engine": setup.engine,
            "survived": survived,
            "completed": False,
            **errors,
        }

    plain, noisy = tour.Setup(force_sensors=False), tour.Setup(noise="realistic", mode="hybrid", delay=0.002)
    there = dataclasses.replace(plain, engine="dart")
    text = table(
        [row(plain, 60.0), row(plain, 70.0), row(there, 50.0), row(noisy, 20.0), row(tour.Setup(), 80.0)]
    )
    ten = table([row(plain, 60.0), row(tour.Setup(), 80.0)], most=10)
    assert ten.count("\n|") == 11 and "amo" in ten and "holosoma" not in ten
    lines = [line for line in text.splitlines() if "**wbc**" in line]
    assert len(lines) == 3 and "82.9" in text  # a published one in PhysX
    assert lines[0].startswith("| **wbc**, force sensors, 1 run | 80 ")
    assert "no force sensors, 2 runs" in lines[1] and lines[1].endswith("| 50 (dart, 1 run) |")
    assert "realistic noise, hybrid, machine's gains, delays 2 + 2 ms" in lines[2]
    assert "unranked" in tour.Setup(own_arms=True).name
    names = {
        tour.Setup().name,
        *(
            tour.Setup(policy="w", control=control, own_arms=control == "filtered").name
            for control in get_args(tour.Control)
        ),
    }
    assert len(names) == 4


def test_a_run_is_a_trial_that_a_journal_keeps(tmp_path: Path) -> None:
    setup = tour.Setup(force_sensors=False, delay=0.002, engine="dart", drop=0.02)
    spec = Run("tour", {"run": 10_000, **to_json(setup)})
    read = trial_from_json(json.loads(json.dumps(spec.to_json())))
    assert (
        read == spec
        and from_json(tour.Setup, {k: v for k, v in read.arguments.items() if k != "run"}) == setup
    )
    file = tmp_path / "some.journal"
    lines = [
        {"spec": {}, "status": "done", "result": {"run": 1}},
        {"spec": {}, "status": "crashed", "result": None},
    ]
    file.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
    assert tour.read(file) == [{"run": 1}]


@pytest.mark.slow
@pytest.mark.parametrize("control", get_args(tour.Control))
def test_a_policy_is_sent_through_the_tour(control: str, tmp_path: Path) -> None:
    """It asks for all torques once it is to walk: the library takes over under a guard, a filter saves no legs.

    A filtered policy has the arms, which somebody else moves for the others.
    """
    pytest.importorskip("onnxruntime")
    description = wbc.RobotDescription.from_mjcf(model.load())
    robot = description.robot()
    weights = np.zeros((robot.na, 3))
    weights[:, 0] = 1e3  # of the velocity ahead
    q = standing(robot)[7:]
    gains = np.array([robot.servos.kp, robot.servos.kd])
    metadata = {
        "joint_names": json.dumps(list(robot.joint_names)),
        "joint_stiffness": json.dumps(gains[0].tolist()),
        "joint_damping": json.dumps(gains[1].tolist()),
        "default_joint_pos": json.dumps(q.tolist()),
        "observation_names": "velocity_commands",
    }
    file = write_network(tmp_path / "mad.onnx", weights, metadata)
    guarded, filtered = control == "guarded", control == "filtered"
    setup = tour.Setup(policy=str(file), control=control, own_arms=filtered, punches=False, seconds=1.3)
    row = tour.walk(10_000, setup)
    assert row["survived"] > 1.0 or not guarded
    assert bool(row["relieved"]) == guarded and (row["changed"] > 0.0) == filtered
    assert filtered or (row["told"] is None) == guarded


def test_the_machines_gains_are_those_of_its_servos() -> None:
    description = wbc.RobotDescription.from_mjcf(model.load()).with_servos(model.GAINS)
    gains = dict(zip(description.joint_names, zip(description.kp, description.kd, strict=True), strict=True))
    assert gains["left_knee_joint"] == (100.0, 2.0) and gains["right_hip_yaw_joint"] == (60.0, 1.0)
    assert gains["waist_yaw_joint"] == (60.0, 1.0) and gains["left_ankle_roll_joint"] == (40.0, 1.0)


@pytest.mark.parametrize(
    "arguments",
    [
        ["x"],
        ["5-3"],
        ["-4"],
        ["1-"],
        ["1", "--seconds", "0"],
        ["1", "--processes", "0"],
        ["1", "--engine", "physx"],
        ["1", "--delay", "-0.001"],
        ["1", "--drop", "nan"],
        ["1", "--noise", "some"],
        ["1", "--control", "guarded"],
        ["1", "--control", "filtered", "--policy", "w.onnx"],
        ["1-2", "--film", "tour.mp4"],
        ["1", "--film", "tour.txt"],
    ],
)
def test_runs_and_options_that_are_none_are_refused(arguments: list[str]) -> None:
    first, *options = arguments
    with pytest.raises(SystemExit):
        tour.main(["--json", *options, "--", first])


def test_a_divergence_ends_a_run_as_a_fall_does() -> None:
    run = tour.Tour(10_000, tour.Setup())
    for _ in range(3):
        run.step()
    assert isinstance(run.loop, wbc.sim.MujocoLoop)
    run.loop.data.qvel[8] = math.nan
    run.step()
    run.step()
    row = run.result()
    assert run.over and not row["completed"] and row["survived"] == pytest.approx(4 * tour.PERIOD)


@pytest.mark.slow
def test_a_study_goes_on_from_its_journal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    common = ["--json", "--seconds", "0.1", "--journal", str(tmp_path / "tour.journal")]
    first = tour.main(["10000", *common])
    both = tour.main(["10000-10001", *common])
    assert both[0] == first[0] and [row["run"] for row in both] == [10_000, 10_001]
    assert len((tmp_path / "tour.journal").read_text(encoding="utf-8").splitlines()) == 2
    assert capsys.readouterr().out.count('"run": 10000') == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    "setup",
    [
        tour.Setup(mode="hybrid", delay=0.002, force_sensors=False, seconds=4.0),
        tour.Setup(own_arms=True, noise="realistic", seconds=4.0),
        tour.Setup(engine="dart", force_sensors=False, seconds=4.0),
        tour.Setup(drop=0.02, force_sensors=False, seconds=4.0),
    ],
    ids=lambda setup: setup.name if setup.engine == "mujoco" else setup.engine,
)
def test_the_first_seconds_are_survived_in_every_setup(setup: tour.Setup) -> None:
    if setup.engine == "dart":
        pytest.importorskip("dartpy")
    row = tour.walk(10_001, setup)
    assert row["completed"] and row["steps"] > 2 and row["failed_ticks"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("run", [10_000, 10_003, 10_007])
def test_the_first_ten_seconds_are_survived_without_force_sensors(run: int) -> None:
    row = tour.walk(run, tour.Setup(force_sensors=False, seconds=10.0))
    assert row["completed"] and row["steps"] > 5 and row["failed_ticks"] == 0
    assert row["position_error"] < 0.5
