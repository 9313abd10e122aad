"""A trained network as ONNX."""

from __future__ import annotations

import logging
import warnings

import onnx
import torch

from gyrocal_export.nets.paper import PaperNet

OPSET = 18


def to_onnx(net: PaperNet, metadata: dict[str, str]) -> onnx.ModelProto:
    """The network as an ONNX graph: inputs ``up``, ``down`` float32 [N, 1, 2, window], output ``y`` [N, 2].

    ``metadata`` (name, rate_hz, table_dps) is stored in the graph.
    """
    net = net.folded()
    shape = (2, 1, 2, net.shape.window)
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        program = torch.onnx.export(
            net,
            (torch.zeros(shape), torch.ones(shape)),
            dynamo=True,
            opset_version=OPSET,
            input_names=["up", "down"],
            output_names=["y"],
            dynamic_shapes=({0: "N"}, {0: "N"}),
            verbose=False,
        )
    assert program is not None
    model = program.model_proto
    strip(model)
    onnx.helper.set_model_props(model, metadata)
    return model


def strip(model: onnx.ModelProto) -> None:
    """Remove the exporter's notes about the machine and the files on which it ran."""
    graph = model.graph
    for part in (*graph.node, *graph.initializer, *graph.input, *graph.output, *graph.value_info, graph):
        part.ClearField("metadata_props")
        part.ClearField("doc_string")
    graph.ClearField("value_info")
