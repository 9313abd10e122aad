"""Quantisation of a float ONNX graph to int8 weights and float32 activations.

Each BatchNorm is folded into the following convolution *after* rounding: with gain g and shift b, conv(w, g x + b) =
conv(v, x + b/g) with v = w g, and the dequantised v multiplies b/g. If it were folded before rounding, the rounding of v
would multiply the mean of x too, rather than only the deviations from it. The row of the true rate, which is constant after
the clip, becomes part of the bias. The result is the exact reference of the C kernel.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from gyrocal_export.graph import Graph, attribute

Float = NDArray[np.float64]
CONV = ("BatchNormalization", "Conv", "AveragePool", "LeakyRelu")


def codes(weight: Float) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
    """The int8 codes within +-127 and the float32 step of each output channel: weight ~ step * code."""
    largest = np.abs(weight.reshape(len(weight), -1)).max(axis=1)
    step = (np.where(largest > 0, largest, 1.0) / 127).astype(np.float32)
    return np.rint(weight / by_channel(step, weight)).clip(-127, 127).astype(np.int8), step


def by_channel(values: NDArray[Any], weight: NDArray[Any]) -> Float:
    """Reshape [out] to float64 [out, 1, ...], so that it multiplies a weight."""
    return values.astype(np.float64).reshape(-1, *[1] * (weight.ndim - 1))


def quantize(float_graph: Graph) -> onnx.ModelProto:
    """Quantise a float graph.

    Raises:
        InputError: the graph is not that of network paper.
    """
    writer = Writer()
    joined = []
    for name, sign in (("up", 1.0), ("down", -1.0)):
        limit, _, *block, concat = float_graph.chain(name, ("Clip", "Transpose", *CONV, "Concat"))
        bounds = [float_graph.constant(limit, i) for i in (1, 2)]
        inputs = [writer.constant(f"{name}.clip_{end}", b) for end, b in zip(("low", "high"), bounds, strict=True)]
        clipped = writer.node("Clip", [name, *inputs], f"{name}.clipped")
        row = [writer.constant(f"{name}.row_{k}", np.array([v])) for k, v in (("start", 0), ("end", 1), ("axis", 2))]
        residual = writer.node("Slice", [clipped, *row], f"{name}.residual")
        rate = np.clip(sign * float(float_graph.metadata["table_dps"]), *bounds)
        joined.append(_convolution(writer, float_graph, block, residual, name, constant_row=rate.item()))
    block = float_graph.chain(concat.output[0], CONV)
    x = writer.node("Concat", joined, "joined", axis=1)
    x = _convolution(writer, float_graph, block, x, "combined")
    _, fc1, _, fc2 = float_graph.chain(block[-1].output[0], ("Reshape", "Gemm", "Tanh", "Gemm"))
    x = writer.node("Flatten", [x], "flat", axis=1)
    x = writer.node("Tanh", [_dense(writer, float_graph, fc1, x, "fc1")], "hidden")
    _dense(writer, float_graph, fc2, x, "fc2", output="y")

    batch = [helper.make_tensor_value_info(i, TensorProto.FLOAT, ["N", 1, 2, float_graph.window]) for i in ("up", "down")]
    y = helper.make_tensor_value_info("y", TensorProto.FLOAT, ["N", 2])
    graph = helper.make_graph(writer.nodes, f"{float_graph.metadata['name']}_int8", batch, [y], writer.constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10, producer_name="gyrocal")
    helper.set_model_props(model, float_graph.metadata)
    return model


class Writer:
    """Collects the nodes and constants of a new graph."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.constants: list[TensorProto] = []

    def node(self, op: str, inputs: list[str], output: str, **attributes: Any) -> str:
        """Append a node, and return the name of its output."""
        self.nodes.append(helper.make_node(op, inputs, [output], name=output, **attributes))
        return output

    def constant(self, name: str, value: NDArray[Any]) -> str:
        """Append a constant tensor, and return its name."""
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(value), name))
        return name

    def weight(self, name: str, code: NDArray[np.int8], step: NDArray[np.float32]) -> str:
        """Append an int8 weight with the step of each channel, and return the name of the dequantized weight."""
        parts = [self.constant(f"{name}.code", code), self.constant(f"{name}.step", step)]
        return self.node("DequantizeLinear", parts, f"{name}.weight", axis=0)


def _convolution(
    writer: Writer, graph: Graph, block: list[onnx.NodeProto], x: str, name: str, constant_row: float | None = None
) -> str:
    norm, conv, pool, leaky = block
    gain, shift, mean, variance = (graph.constant(norm, i).astype(np.float64) for i in (1, 2, 3, 4))
    g = gain / np.sqrt(variance + attribute(norm, "epsilon", 1e-5))
    offset = shift / g - mean  # g x' + shift' = g (x + offset)
    weight = graph.constant(conv, 1).astype(np.float64) * g[None, :, None, None]
    bias = graph.constant(conv, 2).astype(np.float64)
    if constant_row is not None:
        bias += weight[:, 1].sum(axis=(1, 2)) * (constant_row + offset[1])
        weight, offset = weight[:, :1], offset[:1]
    code, step = codes(weight)
    bias += np.einsum("oikl,i->o", code * by_channel(step, code), offset)
    inputs = [x, writer.weight(name, code, step), writer.constant(f"{name}.bias", bias.astype(np.float32))]
    x = writer.node("Conv", inputs, f"{name}.conv")
    length = attribute(pool, "kernel_shape", [1, 1])
    x = writer.node("AveragePool", [x], f"{name}.pool", kernel_shape=length, strides=length)
    return writer.node("LeakyRelu", [x], f"{name}.leaky", alpha=attribute(leaky, "alpha", 0.01))


def _dense(writer: Writer, graph: Graph, gemm: onnx.NodeProto, x: str, name: str, output: str | None = None) -> str:
    if attribute(gemm, "transB", 0) != 1:
        raise graph.error("a Gemm's weight is not [out, in]")
    code, step = codes(graph.constant(gemm, 1).astype(np.float64))
    inputs = [x, writer.weight(name, code, step), writer.constant(f"{name}.bias", graph.constant(gemm, 2))]
    return writer.node("Gemm", inputs, output or name, transB=1)
