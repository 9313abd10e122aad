"""Network `gyrocal` as ONNX, float and with int8 weights.

The graph is written layer by layer, each constant under its own name, so that the C table can be read from the quantised graph.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper

from gyrocal_export.nets.gyrocal import LARGEST_LOG_PRECISION, STAGES, GyrocalNet
from gyrocal_export.quantize import Writer, codes

LAYERS = ("first", "second", "third", "fourth", "last")
PARTS = 6
"""Times in one part of the third layer's sum."""
POOLED = {"first": "pool", "second": "second_pool"}
"""The names of the convolutions, each with the average pool that follows it."""


def to_onnx(net: GyrocalNet, metadata: dict[str, str], *, int8: bool) -> onnx.ModelProto:
    """The network as a graph. With ``int8`` its weights are codes with one step for each output.

    Inputs ``readings`` float32 [N, 1, samples] (of one face less their mean, deg/s, turned so that the true rate is positive,
    zero beyond the stage) and ``stage`` [N, 3] (one-hot: 2, 4, 6 s); output ``y`` [N, 2]: u less the mean in ``unit_dps`` of
    the metadata, and the logarithm of its precision in the same unit.
    """
    writer, shape = Writer(), net.shape
    numbers = {name: value.detach().numpy() for name, value in net.named_parameters()}

    def constant(name: str, value: Any) -> str:
        return writer.constant(name, np.asarray(value, np.float32))

    def weight(layer: str, value: NDArray[Any]) -> str:
        if not int8:
            return constant(f"{layer}.weight", value)
        return writer.weight(layer, *codes(value.astype(np.float64)))

    def convolution(layer: str, x: str, dilation: int) -> str:
        inputs = [x, weight(layer, numbers[f"{layer}.weight"]), constant(f"{layer}.bias", numbers[f"{layer}.bias"])]
        x = writer.node("Conv", inputs, f"{layer}.conv", dilations=[dilation])
        length = [getattr(shape, POOLED[layer])]
        x = writer.node("AveragePool", [x], f"{layer}.pool", kernel_shape=length, strides=length)
        return writer.node("LeakyRelu", [x], f"{layer}.leaky", alpha=shape.leak)

    def dense(layer: str, x: str) -> str:
        inputs = [x, weight(layer, numbers[f"{layer}.weight"]), constant(f"{layer}.bias", numbers[f"{layer}.bias"])]
        return writer.node("Gemm", inputs, f"{layer}.sum", transB=1)

    def of_stage(name: str, value: NDArray[Any]) -> str:
        return writer.node("MatMul", ["stage", constant(name, value)], f"{name}.of_stage")

    columns, times = STAGES * shape.stage_columns, shape.features(STAGES - 1)
    x = writer.node("Mul", ["readings", constant("gain", 1 / net.sizes.unit_dps)], "x")
    h = convolution("second", convolution("first", x, shape.pool), 1)
    # features by time, then channel: those that a stage has come first
    h = writer.node("Transpose", [h], "by_time", perm=[0, 2, 1])
    h = writer.node("Flatten", [h], "features", axis=1)
    seen = np.arange(times)[None] < [[shape.features(k)] for k in range(STAGES)]
    h = writer.node("Mul", [h, of_stage("seen", np.repeat(seen, shape.second_channels, axis=1))], "features.seen")
    by_time = numbers["third.weight"].reshape(-1, shape.second_channels, times).swapaxes(1, 2)
    h = _sum_of_parts(writer, h, weight("third", by_time.reshape(len(by_time), -1)), times, shape.second_channels)
    h = writer.node("Add", [h, of_stage("start", numbers["start"])], "third.started")
    h = writer.node("LeakyRelu", [h], "third.leaky", alpha=shape.leak)
    h = writer.node("LeakyRelu", [dense("fourth", h)], "fourth.leaky", alpha=shape.leak)
    out = dense("last", h)

    means = writer.node("AveragePool", ["x"], "columns", kernel_shape=[shape.pool], strides=[shape.pool])
    means = writer.node("Flatten", [means], "columns.flat", axis=1)
    weighed = writer.node("Mul", [means, of_stage("straight", numbers["straight"])], "weighed")
    line = writer.node("ReduceSum", [weighed, writer.constant("axis", np.array([1], np.int64))], "line", keepdims=1)
    writer.constant("outputs", np.array([1, 1], np.int64))
    writer.nodes.append(helper.make_node("Split", [out, "outputs"], ["correction", "log"], name="split", axis=1))
    low, high = (constant(f"log_precision.{end}", sign * LARGEST_LOG_PRECISION) for end, sign in (("low", -1), ("high", 1)))
    parts = [writer.node("Add", [line, "correction"], "corrected"), writer.node("Clip", ["log", low, high], "log.clipped")]
    writer.node("Concat", parts, "y", axis=1)

    return _model(writer, {"readings": (1, columns * shape.pool), "stage": (STAGES,), "y": (2,)}, metadata, int8=int8)


def _model(
    writer: Writer, shapes: dict[str, tuple[int, ...]], metadata: dict[str, str], *, int8: bool
) -> onnx.ModelProto:
    """The nodes as a checked model. The last of the ``shapes``, without the batch, is that of the output."""
    rows = [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["N", *size]) for name, size in shapes.items()]
    graph = helper.make_graph(writer.nodes, "gyrocal_int8" if int8 else "gyrocal", rows[:-1], rows[-1:], writer.constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10, producer_name="gyrocal")
    helper.set_model_props(model, metadata)
    onnx.checker.check_model(model, full_check=True)
    return model


def _sum_of_parts(writer: Writer, x: str, weight: str, times: int, channels: int) -> str:
    """``x`` [N, times · channels] times ``weight``, summed in parts: the terms cancel, and a long sum has larger errors."""
    sizes = [channels * len(part) for part in np.array_split(np.arange(times), PARTS)]
    writer.constant("third.sizes", np.array(sizes, np.int64))
    pieces = {name: [f"third.{name}.{i}" for i in range(len(sizes))] for name in ("input", "weight")}
    for name, whole in (("input", x), ("weight", weight)):
        writer.nodes.append(helper.make_node("Split", [whole, "third.sizes"], pieces[name], name=f"third.{name}.split", axis=1))
    pairs = zip(pieces["input"], pieces["weight"], strict=True)
    sums = [writer.node("Gemm", list(pair), f"third.sum.{i}", transB=1) for i, pair in enumerate(pairs)]
    return writer.node("Sum", sums, "third.sum")
