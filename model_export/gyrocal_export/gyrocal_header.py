"""``gc_gyrocal``, the table of network `gyrocal` that the C kernel reads: in float32, and in integers for GC_NET_FIXED."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import helper, numpy_helper

from gyrocal.errors import InputError
from gyrocal_export.c_header import array, literal
from gyrocal_export.fixed_point import FixedPoint, by_time, fixed_point
from gyrocal_export.gyrocal_onnx import LAYERS, POOLED
from gyrocal_export.nets.gyrocal import STAGES

Constants = Mapping[str, NDArray[Any]]
CODE = "gc_convnet_code_t"
"""The type of a weight's code."""


def tables(model: onnx.ModelProto, source: str) -> str:
    """The C table of the quantised graph, which depends on the graph alone.

    Raises:
        InputError: the graph is not a quantised network gyrocal.
    """
    constants = {i.name: numpy_helper.to_array(i) for i in model.graph.initializer}
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    nodes = {n.name: {a.name: helper.get_attribute_value(a) for a in n.attribute} for n in model.graph.node}
    leaks = {nodes[n.name]["alpha"] for n in model.graph.node if n.op_type == "LeakyRelu"}
    wanted = [f"{layer}.{part}" for layer in LAYERS for part in ("code", "step")]
    wanted += ["first.bias", "second.bias", "start", "fourth.bias", "last.bias", "straight"]
    if metadata.get("name") != "gyrocal" or any(name not in constants for name in wanted) or len(leaks) != 1:
        raise InputError(f"{source}: not the quantised graph of network gyrocal; write one with `gyrocal export`")

    leak = float(leaks.pop())
    pools = {layer: nodes[f"{layer}.pool"]["kernel_shape"][0] for layer in POOLED}
    column_range = float(metadata["column_range_dps"]) / float(metadata["unit_dps"])
    integers = fixed_point(constants, column_range, pools["second"], leak)
    codes = "".join(_array(CODE, f"{layer}_code", constants[f"{layer}.code"]) for layer in LAYERS if layer != "second")
    said = "".join(
        f"    .{name} = {literal(float(metadata[name]))},\n"
        for name in ("rate_hz", "table_dps", "unit_dps", "column_range_dps", "sample_range_dps")
    )
    return f"""{codes}
#if !GC_NET_FIXED
{_floats(constants, pools["second"])}#else
{_integers(constants, integers)}#endif

static const gc_convnet_t gc_gyrocal = {{
    .name = "{metadata["name"]}",
{said}    .log_precision = {literal(constants["log_precision.high"].item())},
    .pool = {pools["first"]},
    .stage_columns = {constants["straight"].shape[1] // STAGES},
{_shapes(constants, pools["second"])}    .hidden = {constants["start"].shape[1]},
#if !GC_NET_FIXED
    .leak = {literal(leak)},
    .straight = gc_gyrocal_straight,
{_layers("step", "bias", LAYERS)}#else
    .leak = {integers.leak},
    .columns_a_unit = {literal(integers.columns_a_unit)},
    .straight = gc_gyrocal_straight_code,
    .straight_step = gc_gyrocal_straight_step,
    .last_step = gc_gyrocal_last_unit,
{_layers("gain", "start", LAYERS[:-1])}    .last_layer = {{.code = gc_gyrocal_last_code, .start = gc_gyrocal_last_start}},
#endif
}};
"""


def _floats(constants: Constants, pool: int) -> str:
    text = _array(CODE, "second_code", constants["second.code"]) + _array("float", "straight", constants["straight"])
    for layer in LAYERS:
        step, bias = constants[f"{layer}.step"], constants["start" if layer == "third" else f"{layer}.bias"]
        text += _array("float", f"{layer}_step", step / pool if layer == "second" else step)
        text += _array("float", f"{layer}_bias", bias)
    return text


def _integers(constants: Constants, numbers: FixedPoint) -> str:
    text = _array(CODE, "second_code", by_time(constants["second.code"]))
    text += _array("int16_t", "straight_code", numbers.straight) + _array("float", "straight_step", numbers.straight_step)
    for name, layer in numbers.layers.items():
        text += _array("int32_t", f"{name}_gain", layer.gain) + _array("int32_t", f"{name}_start", layer.start)
    return text + _array("int32_t", "last_start", numbers.last_start) + _array("float", "last_unit", numbers.last_step)


def _shapes(constants: Constants, pool: int) -> str:
    """The convolutions. The kernel takes columns, so that the first one has no pool."""
    text, columns = "", constants["straight"].shape[1]
    for layer, pooled in (("first", 1), ("second", pool)):
        code = constants[f"{layer}.code"]
        columns = (columns - code.shape[2] + 1) // pooled
        shape = {"channels": len(code), "kernel": code.shape[2], "pool": pooled, "columns": columns}
        text += f"    .{layer} = {{" + ", ".join(f".{name} = {value}" for name, value in shape.items()) + "},\n"
    return text


def _layers(step: str, bias: str, layers: tuple[str, ...]) -> str:
    return "".join(
        f"    .{layer}_layer = {{gc_gyrocal_{layer}_code, gc_gyrocal_{layer}_{step}, gc_gyrocal_{layer}_{bias}}},\n"
        for layer in layers
    )


def _array(kind: str, name: str, values: NDArray[Any]) -> str:
    form = literal if kind == "float" else str
    return array(kind, f"gc_gyrocal_{name}", [form(v) for v in np.ravel(values)])
