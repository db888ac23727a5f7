"""Any controller that walks is measured, logged and shown, also one without a plan, a stabilizer or a driver."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wbc.app.bench.profile import profile_walk
from wbc.app.log import Log, Recorder
from wbc.app.scene import Annotations, PlantSource, make_layers
from wbc.app.scene.shapes import HIDDEN
from wbc.app.view.controls import LiveControls
from wbc.sim.walks import WalkHook, WalkPlan, WalkPush, WalkResult, WalkSpec, WalkTick, WalkTrial, walk
from wbc.walking import Gait, ReferenceControl, WalkingControl

GAIT = Gait(single_support=0.5, double_support=0.2, initial_double_support=0.5, final_double_support=0.5)
MISSING = ("output", "stabilizer", "lean", "bias", "hands", "load")
MEMBERS = {
    name
    for name in {**vars(ReferenceControl), **ReferenceControl.__annotations__}
    if not name.startswith("_")
}
STABILIZED = ("stabilizer/", "zmp/", "walk/lean/", *(f"foot/{side}/" for side in ("left", "right")))
ERRORS = {"zmp_error", "com_error", "dcm_error", "dcm_error_max", "J"}


class Bare:
    """A walk of which nothing can be seen but `ReferenceControl`, and no stabilizer."""

    def __init__(self, *args: Any, **values: Any) -> None:
        vars(self)["_walking"] = WalkingControl(*args, **values)

    def __getattr__(self, name: str) -> Any:
        if name not in MEMBERS:
            raise AttributeError(name)
        return None if name in MISSING else getattr(vars(self)["_walking"], name)

    def __setattr__(self, name: str, value: Any) -> None:
        if name in ("velocity", "stiffness"):
            setattr(vars(self)["_walking"], name, value)
        else:
            vars(self)[name] = value


class Pictures(WalkHook):
    """Draws every 20th tick with all layers."""

    def start(self, trial: WalkTrial) -> None:
        source = PlantSource(trial.plant)
        self.layers = make_layers(trial.plant, source.scene, trial.walking)
        self.controls = LiveControls(trial.plant, trial.walking).available()
        self.matrices: list[np.ndarray] = []
        self.texts: list[list[str]] = []
        self._ticks = 0

    def tick(self, tick: WalkTick) -> None:
        self._ticks += 1
        if self._ticks % 20:
            return
        annotations = Annotations()
        for layer in self.layers:
            found = np.tile(HIDDEN, (len(layer.moving), 1, 1))
            layer.fill(found, annotations)
            self.matrices.append(found)
        self.texts.append(annotations.text)


def spec(**values: Any) -> WalkSpec:
    return WalkSpec(**{"plan": WalkPlan(distance=0.2), "gait": GAIT, "timestep": 0.0025} | values)


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr("wbc.sim.walks.trial.WalkingControl", Bare)
    yield
    monkeypatch.undo()


@pytest.mark.parametrize(
    "values",
    [
        {"foot": "variable", "terrain": "stones", "amplitude": 0.01},
        pytest.param(
            {
                "plan": WalkPlan(drive=((0.0, 0.1, 0.0, 0.2), (2.0, 0.0, 0.0, 0.0))),
                "mode": "torque",
                "timestep": 0.002,
            },
            marks=pytest.mark.slow,
        ),
    ],
    ids=["plan", "drive"],
)
def test_only_figures_of_the_stabilizer_are_missing(
    values: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    push = WalkPush(impulse=0.05, step=1, phase=0.3)
    results, logs, pictures = [], [], []
    for i, control in enumerate((WalkingControl, Bare)):
        monkeypatch.setattr("wbc.sim.walks.trial.WalkingControl", control)
        shown, path = Pictures(), tmp_path / f"{i}.arrow"
        results.append(walk(spec(**values, pushes=(push,)), hooks=[Recorder(path), shown]))
        logs.append(Log.open(path))
        pictures.append(shown)
    whole, bare = (result.record() for result in results)
    assert {name for name in whole if whole[name] != bare[name]} == ERRORS
    assert results[1].outcome == "completed" and results[1].zmp_error.mean is None

    assert logs[0].signals == logs[1].signals
    for name, signal in logs[0].signals.items():
        if signal.kind == "text":
            assert list(logs[0].texts(name)) == list(logs[1].texts(name)), name
        elif signal.kind != "list" and name.partition("/")[0] != "tick" and name != "stiffness/computing":
            have, less = logs[0][name], logs[1][name]
            if not np.array_equal(have, less, equal_nan=True):
                assert name.startswith(STABILIZED) and (np.isnan(less).all() or not less.any()), name

    one, other = pictures
    assert all(np.array_equal(a, b) for a, b in zip(one.matrices, other.matrices, strict=True))
    assert [[line for line in text if "DCM" not in line] for text in one.texts] == other.texts
    assert one.controls.keys() - other.controls.keys() == {"gains"}


@pytest.mark.usefixtures("bare")
def test_a_fall_has_its_step_and_cause_without_a_stabilizer() -> None:
    """In step 2 the left foot stands: a robot that falls to the left falls to the outside."""
    push = WalkPush(impulse=0.9, direction=math.pi / 2, step=1, phase=0.3)
    result: WalkResult = walk(spec(noise="none", pushes=(push,)))
    assert result.fall is not None
    fall = asdict(result.fall)
    assert (fall["step"], fall["phase"], fall["cause"]) == (2, "single support", "left")
    assert fall["onset"] == pytest.approx(fall["time"], abs=0.02)
    assert fall["dcm_forward"] is None and fall["dcm_outward"] is None


@pytest.mark.usefixtures("bare")
def test_a_profile_times_the_parts_that_there_are() -> None:
    _, rows = profile_walk(WalkTrial(spec(plan=WalkPlan(distance=0.05))))
    parts = {row.what for row in rows}
    assert {"observer", "figures", "rest of the tick"} <= parts and not {"footsteps", "stabilizer"} & parts
