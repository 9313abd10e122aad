"""``gyrocal export``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from gyrocal.errors import GyrocalError

Axis = Literal["x", "y", "z"]


def run(
    run_folder: Annotated[Path | None, typer.Option("--run", help="Run folder of `gyrocal train`.")] = None,
    model: Annotated[str | None, typer.Option(help="Error model (name or TOML) to write as calibration.h.")] = None,
    axis: Annotated[Axis, typer.Option(help="The sensor's axis that calibration.h is for.")] = "z",
    out: Annotated[Path, typer.Option(help="Folder for the files.")] = Path("export"),
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Write the network as ONNX, quantised ONNX and C header; with --model the error model as C header too.

    Without --run it is the network that ships.
    """
    from gyrocal_export.export import export_run, export_shipped
    from gyrocal_export.files import write_all

    try:
        contents = export_run(run_folder) if run_folder else export_shipped()
    except ImportError as error:
        raise GyrocalError(f"exporting a run needs {error.name}: pip install 'gyrocal[train]'") from error
    if model is not None:
        from gyrocal.calibration import header
        from gyrocal.error_model.model import Model

        contents["calibration.h"] = header.render(Model.open(model), axis).encode()
    written = [str(path) for path in write_all(out, contents)]
    print(json.dumps({"files": written}) if as_json else "\n".join(written))
