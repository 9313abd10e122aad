"""The scenarios of each epoch of a training, drawn ahead of it by the workers of a cluster, and kept in a folder.

A draw depends on its seed alone, so that a training has the same data whoever draws them. A draw whose file is there is not
made again: a training that was interrupted, or one with other settings of the network, begins with what was drawn.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch

import gyrocal
from gyrocal.error_model.model import Model
from gyrocal.files import replacing
from gyrocal.fleet.engine import Engine
from gyrocal_export.data import Windows, simulated


@dataclass(frozen=True)
class Draw:
    """The scenarios of one epoch: their number and seed, the samples of a window, and the model that they are drawn from."""

    scenarios: int
    seed: int
    window: int
    model: str | None = None
    axis: str = "z"

    @property
    def name(self) -> str:
        """A file name for everything that the draw depends on."""
        model = "" if self.model is None else Model.open(self.model).toml()
        told = json.dumps([gyrocal.__version__, self.scenarios, self.seed, self.window, model, self.axis])
        return f"{hashlib.blake2b(told.encode(), digest_size=12).hexdigest()}.npz"

    def made(self) -> Windows:
        """The scenarios."""
        return simulated(self.scenarios, self.seed, self.window, self.model, self.axis)


def make(draw: Draw, folder: str) -> str:
    """Draw into the folder, unless the file is there. Returns its name."""
    path = Path(folder) / draw.name
    if not path.is_file():
        made = draw.made()
        with replacing(path, durable=False) as partial_file, partial_file.open("wb") as handle:
            np.savez(
                handle, up=made.up.numpy(), down=made.down.numpy(), label=made.label.numpy(),
                protocol=np.array([made.table_dps, made.rate_hz]),
            )  # fmt: skip
    return draw.name


class Draws:
    """The draws of a training, in order. The engine works ahead by a bounded number of draws."""

    def __init__(self, engine: Engine, folder: Path, draws: Sequence[Draw]) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self.draws = folder, draws
        self._arriving = engine.run(partial(make, folder=str(folder.absolute())), draws)

    def __getitem__(self, epoch: int) -> Windows:
        path = self.folder / self.draws[epoch].name
        while not path.is_file():
            next(self._arriving)
        with np.load(path) as stored:
            table_dps, rate_hz = stored["protocol"].tolist()
            up, down, label = (torch.from_numpy(stored[name]) for name in ("up", "down", "label"))
        return Windows(up, down, label, table_dps, rate_hz)
