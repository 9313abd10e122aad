"""Network `gyrocal` as ONNX, float and with int8 weights, and as the table that the C kernel reads.

The graph is written layer by layer, each constant under its own name, so that the C table is read off the quantised graph.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from gyrocal.errors import InputError
from gyrocal_export.c_header import array, literal
from gyrocal_export.nets.gyrocal import BLOCKS, LARGEST_LOG_PRECISION, STAGES, GyrocalNet, stage_blocks
from gyrocal_export.quantize import Writer, codes

LAYERS = ("first", "second", "last")
INPUTS = ("up", "down", "stage")


def to_onnx(net: GyrocalNet, metadata: dict[str, str], *, int8: bool) -> onnx.ModelProto:
    """The graph; with ``int8`` its weights are codes and a step an output.

    Inputs ``up``, ``down`` float32 [N, 24] (block means of measured - true rate, deg/s), ``stage`` [N, 3] (one-hot: 2, 4, 6 s);
    output ``y`` [N, 4]: scale, bias_dps and their standard deviations.
    """
    writer, know = Writer(), net.knowledge

    def constant(name: str, value: Any) -> str:
        return writer.constant(name, np.asarray(value, np.float32))

    def number(name: str) -> NDArray[np.float32]:
        return {**dict(net.named_parameters()), **dict(net.named_buffers())}[name].detach().numpy()

    for layer in LAYERS:
        weight = number(f"{layer}.weight").astype(np.float64)
        if int8:
            writer.weight(layer, *codes(weight))
        else:
            constant(f"{layer}.weight", weight)
    for name in ("second.bias", "last.bias", "straight", "start"):
        constant(name, number(name))
    constant("seen", stage_blocks().numpy())
    constant("clip.low", -know.clip_dps)
    constant("clip.high", know.clip_dps)
    constant("log_precision.low", -LARGEST_LOG_PRECISION)
    constant("log_precision.high", LARGEST_LOG_PRECISION)
    writer.constant("columns", np.array([1, 1], np.int64))
    writer.constant("axis", np.array([1], np.int64))
    a, b = know.scale_units, know.bias_units
    for name, value in {
        "gain.up": 1 / know.unit_dps, "gain.down": -1 / know.unit_dps,
        "offset.up": -know.center_dps[0] / know.unit_dps, "offset.down": -know.center_dps[1] / know.unit_dps,
        "a": a, "b": b, "prior.mean": [know.scale[0], know.bias_dps[0]], "prior.sd": [know.scale[1], know.bias_dps[1]],
        "one": 1.0, "two": 2.0,
    }.items():  # fmt: skip
        constant(name, value)

    seen = writer.node("MatMul", ["stage", "seen"], "seen_blocks")
    straight = writer.node("MatMul", ["stage", "straight"], "straight_weights")
    start = writer.node("MatMul", ["stage", "start"], "start_biases")
    faces = [_face(writer, face, net.shape.leak, seen, straight, start) for face in ("up", "down")]
    _merge(writer, faces)
    rows = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, ["N", width])
        for name, width in zip((*INPUTS, "y"), (BLOCKS, BLOCKS, STAGES, 4), strict=True)
    ]
    graph = helper.make_graph(writer.nodes, "gyrocal_int8" if int8 else "gyrocal", rows[:3], rows[3:], writer.constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10, producer_name="gyrocal")
    helper.set_model_props(model, metadata)
    onnx.checker.check_model(model, full_check=True)
    return model


def _face(writer: Writer, face: str, leak: float, seen: str, straight: str, start: str) -> tuple[str, str]:
    """A face's mean and precision of u, [N, 1] each."""

    def node(op: str, inputs: list[str], name: str, **attributes: Any) -> str:
        return writer.node(op, inputs, f"{face}.{name}", **attributes)

    clipped = node("Clip", [face, "clip.low", "clip.high"], "clipped")
    turned = node("Mul", [clipped, f"gain.{face}"], "turned")
    centered = node("Add", [turned, f"offset.{face}"], "centered")
    x = node("Mul", [centered, seen], "x")
    h = node("Gemm", [x, "first.weight"], "first", transB=1)
    h = node("LeakyRelu", [node("Add", [h, start], "started")], "first_leaky", alpha=leak)
    h = node("Gemm", [h, "second.weight", "second.bias"], "second", transB=1)
    h = node("LeakyRelu", [h], "second_leaky", alpha=leak)
    out = node("Gemm", [h, "last.weight", "last.bias"], "last", transB=1)
    writer.nodes.append(
        helper.make_node("Split", [out, "columns"], [f"{face}.correction", f"{face}.log"], name=f"{face}.split", axis=1)
    )
    line = node("ReduceSum", [node("Mul", [straight, x], "weighed"), "axis"], "line", keepdims=1)
    mean = node("Add", [line, f"{face}.correction"], "mean")
    log = node("Clip", [f"{face}.log", "log_precision.low", "log_precision.high"], "log_clipped")
    return mean, node("Exp", [log], "precision")


def _merge(writer: Writer, faces: list[tuple[str, str]]) -> None:
    """:func:`gyrocal_export.nets.gyrocal.merge`, and the answer in its units."""
    (m_up, p_up), (m_down, p_down) = faces
    count = 0

    def binary(op: str, left: str, right: str, name: str | None = None) -> str:
        nonlocal count
        count += 1
        return writer.node(op, [left, right], name or f"merge.{count}")

    def add(left: str, right: str) -> str:
        return binary("Add", left, right)

    def mul(left: str, right: str) -> str:
        return binary("Mul", left, right)

    aa, bb = mul("a", "a"), mul("b", "b")
    both, cross = add(p_up, p_down), mul("two", mul(p_up, p_down))
    det = add(add("one", mul(add(aa, bb), both)), mul(mul("two", mul(aa, bb)), cross))
    up, down = mul(p_up, m_up), mul(p_down, m_down)
    s = mul("a", add(add(up, down), mul(mul(bb, cross), add(m_up, m_down))))
    t = mul("b", add(binary("Sub", up, down), mul(mul(aa, cross), binary("Sub", m_up, m_down))))
    mean = writer.node("Concat", [binary("Div", s, det), binary("Div", t, det)], "mean", axis=1)
    parts = [binary("Div", add("one", mul(square, both)), det) for square in (bb, aa)]
    sd = writer.node("Sqrt", [writer.node("Concat", parts, "variance", axis=1)], "sd")
    value = add("prior.mean", mul("prior.sd", mean))
    writer.node("Concat", [value, mul("prior.sd", sd)], "y", axis=1)


def tables(model: onnx.ModelProto, source: str) -> str:
    """``gc_blocks``, the C table of the quantised graph.

    Raises:
        InputError: not a quantised network gyrocal.
    """
    constants = {i.name: numpy_helper.to_array(i) for i in model.graph.initializer}
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    leaks = {helper.get_attribute_value(n.attribute[0]) for n in model.graph.node if n.op_type == "LeakyRelu"}
    wanted = [f"{layer}.{part}" for layer in LAYERS for part in ("code", "step")]
    wanted += ["start", "second.bias", "last.bias", "straight", "gain.up", "offset.up", "a", "b", "prior.mean", "prior.sd"]
    if metadata.get("name") != "gyrocal" or any(name not in constants for name in wanted) or len(leaks) != 1:
        raise InputError(f"{source}: not the quantised graph of network gyrocal; write one with `gyrocal export`")

    def pair(first: Any, second: Any) -> str:
        return f"{{{literal(first.item())}, {literal(second.item())}}}"

    text, layers = array("float", "gc_blocks_straight", [literal(v) for v in constants["straight"].ravel()]), ""
    for layer in LAYERS:
        bias = constants["start" if layer == "first" else f"{layer}.bias"]
        text += array("int8_t", f"gc_blocks_{layer}_code", [str(v) for v in constants[f"{layer}.code"].ravel()])
        text += array("float", f"gc_blocks_{layer}_step", [literal(v) for v in constants[f"{layer}.step"]])
        text += array("float", f"gc_blocks_{layer}_bias", [literal(v) for v in bias.ravel()])
        layers += f"    .{layer} = {{gc_blocks_{layer}_code, gc_blocks_{layer}_step, gc_blocks_{layer}_bias}},\n"
    return (
        text
        + f"""
static const gc_blocknet_t gc_blocks = {{
    .name = "{metadata["name"]}",
    .rate_hz = {literal(float(metadata["rate_hz"]))},
    .table_dps = {literal(float(metadata["table_dps"]))},
    .clip_dps = {literal(constants["clip.high"].item())},
    .leak = {literal(leaks.pop())},
    .log_precision = {literal(constants["log_precision.high"].item())},
    .gain = {pair(constants["gain.up"], constants["gain.down"])},
    .offset = {pair(constants["offset.up"], constants["offset.down"])},
    .units = {pair(constants["a"], constants["b"])},
    .mean = {pair(*constants["prior.mean"])},
    .sd = {pair(*constants["prior.sd"])},
    .hidden = {len(constants["second.bias"])},
    .straight = gc_blocks_straight,
{layers}}};
"""
    )
