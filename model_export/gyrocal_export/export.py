"""A trained network -> the files that host and device read."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from gyrocal_firmware import INCLUDE

FILES = ("model.onnx", "model.int8.onnx", "model.json", "weights.h")


def export_run(run: Path) -> dict[str, bytes]:
    """The files of a run folder's network, by name: float ONNX, quantised ONNX, how it was made, C header.

    Raises:
        InputError: not a run folder.
    """
    from gyrocal_export.c_header import c_header
    from gyrocal_export.graph import Graph
    from gyrocal_export.quantize import quantize
    from gyrocal_export.to_onnx import to_onnx
    from gyrocal_export.train import load

    net, metadata = load(run)
    model = to_onnx(net, metadata)
    quantised = quantize(Graph(model, str(run)))
    contents = (
        model.SerializeToString(deterministic=True),
        quantised.SerializeToString(deterministic=True),
        (run / "made_by.json").read_bytes(),
        c_header(Graph(quantised, str(run))).encode(),
    )
    return dict(zip(FILES, contents, strict=True))


def export_shipped() -> dict[str, bytes]:
    """The same files of the network that ships; needs neither torch nor onnx."""
    data = files("gyrocal") / "data"
    shipped = [(data / name).read_bytes() for name in ("paper.onnx", "paper.int8.onnx", "paper.json")]
    return dict(zip(FILES, [*shipped, (INCLUDE / "weights.h").read_bytes()], strict=True))
