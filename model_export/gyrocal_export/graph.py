"""Network `paper` as an ONNX graph: read and checked layer by layer."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import numpy_helper

from gyrocal.errors import InputError

METADATA = ("name", "rate_hz", "table_dps")
INPUTS = ("up", "down")


class Graph:
    """An ONNX file, read from its inputs to its output."""

    def __init__(self, model: onnx.ModelProto, source: str) -> None:
        self.model = model
        self.source = source
        self.metadata = {entry.key: entry.value for entry in model.metadata_props}
        missing = [key for key in METADATA if key not in self.metadata]
        if missing:
            raise self.error(f"metadata lacks {', '.join(missing)}")
        if [value.name for value in model.graph.input] != list(INPUTS):
            raise self.error(f"inputs are not {' and '.join(INPUTS)}")
        self._constants = {i.name: numpy_helper.to_array(i) for i in model.graph.initializer}
        self._makers = {name: node for node in model.graph.node for name in node.output}
        shape = [d.dim_value for d in model.graph.input[0].type.tensor_type.shape.dim]
        if len(shape) != 4 or shape[1:3] != [1, 2] or shape[3] < 1:
            raise self.error(f"input up has shape {shape}, not [N, 1, 2, window]")
        self.window = shape[3]

    @classmethod
    def open(cls, path: Path) -> Graph:
        """Read and check an ONNX file.

        Raises:
            InputError: the file does not exist, is not ONNX, or does not hold this network.
        """
        try:
            model = onnx.load(path)
            onnx.checker.check_model(model, full_check=True)
        except OSError as error:
            raise InputError(f"{path}: {error.strerror or error}; write one with `gyrocal export`") from error
        except Exception as error:  # protobuf's and the checker's errors have no common base
            raise InputError(f"{path}: not an ONNX network ({str(error).splitlines()[0][:120]})") from error
        return cls(model, str(path))

    def error(self, reason: str) -> InputError:
        """An InputError that names the file and the node."""
        return InputError(f"{self.source}: not the graph of network paper: {reason}; write one with `gyrocal export`")

    def chain(self, start: str, ops: Sequence[str]) -> list[onnx.NodeProto]:
        """The nodes of types ``ops`` that consume ``start`` one after another."""
        nodes: list[onnx.NodeProto] = []
        for op in ops:
            users = [node for node in self.model.graph.node if start in node.input]
            if len(users) != 1 or users[0].op_type != op:
                raise self.error(f"after {start} comes {', '.join(n.op_type for n in users) or 'nothing'}, not {op}")
            nodes.append(users[0])
            start = users[0].output[0]
        return nodes

    def constant(self, node: onnx.NodeProto, index: int) -> NDArray[Any]:
        """The value of a node's constant input."""
        name = node.input[index]
        if name not in self._constants:
            raise self.error(f"input {index} of {node.op_type} is not a constant")
        return self._constants[name]

    def quantised(self, node: onnx.NodeProto) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
        """The codes of a node's int8 weights, and the step of each output channel."""
        maker = self._makers.get(node.input[1])
        if maker is None or maker.op_type != "DequantizeLinear":
            raise self.error(f"the weights of {node.op_type} are not int8")
        code, step = self.constant(maker, 0), self.constant(maker, 1)
        if code.dtype != np.int8 or step.shape != (len(code),) or attribute(maker, "axis", 1) != 0:
            raise self.error(f"the weights of {node.op_type} are not int8 with a step an output channel")
        return code, step


def attribute(node: onnx.NodeProto, name: str, default: Any) -> Any:
    """The attribute of a node by name."""
    return next((onnx.helper.get_attribute_value(a) for a in node.attribute if a.name == name), default)
