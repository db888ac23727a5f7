"""The comparison benchmark's task and arithmetic; the timing itself is not a test."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pinocchio as pin
import pytest

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"


@pytest.fixture(scope="module")
def compare() -> ModuleType:
    sys.path.insert(0, str(FOLDER))
    try:
        return importlib.import_module("compare_tick")
    finally:
        sys.path.remove(str(FOLDER))


def test_sway_derivatives_are_those_of_its_position(compare: ModuleType) -> None:
    task, step = compare.talos(), 1e-5
    for time in np.linspace(0.0, 3.0, 17):
        (before, v_before, _), (after, v_after, _) = task.sway(time - step), task.sway(time + step)
        _, velocity, acceleration = task.sway(time)
        np.testing.assert_allclose(np.subtract(after, before) / (2 * step), velocity, atol=1e-8)
        np.testing.assert_allclose(np.subtract(v_after, v_before) / (2 * step), acceleration, atol=1e-8)


def test_task_is_talos_itself_without_geometry(compare: ModuleType, tmp_path: Path) -> None:
    task = compare.talos()
    stripped = pin.buildModelFromXML(task.urdf, pin.JointModelFreeFlyer())
    folder = Path(str(compare.distribution("example-robot-data").locate_file(compare.TALOS)))
    whole = pin.buildModelFromUrdf(str(folder / "robots" / "talos_reduced.urdf"), pin.JointModelFreeFlyer())
    assert stripped == whole
    assert "<mesh" not in task.urdf and "<visual" not in task.urdf and "<collision" not in task.urdf
    assert list(task.posture) and set(task.posture) == set(stripped.names[2:])
    file = tmp_path / "task.json"
    task.save(file)
    assert type(task).load(file) == task


def test_start_stands_on_level_soles_inside_all_limits(compare: ModuleType) -> None:
    task = compare.talos()
    model = pin.buildModelFromXML(task.urdf, pin.JointModelFreeFlyer())
    data, q = model.createData(), pin.neutral(model)
    q[2] = task.base_height
    q[7:] = [task.posture[name] for name in model.names[2:]]
    assert np.all(q[7:] > model.lowerPositionLimit[7:] + 0.1)
    assert np.all(q[7:] < model.upperPositionLimit[7:] - 0.1)
    pin.framesForwardKinematics(model, data, q)
    left, right = (data.oMf[model.getFrameId(sole)] for sole in task.soles)
    for sole in (left, right):
        assert abs(sole.translation[2]) < 1e-3
        np.testing.assert_allclose(sole.rotation, np.eye(3), atol=0.01)
    com = pin.centerOfMass(model, data, q)
    middle = (left.translation + right.translation) / 2
    half = task.sole_length / 2 - task.sagittal_amplitude
    assert abs(com[0] - middle[0]) < half and abs(com[1] - middle[1]) < task.sole_width / 2


def test_summary_takes_medians_over_turns_and_ratios_to_each(compare: ModuleType) -> None:
    def runs(*medians: float) -> list[dict[str, object]]:
        return [{"median_us": m, "p99_us": 2 * m, "failures": 1, "load": 0.0} for m in medians]

    every = {"wbc": runs(90, 80, 500), "PlaCo": runs(100, 100, 100), "TSID": runs(120, 119, 121)}
    result = compare.summary(every, {})
    assert result["libraries"]["wbc"]["median_us"] == 90
    assert result["libraries"]["wbc"]["failures"] == 3
    assert result["ratios"] == {"PlaCo": 0.9, "TSID": 0.75}
    assert result["ratio"] == 0.9
    del every["TSID"]
    partial = compare.summary(every, {"TSID": "no environment"})
    assert partial["ratio"] is None and "no environment" in compare.table(partial)


@pytest.mark.parametrize(
    "printed", ["", "Traceback", "[]", '{"median_us": 1}', '{"median_us": 0, "p99_us": 1}']
)
def test_output_without_timings_is_reported_as_missing(compare: ModuleType, printed: str) -> None:
    with pytest.raises(compare.MissingError, match="no timings"):
        compare.read_record(printed)


def test_a_program_that_fails_is_named_and_the_others_still_run(compare: ModuleType) -> None:
    good = [sys.executable, "-c", 'print(\'{"median_us": 1.0, "p99_us": 2.0}\')']
    bad = [sys.executable, "-c", "raise SystemExit('no such robot')"]
    records, missing = compare.take_turns({"good": good, "bad": bad}, 2)
    assert [len(runs) for runs in records.values()] == [2] and "no such robot" in missing["bad"]
