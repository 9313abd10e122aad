"""``gyrocal train``."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Literal

import typer

from gyrocal.errors import INDEX_IS, INSTALL_TRAIN, InputError
from gyrocal.fleet.engine import engine
from gyrocal.present.output import emit

Net = Literal["paper", "gyrocal"]
Axis = Literal["x", "y", "z"]


def run(
    sessions: Annotated[list[Path] | None, typer.Argument(help="Sessions to train `paper` on; simulated data if none.")] = None,
    net: Annotated[Net, typer.Option(help="The paper's network, or ours, which also gives standard deviations.")] = "paper",
    model: Annotated[
        str | None, typer.Option(help="Simulate from this fitted error model (TOML) instead of the campaign table2.")
    ] = None,
    axis: Annotated[Axis, typer.Option(help="The model's axis.")] = "z",
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Run folder, runs/NET-SEED by default.")] = None,
    seed: Annotated[int, typer.Option(help="Of weights, data and order.", min=0)] = 0,
    epochs: Annotated[int, typer.Option(help="At most so many.", min=1)] = 40,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes that draw the scenarios of `paper` ahead of the training (Dask).")
    ] = None,
    scheduler: Annotated[str | None, typer.Option(help="A running Dask scheduler that draws them instead.")] = None,
    draws: Annotated[
        Path | None, typer.Option(help="Folder that keeps the draws for the next training. Default: none is kept.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Train a network on fresh simulations, of the paper's campaign or of what a fitted model says, or from sessions."""
    if sessions and (net == "gyrocal" or model is not None):
        raise InputError("sessions train network paper alone; for --net gyrocal or --model fit a model to them: `gyrocal add`")
    ahead = workers is not None or scheduler is not None or draws is not None
    if ahead and (sessions or net == "gyrocal"):
        raise InputError(
            "--workers, --scheduler and --draws serve simulated scenarios of network paper; network gyrocal draws as it trains"
        )
    try:
        from gyrocal_export.train import Config, train
        from gyrocal_export.train_gyrocal import GyrocalConfig, train_gyrocal
    except ImportError as error:
        raise InputError(f"training needs {error.name}: {INSTALL_TRAIN} ({INDEX_IS})") from error
    from rich.console import Console
    from rich.progress import Progress, TextColumn

    folder = out or Path("runs") / f"{net}-{seed}"
    with Progress(*Progress.get_default_columns(), TextColumn("{task.fields[note]}"), console=Console(stderr=True)) as progress:
        task = progress.add_task(f"train {net}", total=epochs, note="")

        def report(epoch: int, trained: float, checked: float) -> None:
            progress.update(task, completed=epoch + 1, note=f"loss {trained:.3f}, validation {checked:.3f}")

        if net == "gyrocal":
            ours = GyrocalConfig(model=model, axis=axis, seed=seed, epochs=epochs)
            metrics = train_gyrocal(ours, folder, report)
        else:
            config = Config(net=net, sessions=tuple(map(str, sessions or ())), model=model, axis=axis, seed=seed, epochs=epochs)
            if not ahead:
                metrics = train(config, folder, report)
            else:
                with TemporaryDirectory() as scratch, engine(workers or (None if scheduler else 0), scheduler) as where:
                    metrics = train(config, folder, report, where, draws or Path(scratch))
    if as_json:
        emit({"run": str(folder), **metrics})
        return
    print(f"{folder}: best epoch {metrics['best_epoch']}, validation loss {metrics['validation_loss']:.3f}")
    for row in metrics["errors"]:
        errors = f"scale {row['scale_mae']:.6f}  bias {row['bias_mae_dps']:.4f} dps"
        print(f"  {row['method']:8} {row['seconds']:g} s  {errors}")
    print(f"next: gyrocal export --run {folder}")
