"""``gyrocal export``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from gyrocal.calibration.targets import targets
from gyrocal.errors import INDEX_IS, INSTALL_TRAIN, InputError

FORMATS = ", ".join(["header", *targets()])
Axis = Literal["x", "y", "z"]


def run(
    run_folder: Annotated[Path | None, typer.Option("--run", help="Run folder of `gyrocal train`.")] = None,
    model: Annotated[str | None, typer.Option(help="Error model (name or TOML) to write.")] = None,
    target: Annotated[
        str, typer.Option("--format", metavar="FORMAT", help=f"Who reads the model: {FORMATS}.")
    ] = "header",
    rate_hz: Annotated[float | None, typer.Option(help="The sample rate (kalibr, ros2, slam, vqf).")] = None,
    device_id: Annotated[int | None, typer.Option(help="The gyroscope's device id on the vehicle (px4, ardupilot).")] = None,
    index: Annotated[int | None, typer.Option(help="Its number on the vehicle: px4 from 0, ardupilot from 1.")] = None,
    add_to: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The parameters that had corrected the rates of the model's session.")
    ] = None,
    noise_factor: Annotated[
        float | None, typer.Option(help="Times the measured noise (kalibr, slam), for what a quiet room does not show.")
    ] = None,
    axis: Annotated[Axis, typer.Option(help="The sensor's axis that calibration.h is for.")] = "z",
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the files.")] = Path("export"),
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Write the network and, with --model, the error model as C headers; with --format the model for Kalibr, PX4, ROS 2 ...

    The network is ONNX and quantised ONNX too; without --run it is the one that ships. With --format only the model is written.
    """
    left: dict[str, str] = {}
    vehicle = {"device_id": device_id, "index": index, "add_to": add_to}
    noise = {"noise_factor": noise_factor}
    if target == "header":
        if noise_factor is not None:
            raise InputError("--noise-factor is for --format kalibr and slam")
        if any(value is not None for value in vehicle.values()):
            raise InputError("--device-id, --index and --add-to are for --format px4 and ardupilot")
        contents = _headers(run_folder, model, axis)
    else:
        contents, left = _for_others(target, model, rate_hz, vehicle | noise)
    from gyrocal_export.files import write_all

    written = [str(path) for path in write_all(out, contents)]
    if as_json:
        listed = [{"effect": effect, "why": why} for effect, why in left.items()]
        print(json.dumps({"files": written, "left": listed}))
        return
    print("\n".join([*written, *(f"left out: {effect} ({why})" for effect, why in left.items())]))


def _headers(run_folder: Path | None, model: str | None, axis: Axis) -> dict[str, bytes]:
    """The network's files and, with a model, ``calibration.h``."""
    from gyrocal_export.export import export_run, export_shipped

    try:
        contents = export_run(run_folder) if run_folder else export_shipped()
    except ImportError as error:
        raise InputError(f"exporting a run needs {error.name}: {INSTALL_TRAIN} ({INDEX_IS})") from error
    if model is not None:
        from gyrocal.calibration import header
        from gyrocal.error_model.model import Model

        contents["calibration.h"] = header.render(Model.open(model), axis).encode()
    return contents


def _for_others(
    target: str, model: str | None, rate_hz: float | None, vehicle: dict[str, Any]
) -> tuple[dict[str, bytes], dict[str, str]]:
    """The model's file for another program, and what that program cannot hold."""
    from gyrocal.calibration.targets.base import render
    from gyrocal.error_model.model import Model

    if model is None:
        raise InputError(f"--format {target} writes a model: give it with --model")
    rendered = render(target, Model.open(model), rate_hz, **vehicle)
    return {name: text.encode() for name, text in rendered.files.items()}, dict(rendered.left)
