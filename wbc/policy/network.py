"""Networks of policies: an observation in, an action out."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from wbc.base.errors import InputError, shown, shown_path
from wbc.base.files import decoding

LARGEST = 1 << 30
"""Largest file of a network, bytes."""


class Network(Protocol):
    """Function of an observation that a policy is, such as an `OnnxNetwork` or one of your own.

    Attributes:
        inputs: Number of values of an observation.
        outputs: Number of values of an action.
    """

    inputs: int
    outputs: int

    def __call__(self, observation: NDArray[np.float32], /) -> NDArray[np.float32]:
        """Return the action, shape (outputs,), of an observation, shape (inputs,)."""


class OnnxNetwork:
    """Network of an ONNX file, on one thread of the processor; needs the extra "policy".

    Attributes:
        inputs: Number of values of an observation.
        outputs: Number of values of an action.
        metadata: Metadata of the file, key → text.
    """

    def __init__(self, file: str | Path) -> None:
        """Read a file.

        Raises:
            InputError: onnxruntime is not installed; a file that cannot be read, or is no ONNX network that onnxruntime
                runs; a network with other inputs than one observation, with an input of another type than float32, or
                of a width that is not fixed.
        """
        try:
            import onnxruntime  # noqa: PLC0415 - an extra
        except ImportError:
            raise InputError('policies need onnxruntime: pip install "wbc[policy]"') from None
        with decoding(file, "network", largest=LARGEST) as path:
            content = path.read_bytes()
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 4  # what is wrong is raised
        try:
            self._session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # of classes of onnxruntime's own
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise InputError(
                f"{shown_path(file)} is no ONNX network that onnxruntime {onnxruntime.__version__} runs: {reason}"
            ) from None
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        if len(inputs) != 1:
            names = ", ".join(f"'{each.name}'" for each in inputs)
            raise InputError(
                f"a policy has one input, its observation; the network {shown_path(file)} has {names}"
            )
        self._input, self._output = inputs[0].name, outputs[0].name
        if inputs[0].type != "tensor(float)":
            raise InputError(f"the input '{self._input}' of a policy must be float32, got {inputs[0].type}")
        self.inputs = self._width("input", inputs[0])
        self.outputs = self._width("output", outputs[0])
        self.metadata: dict[str, str] = dict(self._session.get_modelmeta().custom_metadata_map)

    @staticmethod
    def _width(what: str, value: Any) -> int:
        """Return the width of an input or output of shape (1, width), whose first number may be any."""
        shape = value.shape
        if (
            len(shape) != 2
            or not isinstance(shape[1], int)
            or shape[0] not in (1, None)
            and isinstance(shape[0], int)
        ):
            raise InputError(
                f"the {what} '{value.name}' of a policy must have shape (1, width) with a fixed width, got "
                f"{shown(shape)}"
            )
        return int(shape[1])

    def __call__(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the action, shape (outputs,), of an observation, shape (inputs,)."""
        action: NDArray[np.float32] = self._session.run([self._output], {self._input: observation[None]})[0][
            0
        ]
        return action
