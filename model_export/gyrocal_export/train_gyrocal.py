"""Training of network `gyrocal` on faces drawn from what a calibration knows of effects and noise."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from gyrocal.calibration import limit
from gyrocal.calibration.estimator import Calibration, calibration_of
from gyrocal.calibration.scenarios import Faces, Float32, Protocol
from gyrocal.error_model.model import Model
from gyrocal_export import run_folder
from gyrocal_export.files import two_digits_up
from gyrocal_export.nets.gyrocal import STAGES, GyrocalNet, GyrocalShape, Range, negative_log_likelihood
from gyrocal_export.run_folder import Report, Training

GRID = 64
"""Values that stand for a nonlinear parameter in the faces that are drawn."""
STEPS_AN_EPOCH = 400
SAMPLES_OFF = 2.0
"""Times the training data's largest |sample - column| is accepted: more noise than that, or a spike."""


@dataclass(frozen=True)
class GyrocalConfig(Training):
    """All that a training depends on. New faces are drawn for every step; each is seen after 2, 4 and 6 s.

    ``weight_decay`` is for float32's sake: smaller weights cancel less, which brings C and onnxruntime nearer.
    """

    net: str = "gyrocal"
    faces: int = 1024
    """A step."""
    validation_faces: int = 20_000
    range_faces: int = 1_000_000
    """Drawn to find the largest deviations."""
    learning_rate: float = 6e-3
    weight_decay: float = 0.02
    spread: float = 2.0
    """Effects are so many times as large or small at most: who has seen one size alone is too sure of others."""
    shape: GyrocalShape = field(default_factory=GyrocalShape)


def known(config: GyrocalConfig) -> tuple[Calibration, Protocol]:
    """What the training draws from: a fitted model, or the laws of the campaign ``table2``."""
    if config.model is None:
        return limit.table2(GRID), limit.PROTOCOL
    return calibration_of(Model.open(config.model), config.axis, alternatives=GRID), Protocol()


def train_gyrocal(config: GyrocalConfig, out: Path, report: Report) -> dict[str, Any]:
    """Train the network and write its run folder.

    Scale and bias are not drawn: the network sees readings less their mean, and learns what to add to the mean.

    Args:
        config: what to train, and how.
        out: the folder; it must not be there.
        report: called after each epoch with its number, training loss and validation loss.

    Returns:
        The metrics, as in metrics.json.

    Raises:
        InputError: ``out`` is there already, or the model does not say how its effects are spread.
    """
    run_folder.begin(out, config.seed)
    calibration, protocol = known(config)
    shape = config.shape
    faces = Faces(calibration, protocol, STAGES * shape.stage_columns, shape.pool, config.spread)
    training_seed, validation_seed, range_seed = np.random.SeedSequence(config.seed).spawn(3)
    rng = np.random.default_rng(training_seed)

    sizes = _sizes(config, faces, np.random.default_rng(range_seed))
    net = GyrocalNet(shape, sizes)
    _least_squares(net, faces.draw(20_000, rng))
    checked_on = faces.draw(config.validation_faces, np.random.default_rng(validation_seed))
    steps = config.epochs * STEPS_AN_EPOCH
    optimiser = torch.optim.AdamW(net.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, config.learning_rate, total_steps=steps, pct_start=0.1)

    def epoch(_: int) -> float:
        trained = 0.0
        for _ in range(STEPS_AN_EPOCH):
            value = _loss(net, faces.draw(config.faces, rng))
            optimiser.zero_grad()
            value.backward()
            torch.nn.utils.clip_grad_norm_(net.parameters(), 5.0)
            optimiser.step()
            schedule.step()
            trained += float(value.detach()) / STEPS_AN_EPOCH
        return trained

    def check() -> float:
        with torch.no_grad():
            return float(_loss(net, checked_on))

    best = run_folder.keep_best(out, config, epoch, check, lambda: save(net, out / "net.pt", protocol), report)
    as_known = Faces(calibration, protocol, STAGES * shape.stage_columns, shape.pool)
    metrics = best | evaluate(load(out)[0], as_known.draw(config.validation_faces, np.random.default_rng(validation_seed)))
    data = {
        "source": f"effects and noise drawn from {calibration.name}, afresh for every step; no scale, no bias",
        "labels": "the truth that was drawn",
        "training_faces": config.epochs * STEPS_AN_EPOCH * config.faces,
        "validation_faces": config.validation_faces,
    }
    run_folder.finish(out, config.named(), ["--net gyrocal"], data, metrics)
    return metrics


def _sizes(config: GyrocalConfig, faces: Faces, rng: np.random.Generator) -> Range:
    largest, squares, count = 0.0, 0.0, 0
    for part in np.array_split(np.arange(config.range_faces), -(-config.range_faces // 20_000)):
        drawn = faces.draw(len(part), rng)
        for x, _ in _stages(config.shape, drawn):
            largest = max(largest, float(np.abs(x).max()))
        squares, count = squares + float(np.sum(x.astype(float) ** 2)), count + x.size
    samples = Faces(faces.calibration, faces.protocol, config.shape.samples, 1, config.spread).draw(2000, rng)
    in_columns = samples.reshape(len(samples), -1, config.shape.pool)
    off_dps = float(np.abs(in_columns - in_columns.mean(-1, keepdims=True)).max())
    return Range(
        two_digits_up(float(np.sqrt(squares / count))), two_digits_up(largest), two_digits_up(SAMPLES_OFF * off_dps)
    )  # fmt: skip


def _stages(shape: GyrocalShape, columns: Float32) -> list[tuple[Float32, Float32]]:
    """For each stage the columns less their mean, and what the mean lacks of the truth, which is zero."""
    cut = [columns[:, : shape.stage_columns * (k + 1)] for k in range(STAGES)]
    return [(y - y.mean(1, keepdims=True), -y.mean(1)) for y in cut]


def _least_squares(net: GyrocalNet, columns: Float32) -> None:
    """Start from the best linear answer of each stage."""
    with torch.no_grad():
        for k, (x, truth) in enumerate(_stages(net.shape, columns)):
            weight = np.linalg.lstsq(x, truth, rcond=1e-5)[0]
            net.straight[k, : x.shape[1]] = torch.from_numpy(weight.astype(np.float32))


def _answers(net: GyrocalNet, columns: Float32) -> list[tuple[Tensor, Tensor, Tensor]]:
    """Correction, log precision and truth of each stage, in units."""
    unit = net.sizes.unit_dps
    answers = []
    for k, stage in enumerate(_stages(net.shape, columns)):
        x, truth = (torch.from_numpy((values / unit).astype(np.float32)) for values in stage)
        answers.append((*net.of_columns(x, k), truth))
    return answers


def _loss(net: GyrocalNet, columns: Float32) -> Tensor:
    """Over all stages of the same faces."""
    return torch.stack([negative_log_likelihood(*answer) for answer in _answers(net, columns)]).mean()


def evaluate(net: GyrocalNet, columns: Float32) -> dict[str, Any]:
    """Mean absolute error of u = w·scale + bias of one face after 2, 4 and 6 s, how often the truth is within one standard
    deviation; beside it that of the face's mean."""
    rows = []
    for k, (correction, log_precision, truth) in enumerate(_answers(net, columns)):
        with torch.no_grad():
            error = (correction - truth).abs()
            covered = float((error < torch.exp(-0.5 * log_precision)).double().mean())
        seconds = 2.0 * (k + 1)
        unit = net.sizes.unit_dps
        rows.append({"method": "net", "seconds": seconds, "u_mae_dps": unit * float(error.mean()), "covered": covered})
        rows.append({"method": "mean", "seconds": seconds, "u_mae_dps": unit * float(truth.abs().mean())})
    return {"errors": rows}


def save(net: GyrocalNet, path: Path, protocol: Protocol) -> None:
    """Write a checkpoint."""
    numbers = {
        "rate_hz": protocol.rate_hz, "table_dps": protocol.table_dps, "unit_dps": net.sizes.unit_dps,
        "column_range_dps": net.sizes.column_dps, "sample_range_dps": net.sizes.sample_dps, "pool": net.shape.pool,
    }  # fmt: skip
    metadata = {"name": "gyrocal", **{name: f"{value:.9g}" for name, value in numbers.items()}}
    torch.save(
        {"state": net.state_dict(), "shape": asdict(net.shape), "sizes": asdict(net.sizes), "metadata": metadata}, path
    )


def load(run: Path) -> tuple[GyrocalNet, dict[str, str]]:
    """The network of a run folder, and its metadata."""
    checkpoint = torch.load(run / "net.pt", weights_only=True)
    net = GyrocalNet(GyrocalShape(**checkpoint["shape"]), Range(**checkpoint["sizes"]))
    net.load_state_dict(checkpoint["state"])
    return net.eval(), checkpoint["metadata"]
