"""``gyrocal train``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from gyrocal.errors import GyrocalError, InputError


def run(
    sessions: Annotated[list[Path] | None, typer.Argument(help="Sessions to train on; simulated data if none.")] = None,
    net: Annotated[str, typer.Option(help="Which network; `paper` is the only one.")] = "paper",
    out: Annotated[Path | None, typer.Option(help="Run folder, runs/NET-SEED by default.")] = None,
    seed: Annotated[int, typer.Option(help="Of weights, data and order.", min=0)] = 0,
    epochs: Annotated[int, typer.Option(help="At most so many.", min=1)] = 40,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Train the network from sessions, or from fresh simulations of the paper's campaign."""
    if net != "paper":
        raise InputError(f"no network named {net!r}; there is `paper`")
    try:
        from gyrocal_export.train import Config, train
    except ImportError as error:
        raise GyrocalError(f"training needs {error.name}: pip install 'gyrocal[train]'") from error
    from rich.console import Console
    from rich.progress import Progress, TextColumn

    folder = out or Path("runs") / f"{net}-{seed}"
    config = Config(net=net, sessions=tuple(map(str, sessions or ())), seed=seed, epochs=epochs)
    columns = (*Progress.get_default_columns(), TextColumn("{task.fields[note]}"))
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task(f"train {net}", total=epochs, note="")

        def report(epoch: int, trained: float, checked: float) -> None:
            progress.update(task, completed=epoch + 1, note=f"loss {trained:.3f}, validation {checked:.3f}")

        metrics = train(config, folder, report)
    if as_json:
        print(json.dumps({"run": str(folder), **metrics}))
        return
    print(f"{folder}: best epoch {metrics['best_epoch']}, validation loss {metrics['validation_loss']:.3f}")
    for row in metrics["errors"]:
        errors = f"scale {row['scale_mae']:.6f}  bias {row['bias_mae_dps']:.4f} dps"
        print(f"  {row['method']:8} {row['seconds']:g} s  {errors}")
    print(f"next: gyrocal export --run {folder}")
