"""``gyrocal verify``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gyrocal.commands import AsJson, Trust, want_trust
from gyrocal.errors import GyrocalError


def run(
    net: Annotated[
        Path | None, typer.Option(help="Quantised ONNX (model.int8.onnx); the shipped one by default.")
    ] = None,
    header: Annotated[
        Path | None,
        typer.Option(help="The weights.h made from it; the shipped one by default. It is compiled and run: needs --trust."),
    ] = None,
    trust: Trust = False,
    windows: Annotated[int, typer.Option(help="How many pairs of windows.", min=12)] = 1200,
    seed: Annotated[int, typer.Option(help="Seed of the windows.", min=0)] = 0,
    as_json: AsJson = False,
) -> None:
    """Run the C core and onnxruntime on the same windows; exit 1 if they differ by more than rounding."""
    from gyrocal.core.verify import verify
    from gyrocal.extras import want
    from gyrocal.present.output import emit

    want("verify", "net")
    if header is not None and header.exists():
        want_trust(trust, f"--header {header}: this C code is compiled, and then run on this machine")
    found = verify(net, header, seed, windows)
    if as_json:
        emit(found)
    else:
        print(
            f"{found['windows']} windows: C and onnxruntime differ by at most {found['max_abs_diff']:.3g}, "
            f"{found['max_diff_of_range']:.2g} of the output's range (allowed {found['tolerance']:g})"
        )
        if found["integers_max_of_se"] is not None:
            print(
                f"In integers (GC_NET_FIXED) the answers of a face differ by at most {found['integers_max_of_se']:.2g} of "
                f"their standard error, rms {found['integers_rms_of_se']:.2g}"
            )
    if not found["ok"]:
        raise GyrocalError("the C core does not give the numbers of the graph: export both together")
