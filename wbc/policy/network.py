"""Networks of policies: an observation in, an action out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.base.errors import InputError, choose, shown, shown_path
from wbc.base.files import decoding
from wbc.core.conventions import rotation_of
from wbc.core.frames import pose_of
from wbc.policy.references import ClipFrame, Frames

STEP = "time_step"
"""Input of a network that holds a motion: the number of a frame."""

JOINTS = ("joint_pos", "joint_vel")
"""Outputs of such a network with positions, rad, and velocities, rad/s, of the joints."""

PLACES = ("ref_pos_xyz", "body_pos_w")
"""Outputs with the place of one body, shape (3,), or the places of several, shape (bodies, 3), m."""

QUATERNIONS = ("ref_quat_xyzw", "body_quat_w")
"""Outputs with the quaternion of one body, x, y, z, w, or of several, w, x, y, z each."""

LARGEST = 1 << 30
"""Largest file of a network, bytes."""


class Network(ABC):
    """Function of an observation that a policy is: an `OnnxNetwork`, or a subclass of your own.

    Attributes:
        inputs: Number of values of an observation.
        outputs: Number of values of an action.
        took: Time that an action takes, s; 0 where it is not known.
    """

    inputs: int
    outputs: int
    took: float = 0.0

    @abstractmethod
    def __call__(self, observation: NDArray[np.float32], /) -> NDArray[np.float32]:
        """Return the action, shape (outputs,), of an observation, shape (inputs,)."""

    def act(self, observation: NDArray[np.float32], step: int) -> NDArray[np.float32]:
        """Return the action for a frame of the tracked motion, by its number; the number says nothing to most."""
        return self(observation)

    def motion(self, anchor: str) -> Frames | None:
        """Return the frames of the motion that the network holds, with the placement of a frame of the robot.

        None for a network without a motion.
        """
        return None


class OnnxNetwork(Network):
    """Network of an ONNX file, on one thread of the processor; needs the extra "policy".

    A second input `time_step` is the number of a frame of the motion in the network, whose outputs `joint_pos`,
    `joint_vel` and an orientation are that frame: the convention of whole_body_tracking and of holosoma.

    Attributes:
        metadata: Metadata of the file, key → text.
        took: Least time of three actions, s.
        holds_motion: True for a network with a motion in it.
    """

    def __init__(self, file: str | Path) -> None:
        """Read a file.

        Raises:
            InputError: onnxruntime is not installed; a file that cannot be read, or is no ONNX network that onnxruntime
                runs; a network with other inputs than one observation and a `time_step`, with an input of another type
                than float32, or of a width that is not fixed.
        """
        try:
            import onnxruntime  # noqa: PLC0415 - an extra
        except ImportError:
            raise InputError('policies need onnxruntime: pip install "wbc[policy]"') from None
        with decoding(file, "network", largest=LARGEST) as path:
            content = path.read_bytes()
        self._session = _session(onnxruntime, content, shown_path(file))
        inputs = {each.name: each for each in self._session.get_inputs()}
        outputs = {each.name: each for each in self._session.get_outputs()}
        step = inputs.pop(STEP, None)
        if len(inputs) != 1:
            names = ", ".join(f"'{name}'" for name in inputs)
            raise InputError(
                f"a policy has one input, its observation, beside '{STEP}'; the network {shown_path(file)} has {names}"
            )
        for each in filter(None, (*inputs.values(), step)):
            if each.type != "tensor(float)":
                raise InputError(f"the input '{each.name}' of a policy must be float32, got {each.type}")
        (self._input,) = inputs
        self._output = next((name for name in ("actions", "action") if name in outputs), next(iter(outputs)))
        self.inputs = self._width("input", inputs[self._input])
        self.outputs = self._width("output", outputs[self._output])
        self.metadata: dict[str, str] = dict(self._session.get_modelmeta().custom_metadata_map)
        self.holds_motion = step is not None
        one = [next((name for name in names if name in outputs), None) for names in (PLACES, QUATERNIONS)]
        self._frame = [*JOINTS, *(name for name in one if name is not None)]
        if self.holds_motion and (len(self._frame) < 4 or not {*JOINTS} <= {*outputs}):
            raise InputError(
                f"the network {shown_path(file)} has the input '{STEP}', and lacks outputs of a motion: it needs "
                f"{', '.join(JOINTS)}, {' or '.join(PLACES)}, and {' or '.join(QUATERNIONS)}"
            )
        self.took = self._time(shown_path(file))

    def _time(self, file: str) -> float:
        """Return the least time of three actions, s; `file` is for messages."""
        nothing, times = np.zeros(self.inputs, np.float32), []
        try:
            for _ in range(3):
                start = perf_counter()
                self(nothing)
                times.append(perf_counter() - start)
        except Exception as error:  # of classes of onnxruntime's own
            raise InputError(f"the network {file} does not run: {str(error).splitlines()[0]}") from None
        return min(times)

    @staticmethod
    def _width(what: str, value: Any) -> int:
        """Return the width of an input or output of shape (1, width), whose first number may be any."""
        shape = value.shape
        batch, width = shape if len(shape) == 2 else (0, None)
        of_one = batch == 1 or not isinstance(batch, int)  # a name, or None, stands for any number
        if not (of_one and isinstance(width, int)):
            raise InputError(
                f"the {what} '{value.name}' of a policy must have shape (1, width) with a fixed width, got "
                f"{shown(shape)}"
            )
        return width

    def __call__(self, observation: NDArray[np.float32], step: int = 0) -> NDArray[np.float32]:
        """Return the action, shape (outputs,), of an observation, shape (inputs,), for a frame of the motion in it."""
        action: NDArray[np.float32] = self._run([self._output], observation, step)[0][0]
        return action

    def act(self, observation: NDArray[np.float32], step: int) -> NDArray[np.float32]:
        """See `Network.act`."""
        return self(observation, step)

    def motion(self, anchor: str) -> Frames | None:
        """See `Network.motion`; an `InputError` for an anchor that is none of the bodies of the network."""
        if not self.holds_motion:
            return None
        bodies = [name.strip() for name in self.metadata.get("body_names", "").split(",")]
        body = bodies.index(choose("body of the motion in the network", anchor, bodies)) if bodies[0] else 0

        def frames(step: int) -> ClipFrame:
            parts = self._run(self._frame, np.zeros(self.inputs, np.float32), step)
            position, velocity, place, quaternion = (np.array(part[0], dtype=float) for part in parts)
            if quaternion.ndim == 2:  # of several bodies; see `QUATERNIONS`
                place, quaternion = place[body], np.roll(quaternion[body], -1)
            rotation = rotation_of(quaternion / np.linalg.norm(quaternion))
            return ClipFrame(position, velocity, pose_of(rotation, place))

        return frames

    def _run(self, outputs: list[str], observation: NDArray[np.float32], step: int) -> list[Any]:
        given = {self._input: observation[None]}
        if self.holds_motion:
            given[STEP] = np.array([[step]], np.float32)
        values: list[Any] = self._session.run(outputs, given)
        return values


def _session(onnxruntime: Any, content: bytes, file: str) -> Any:
    """Return a session of the content of a file on one thread; `file` is for messages."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4  # what is wrong is raised
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # of classes of onnxruntime's own
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(
            f"{file} is no ONNX network that onnxruntime {onnxruntime.__version__} runs: {reason}"
        ) from None
