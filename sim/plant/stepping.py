"""Physics steps of one control period: when references move, pushes act and sensors are read."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from wbc.sim.plant.drives import Drives
from wbc.sim.plant.pushes import Pushes
from wbc.sim.plant.sensors import SensorChain
from wbc.sim.plant.signals import TrueSignals
from wbc.sim.plant.truth import TruthReader


class PhysicsSteps:
    """Physics of a plant between two commands.

    The first half of a physics step, in which MuJoCo computes positions, velocities and contacts, is done at the end of
    the step before: sensors are read there.

    Attributes:
        steps: Physics steps in a control period.
        averaging: False to record the forces of the last physics step alone.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        steps: int,
        *,
        averaging: bool,
        drives: Drives,
        pushes: Pushes,
        signals: TrueSignals,
        chain: SensorChain,
        truth: TruthReader,
    ) -> None:
        """Put the parts together."""
        self.steps, self.averaging = steps, averaging
        self._model, self._data = model, data
        self._drives, self._pushes = drives, pushes
        self._signals, self._chain, self._truth = signals, chain, truth

    def advance(self) -> None:
        """Advance by one control period under the targets of the drives."""
        model, data, drives, signals = self._model, self._data, self._drives, self._signals
        if self._pushes or self._chain.oldest or drives.delay or drives.start is not drives.target:
            self._advance_singly()
            return
        data.ctrl[:] = drives.target
        if self.averaging:
            step = mujoco.mj_step2
            for row in signals.window:
                step(model, data)
                data.sensordata.take(signals.force_places, out=row, mode="clip")
                step = mujoco.mj_step
        else:
            mujoco.mj_step2(model, data)
            if self.steps > 1:
                mujoco.mj_step(model, data, self.steps - 1)
            data.sensordata.take(signals.force_places, out=signals.window[0])
        self._truth.capture(data)
        mujoco.mj_step1(model, data)

    def _advance_singly(self) -> None:
        """Advance by one control period step by step: for pushes, moving references, delays and latencies."""
        model, data, drives, signals = self._model, self._data, self._drives, self._signals
        ctrl, sensors, window, places = data.ctrl, data.sensordata, signals.window, signals.force_places
        moving, rows = drives.start is not drives.target, len(window)
        newest, oldest = self._chain.newest, self._chain.oldest
        ctrl[:] = drives.target
        begun = True  # the first half of the coming step is done
        for left in range(self.steps - 1, -1, -1):
            done = self.steps - left
            if moving:
                part = drives.target - drives.start
                ctrl[:] = drives.target if left == 0 else drives.start + (done / self.steps) * part
            if drives.delay:
                drives.advance()
                ctrl[:] = drives.target
            if self._pushes:
                self._pushes.apply(data, model.opt.timestep)
            (mujoco.mj_step2 if begun else mujoco.mj_step)(model, data)
            sensors.take(places, out=window[(done - 1) % rows], mode="clip")
            if left == 0:
                self._truth.capture(data)
            read = newest <= left <= oldest
            begun = left == 0 or read or bool(self._pushes)
            if begun:
                mujoco.mj_step1(model, data)
            if read and oldest > 0:
                signals.sample(data)
                self._chain.push(signals.values)


def divergence(data: mujoco.MjData) -> str | None:
    """Return MuJoCo's warnings, or what is not finite, of a state that has no meaning; None as a rule."""
    warned, q, v = data.warning.number, data.qpos, data.qvel
    if any(warned.tolist()) or not math.isfinite(q.dot(q) + v.dot(v)):
        return ", ".join(mujoco.mjtWarning(i).name for i in np.flatnonzero(warned)) or "NaN in the state"
    return None
