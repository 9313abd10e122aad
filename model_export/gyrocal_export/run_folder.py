"""A run folder: config.json, history.csv, the best epoch's net.pt, metrics.json, made_by.json; and the loop that fills it."""

from __future__ import annotations

import csv
import json
import math
import os
import platform
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import torch

from gyrocal import __version__
from gyrocal.errors import InputError
from gyrocal_export.files import write_json

# PyTorch's optimisers and its export make this folder, for compiled code that nothing here has, and leave it behind
os.environ.setdefault("TORCHINDUCTOR_CACHE_DIR", tempfile.gettempdir())

Report = Callable[[int, float, float], None]
"""A function that is called after each epoch with its number, training loss and validation loss."""


@dataclass(frozen=True)
class Training:
    """The settings that all trainings share: a fitted error model to simulate from, or None, and its axis."""

    net: str
    model: str | None = None
    axis: str = "z"
    seed: int = 0
    epochs: int = 40

    def named(self) -> Self:
        """The settings with file names instead of paths, which are valid only on this machine."""
        return replace(self, model=None if self.model is None else Path(self.model).name)


def begin(out: Path, seed: int) -> None:
    """Check that ``out`` is new, and seed the computation so that one seed gives one network.

    Raises:
        InputError: ``out`` exists already.
    """
    if out.exists():
        raise InputError(f"{out}: exists already; choose another --out or remove it")
    torch.set_num_threads(1)  # more threads are no faster for so small a net, and change the order of sums
    torch.manual_seed(seed)
    torch.use_deterministic_algorithms(True)


def keep_best(
    out: Path, config: Training, train: Callable[[int], float], check: Callable[[], float], save: Callable[[], None],
    report: Report, patience: int | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Train until the last epoch, or until the validation loss has not decreased for ``patience`` epochs.

    Args:
        train: trains one epoch of the given number and returns its loss.
        check: returns the validation loss.
        save: writes net.pt; it is called whenever the validation loss is the lowest so far.

    Returns:
        ``best_epoch`` and ``validation_loss``.
    """
    out.mkdir(parents=True)
    write_json(out / "config.json", asdict(config))
    best, best_epoch = math.inf, 0
    with (out / "history.csv").open("w", newline="") as handle:
        history = csv.writer(handle)
        history.writerow(["epoch", "train_loss", "validation_loss"])
        for epoch in range(config.epochs):
            trained, checked = train(epoch), check()
            history.writerow([epoch, f"{trained:.6f}", f"{checked:.6f}"])
            handle.flush()
            report(epoch, trained, checked)
            if checked < best:
                best, best_epoch = checked, epoch
                save()
            elif patience is not None and epoch - best_epoch >= patience:
                break
    return {"best_epoch": best_epoch, "validation_loss": best}


def finish(out: Path, config: Training, words: Sequence[str], data: dict[str, Any], metrics: dict[str, Any]) -> None:
    """Write the metrics and the origin of the network. ``words`` are the arguments of `gyrocal train` that reproduce it."""
    model = [] if config.model is None else [f"--model {config.model}", f"--axis {config.axis}"]
    command = ["gyrocal train", *words, *model, f"--seed {config.seed}", f"--epochs {config.epochs}", f"--out {out.name}"]
    versions = {
        "gyrocal": __version__, "python": platform.python_version(), "torch": torch.__version__, "numpy": np.__version__,
    }  # fmt: skip
    write_json(out / "metrics.json", metrics)
    made_by = {"command": " ".join(command), "config": asdict(config), "data": data, "metrics": metrics, "versions": versions}
    write_json(out / "made_by.json", made_by)


def load_config(run: Path) -> dict[str, Any]:
    """The settings with which a run folder was trained.

    Raises:
        InputError: it is not a run folder.
    """
    path = run / "config.json"
    try:
        config: dict[str, Any] = json.loads(path.read_text())
    except (OSError, ValueError):
        raise InputError(
            f"{path}: not the configuration of a run; make a run folder with `gyrocal train --out {run}`"
        ) from None
    return config
