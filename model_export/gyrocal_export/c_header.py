"""``weights.h``, the table that the C kernel reads, from quantised ONNX."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyrocal_export.graph import Graph, attribute

BLOCK = 4  # GC_CNN_BLOCK


def c_header(graph: Graph, convnet: str = "") -> str:
    """The text of the header, which depends on the graph alone. ``convnet`` is the table of network gyrocal, if that answers.

    Raises:
        InputError: the graph is not a quantised network paper, or the kernel does not compute its shape.
    """
    arrays: list[str] = []
    heads = {}
    for name in ("up", "down"):
        limit, _, conv, pool, leaky = graph.chain(name, ("Clip", "Slice", "Conv", "AveragePool", "LeakyRelu"))
        low, high = (graph.constant(limit, i).item() for i in (1, 2))
        if low != -high:
            raise graph.error(f"{name} is clipped to [{low:g}, {high:g}], not to +- one value")
        code, step = graph.quantised(conv)
        heads[name] = _conv_shape(graph, conv, pool, graph.window), leaky
        arrays.append(_layer(name, code, step / heads[name][0]["pool"], graph.constant(conv, 2)))
    shape, leaky = heads["up"]
    if heads["down"][0] != shape or attribute(heads["down"][1], "alpha", 0.01) != attribute(leaky, "alpha", 0.01):
        raise graph.error("the heads differ in shape")

    _, conv, pool, leaky2, _, fc1, _, fc2 = graph.chain(
        leaky.output[0], ("Concat", "Conv", "AveragePool", "LeakyRelu", "Flatten", "Gemm", "Tanh", "Gemm")
    )
    leak = attribute(leaky, "alpha", 0.01)
    if attribute(leaky2, "alpha", 0.01) != leak:
        raise graph.error("the LeakyRelu nodes differ")
    code, step = graph.quantised(conv)
    combined = _conv_shape(graph, conv, pool, shape["columns"])
    arrays.append(_layer("combined", code, step / combined["pool"], graph.constant(conv, 2)))
    sizes = []
    for name, gemm in (("fc1", fc1), ("fc2", fc2)):
        code, step = graph.quantised(gemm)
        arrays.append(_layer(name, code, step, graph.constant(gemm, 2)))
        sizes.append(len(code))
    hidden, outputs = sizes

    rows = shape["channels"] * shape["columns"]
    sums = BLOCK * max(shape["kernel"], shape["channels"] * combined["kernel"])
    scratch = combined["channels"] * combined["columns"] + max(rows + sums, hidden)
    meta = graph.metadata
    return TEMPLATE.format(
        names=f"`{meta['name']}`" + (" and `gyrocal`" if convnet else ""),
        include="gc_convnet.h" if convnet else "gc_cnn.h",
        table=f"{convnet}\n" if convnet else "",
        convnet="    .convnet = &gc_gyrocal,\n" if convnet else "",
        name=meta["name"],
        arrays="\n".join(arrays),
        scratch=scratch,
        rate=literal(float(meta["rate_hz"])),
        table_dps=literal(float(meta["table_dps"])),
        clip=literal(high),
        leak=literal(leak),
        window=graph.window,
        head=_initialiser(shape),
        combined=_initialiser(combined),
        hidden=hidden,
        outputs=outputs,
    )


TEMPLATE = """\
/* Written by `gyrocal export` from the quantised graph of network {names}; do not edit. */
#ifndef GYROCAL_WEIGHTS_H
#define GYROCAL_WEIGHTS_H

#include "{include}"

#define GC_NET_SCRATCH_FLOATS {scratch}

{arrays}
{table}static const gc_cnn_net_t gc_net = {{
    .name = "{name}",
    .rate_hz = {rate},
    .table_dps = {table_dps},
    .clip_dps = {clip},
    .leak = {leak},
    .window = {window},
    .head = {head},
    .combined = {combined},
    .hidden = {hidden},
    .outputs = {outputs},
    .scratch_floats = GC_NET_SCRATCH_FLOATS,
    .up = {{gc_net_up_code, gc_net_up_step, gc_net_up_bias}},
    .down = {{gc_net_down_code, gc_net_down_step, gc_net_down_bias}},
    .combined_conv = {{gc_net_combined_code, gc_net_combined_step, gc_net_combined_bias}},
    .fc1 = {{gc_net_fc1_code, gc_net_fc1_step, gc_net_fc1_bias}},
    .fc2 = {{gc_net_fc2_code, gc_net_fc2_step, gc_net_fc2_bias}},
{convnet}}};

#endif
"""


GYROCAL_ALONE = """\
/* Written by `gyrocal export` from the quantised graph of network `gyrocal`; do not edit. */
#ifndef GYROCAL_WEIGHTS_H
#define GYROCAL_WEIGHTS_H

#include "gc_convnet.h"

#define GC_NET_SCRATCH_FLOATS 1

{table}
static const gc_cnn_net_t gc_net = {{
    .name = "{name}",
    .rate_hz = {rate_hz},
    .table_dps = {table_dps},
    .convnet = &gc_gyrocal,
}};

#endif
"""


def c_header_of_gyrocal(convnet: str, metadata: dict[str, str]) -> str:
    """The text of a header with network gyrocal alone."""
    rate_hz, table_dps = (literal(float(metadata[name])) for name in ("rate_hz", "table_dps"))
    return GYROCAL_ALONE.format(table=convnet, name=metadata["name"], rate_hz=rate_hz, table_dps=table_dps)


def _conv_shape(graph: Graph, conv: Any, pool: Any, length: int) -> dict[str, int]:
    code, _ = graph.quantised(conv)
    kernel, pooled = code.shape[3], attribute(pool, "kernel_shape", [1, 1])[1]
    columns = (length - kernel + 1) // pooled
    if columns < 1 or columns % BLOCK:
        raise graph.error(f"{columns} columns after a pool; the C kernel computes {BLOCK} at a time")
    return {"channels": len(code), "kernel": kernel, "pool": pooled, "columns": columns}


def _initialiser(shape: dict[str, int]) -> str:
    return "{" + ", ".join(f".{name} = {value}" for name, value in shape.items()) + "}"


def _layer(name: str, code: NDArray[np.int8], step: NDArray[Any], bias: NDArray[Any]) -> str:
    return (
        array("int8_t", f"gc_net_{name}_code", [str(v) for v in code.ravel()])
        + array("float", f"gc_net_{name}_step", [literal(v) for v in step])
        + array("float", f"gc_net_{name}_bias", [literal(v) for v in bias])
    )


def array(kind: str, name: str, values: list[str]) -> str:
    """The lines of a C array of ``kind`` that holds ``values``."""
    lines, line = [], "   "
    for value in values:
        if len(line) + len(value) > 116:
            lines.append(line)
            line = "   "
        line += f" {value},"
    return f"static const {kind} {name}[{len(values)}] = {{\n" + "\n".join([*lines, line]) + "\n};\n"


def literal(value: float) -> str:
    """A C literal that reads back as the same float32."""
    text = f"{np.float32(value):.9g}"
    return text + ("f" if "." in text or "e" in text else ".0f")
