"""Training of network `paper`."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from gyrocal.errors import InputError
from gyrocal.fleet.engine import Engine
from gyrocal_export import run_folder
from gyrocal_export.data import Pairs, Windows, recorded, simulated, split
from gyrocal_export.draws import Draw, Draws
from gyrocal_export.files import two_digits_up
from gyrocal_export.nets.paper import PaperNet, Shape, loss
from gyrocal_export.run_folder import Report, Training


@dataclass(frozen=True)
class Config(Training):
    """The settings of a training.

    Without sessions, ``scenarios`` are simulated anew for every epoch. ``weight_decay`` serves the precision of float32:
    smaller weights cancel less, which reduces the difference between C and onnxruntime to a third for 0.4 % of loss.
    """

    net: str = "paper"
    sessions: tuple[str, ...] = ()
    patience: int = 15
    scenarios: int = 8000
    validation_scenarios: int = 4000
    batch: int = 256
    learning_rate: float = 1e-2
    weight_decay: float = 0.1
    shape: Shape = field(default_factory=Shape)


def train(
    config: Config, out: Path, report: Report, engine: Engine | None = None, draws: Path | None = None
) -> dict[str, Any]:  # fmt: skip
    """Train a network and write its run folder.

    Args:
        config: the settings of the training.
        out: the run folder, which must not exist.
        report: a function that is called after each epoch with its number, training loss and validation loss.
        engine: draws the scenarios of the epochs ahead of the training, into the folder ``draws``, which keeps them.

    Returns:
        The metrics, as in metrics.json.

    Raises:
        InputError: ``out`` exists already, or the sessions cannot be used.
    """
    run_folder.begin(out, config.seed)
    seeds = np.random.SeedSequence(config.seed).generate_state(config.epochs + 2).tolist()
    window = config.shape.window
    if config.sessions:
        fixed, validation = split(recorded(map(Path, config.sessions), window), config.seed)
        epoch_data = lambda _: fixed  # noqa: E731
    else:
        fixed, validation = (
            simulated(n, s, window, config.model, config.axis)
            for n, s in ((config.scenarios, seeds[0]), (config.validation_scenarios, seeds[1]))
        )
        epochs = [Draw(config.scenarios, seed, window, config.model, config.axis) for seed in seeds[2:]]
        ahead = Draws(engine, draws, epochs) if engine is not None and draws is not None else None
        epoch_data = lambda epoch: epochs[epoch].made() if ahead is None else ahead[epoch]  # noqa: E731
    sd = fixed.label.std(0, correction=0).clamp(min=1e-6)
    net = PaperNet(config.shape, two_digits_up(fixed.largest_dps()), fixed.label.mean(0), sd)

    optimiser = torch.optim.AdamW(net.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
    steps = config.epochs * math.ceil(fixed.up.shape[0] * fixed.up.shape[1] / config.batch)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, config.learning_rate, total_steps=steps)
    checks = validation.pairs()
    best = run_folder.keep_best(
        out, config,
        train=lambda epoch: _epoch(net, epoch_data(epoch).pairs(), config.batch, optimiser, schedule),
        check=lambda: float(loss(predict(net, checks.up, checks.down), checks.label)),
        save=lambda: save(net, out / "net.pt", validation),
        report=report, patience=config.patience,
    )  # fmt: skip
    metrics = best | evaluate(load(out)[0], fixed, validation)
    named = replace(config.named(), sessions=tuple(Path(s).name for s in config.sessions))
    data = {
        "source": list(named.sessions) or f"{named.model or 'gyrocal.simulation.paper_windows'}, afresh for every epoch",
        "labels": "baseline over the whole runs" if config.sessions else "the simulated truth",
        "training_scenarios": len(fixed.label),
        "validation_scenarios": len(validation.label),
        "windows_a_run": fixed.up.shape[1],
    }
    run_folder.finish(out, named, named.sessions, data, metrics)
    return metrics


def _epoch(net: PaperNet, data: Pairs, batch: int, optimiser: Any, schedule: Any) -> float:
    net.train()
    total = 0.0
    batches = torch.randperm(len(data.label)).split(batch)
    for rows in batches:
        value = loss(net(data.up[rows], data.down[rows]), data.label[rows])
        optimiser.zero_grad()
        value.backward()
        optimiser.step()
        schedule.step()
        total += float(value.detach())
    return total / len(batches)


def predict(net: PaperNet, up: Tensor, down: Tensor) -> Tensor:
    """Scale and bias in dps, [n, 2], of images [n, 1, 2, window], in evaluation mode (running statistics, no dropout)."""
    net.eval()
    with torch.no_grad():
        return net(up, down)


def evaluate(net: PaperNet, training: Windows, validation: Windows) -> dict[str, Any]:
    """Mean absolute errors on the validation scenarios after 1, 2, 3 windows (the mean of their answers).

    The network is compared with the mean of the training labels and with the baseline, eq. (9)-(10).
    """
    windows = validation.pairs()
    n, per_run, _ = validation.up.shape
    answers = predict(net, windows.up, windows.down).reshape(n, per_run, 2)
    means = validation.up.mean(2), validation.down.mean(2)
    baseline = torch.stack([(means[0] - means[1]) / (2 * validation.table_dps), (means[0] + means[1]) / 2], dim=2)
    rows = []
    for method, y in (("net", answers), ("mean", training.label.mean(0).expand(n, per_run, 2)), ("baseline", baseline)):
        for k in range(1, min(per_run, 3) + 1):
            error = (y[:, :k].mean(1) - validation.label).abs().mean(0).tolist()
            seconds = round(k * validation.up.shape[2] / validation.rate_hz, 3)
            rows.append({"method": method, "seconds": seconds, "scale_mae": error[0], "bias_mae_dps": error[1]})
    return {"errors": rows}


def save(net: PaperNet, path: Path, data: Windows) -> None:
    """Write a checkpoint: the weights, the shape, the training range, and the rates for which it is valid."""
    metadata = {"name": "paper", "rate_hz": f"{data.rate_hz:.9g}", "table_dps": f"{data.table_dps:.9g}"}
    torch.save({"state": net.state_dict(), "shape": asdict(net.shape), "clip_dps": net.clip_dps, "metadata": metadata}, path)


def load(run: Path) -> tuple[PaperNet, dict[str, str]]:
    """The network of a run folder, and its metadata (name, rate_hz, table_dps).

    Raises:
        InputError: the folder or its checkpoint does not exist.
    """
    path = run / "net.pt"
    if not path.is_file():
        raise InputError(f"{path}: no such file; make a run folder with `gyrocal train --out {run}`")
    try:
        checkpoint = torch.load(path, weights_only=True)
        net = PaperNet(Shape(**checkpoint["shape"]), checkpoint["clip_dps"], torch.zeros(2), torch.ones(2))
        net.load_state_dict(checkpoint["state"])
    except Exception as error:  # torch.load raises any error of its unpickler
        reason = str(error).splitlines()[0][:120]
        raise InputError(f"{path}: not a checkpoint of network paper ({reason}); train it again") from error
    return net.eval(), checkpoint["metadata"]
