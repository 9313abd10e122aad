"""The files of a trained network for host and device."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path

from gyrocal_firmware import INCLUDE

FILES = ("model.onnx", "model.int8.onnx", "model.json", "weights.h")


def export_run(run: Path) -> dict[str, bytes]:
    """The files of a run folder's network by name: float ONNX, quantised ONNX, its origin, C header.

    Raises:
        InputError: ``run`` is not a run folder.
    """
    from gyrocal_export.run_folder import load_config

    contents = _gyrocal(run) if load_config(run).get("net") == "gyrocal" else _paper(run)
    return dict(zip(FILES, contents, strict=True))


def _paper(run: Path) -> tuple[bytes, ...]:
    from gyrocal_export.c_header import c_header
    from gyrocal_export.graph import Graph
    from gyrocal_export.quantize import quantize
    from gyrocal_export.to_onnx import to_onnx
    from gyrocal_export.train import load

    net, metadata = load(run)
    model = to_onnx(net, metadata)
    quantised = quantize(Graph(model, str(run)))
    return (
        model.SerializeToString(deterministic=True), quantised.SerializeToString(deterministic=True),
        (run / "made_by.json").read_bytes(), c_header(Graph(quantised, str(run))).encode(),
    )  # fmt: skip


def _gyrocal(run: Path) -> tuple[bytes, ...]:
    from gyrocal_export.c_header import c_header_of_gyrocal
    from gyrocal_export.gyrocal_header import tables
    from gyrocal_export.gyrocal_onnx import to_onnx
    from gyrocal_export.train_gyrocal import load

    net, metadata = load(run)
    model, quantised = (to_onnx(net, metadata, int8=int8) for int8 in (False, True))
    return (
        model.SerializeToString(deterministic=True), quantised.SerializeToString(deterministic=True),
        (run / "made_by.json").read_bytes(), c_header_of_gyrocal(tables(quantised, str(run)), metadata).encode(),
    )  # fmt: skip


def export_shipped() -> dict[str, bytes]:
    """The shipped files: those of networks `paper` and `gyrocal`, and the header that holds both.

    This needs neither torch nor onnx.
    """
    data = files("gyrocal") / "data"
    ends = ("onnx", "int8.onnx", "json")
    shipped = {f"model.{end}": (data / f"paper.{end}").read_bytes() for end in ends}
    header = {"weights.h": (INCLUDE / "weights.h").read_bytes()}
    return shipped | header | {f"gyrocal.{end}": (data / f"gyrocal.{end}").read_bytes() for end in ends}


def shipped_header() -> str:
    """The shipped ``weights.h``, made from the quantised graphs. It holds both networks, and `gyrocal` answers."""
    import onnx

    from gyrocal_export.c_header import c_header
    from gyrocal_export.graph import Graph
    from gyrocal_export.gyrocal_header import tables

    with as_file(files("gyrocal") / "data") as data:
        convnet = tables(onnx.load(data / "gyrocal.int8.onnx"), "gyrocal.int8.onnx")
        return c_header(Graph.open(data / "paper.int8.onnx"), convnet)
