"""Training of network `gyrocal` on faces drawn from the effects and the noise of a calibration."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from gyrocal.calibration import limit
from gyrocal.calibration.estimator import Calibration, calibration_of
from gyrocal.calibration.network import FaceAnswers, Prior, merge
from gyrocal.calibration.scenarios import Faces, Float32, Protocol, Simulation, answers
from gyrocal.error_model.model import Model
from gyrocal.recording.session import Array
from gyrocal_export import run_folder
from gyrocal_export.files import two_digits_up
from gyrocal_export.nets.gyrocal import STAGES, GyrocalNet, GyrocalShape, Range, negative_log_likelihood
from gyrocal_export.quantize import by_channel, codes
from gyrocal_export.run_folder import Report, Training

GRID, COARSE = 64, 12
"""Number of values of a nonlinear parameter in the faces that are drawn, and in the exact answer."""
STAGE_S = 2.0
STEPS_AN_EPOCH = 400
SAMPLES_OFF = 2.0
"""Factor on the largest |sample - column| of the training data up to which a sample is accepted."""


@dataclass(frozen=True)
class GyrocalConfig(Training):
    """The settings of a training. New faces are drawn for every step; each is used after 2, 4 and 6 s.

    ``weight_decay`` serves the precision of float32: smaller weights cancel less, so that C and onnxruntime differ less.
    """

    net: str = "gyrocal"
    faces: int = 1024
    """Number of faces in one step."""
    validation_faces: int = 20_000
    test_scenarios: int = 4000
    range_faces: int = 1_000_000
    """Number of faces that are drawn to find the largest deviations."""
    learning_rate: float = 6e-3
    weight_decay: float = 0.1
    spread: float = 2.0
    """Largest factor by which effects are larger or smaller than in the campaign. A network trained on one size alone would
    give too small standard errors for others."""
    settling_steps: int = 1200
    settling_rate: float = 1e-3
    shape: GyrocalShape = field(default_factory=GyrocalShape)


def known(config: GyrocalConfig, grid: int = GRID) -> tuple[Calibration, Protocol]:
    """The distribution from which the training draws: a fitted model, or that of the campaign ``table2``."""
    if config.model is None:
        return limit.table2(grid), limit.PROTOCOL
    return calibration_of(Model.open(config.model), config.axis, alternatives=grid), Protocol()


def train_gyrocal(config: GyrocalConfig, out: Path, report: Report) -> dict[str, Any]:
    """Train the network and write its run folder.

    Scale and bias are not drawn: the input is the readings less their mean, and the output is a correction of the mean.

    Args:
        config: the settings of the training.
        out: the run folder, which must not exist.
        report: a function that is called after each epoch with its number, training loss and validation loss.

    Returns:
        The metrics, as in metrics.json.

    Raises:
        InputError: ``out`` exists already, or the model lacks the spread of an effect.
    """
    run_folder.begin(out, config.seed)
    calibration, protocol = known(config)
    shape = config.shape
    faces = Faces(calibration, protocol, STAGES * shape.stage_columns, shape.pool, config.spread)
    training_seed, validation_seed, range_seed, test_seed, settling_seed = np.random.SeedSequence(config.seed).spawn(5)
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
    save(settled(load(out)[0], config, faces, np.random.default_rng(settling_seed)), out / "net.pt", protocol)
    coarse, rng = known(config, grid=COARSE)[0], np.random.default_rng(test_seed)
    metrics = best | evaluate(load(out)[0], coarse, protocol, config.test_scenarios, rng)
    data = {
        "source": f"effects and noise drawn from {calibration.name}, afresh for every step; no scale, no bias",
        "labels": "the truth that was drawn",
        "training_faces": config.epochs * STEPS_AN_EPOCH * config.faces,
        "validation_faces": config.validation_faces,
        "test_scenarios": config.test_scenarios,
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
    """For each stage the columns less their mean, and the correction of the mean; the truth is zero."""
    cut = [columns[:, : shape.stage_columns * (k + 1)] for k in range(STAGES)]
    return [(y - y.mean(1, keepdims=True), -y.mean(1)) for y in cut]


def _least_squares(net: GyrocalNet, columns: Float32) -> None:
    """Initialise the linear part with the least-squares answer of each stage."""
    with torch.no_grad():
        for k, (x, truth) in enumerate(_stages(net.shape, columns)):
            weight = np.linalg.lstsq(x, truth, rcond=1e-5)[0]
            net.straight[k, : x.shape[1]] = torch.from_numpy(weight.astype(np.float32))


class _StageAnswer(NamedTuple):
    """The network's correction [n] and its log precision [n] at one stage, and the true correction [n], in the net's units."""

    correction: Tensor
    log_precision: Tensor
    truth: Tensor


def _answers(net: GyrocalNet, columns: Float32) -> list[_StageAnswer]:
    """The answer of each stage for the same faces [n, columns]."""
    unit = net.sizes.unit_dps
    answers = []
    for k, stage in enumerate(_stages(net.shape, columns)):
        x, truth = (torch.from_numpy((values / unit).astype(np.float32)) for values in stage)
        answers.append(_StageAnswer(*net.of_columns(x, k), truth))
    return answers


def _loss(net: GyrocalNet, columns: Float32) -> Tensor:
    """The mean loss over all stages of the same faces."""
    return torch.stack([negative_log_likelihood(*answer) for answer in _answers(net, columns)]).mean()


def settled(net: GyrocalNet, config: GyrocalConfig, faces: Faces, rng: np.random.Generator) -> GyrocalNet:
    """The network with weights rounded to int8, as they are exported, and its biases and linear part trained again.

    Rounding would otherwise shift the mean of the correction, which is an error of scale.
    """
    learned = []
    for name, values in net.named_parameters():
        if name.endswith(".weight"):
            code, step = codes(values.detach().numpy().astype(np.float64))
            values.data.copy_(torch.from_numpy((code * by_channel(step, code)).astype(np.float32)))
        else:
            learned.append(values)
    optimiser = torch.optim.Adam(learned, lr=config.settling_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, config.settling_steps)
    for _ in range(config.settling_steps):
        value = _loss(net, faces.draw(config.faces, rng))
        optimiser.zero_grad()
        value.backward()
        optimiser.step()
        schedule.step()
    return net


def evaluate(net: GyrocalNet, calibration: Calibration, protocol: Protocol, n: int, rng: np.random.Generator) -> dict[str, Any]:
    """Mean absolute errors after 2, 4 and 6 s on ``n`` scenarios drawn from a calibration, whose priors are merged in.

    The rows also give the fraction of truths within one standard deviation, the model's exact answer from blocks of 0.25 s, and
    the means of the priors. If a prior is flat, the truth is zero.
    """
    scale, bias_dps = ((mean, sd if np.isfinite(sd) else 0.0) for mean, sd in (calibration.scale, calibration.bias_dps))
    drawn_from = replace(calibration, scale=scale, bias_dps=bias_dps)
    up, down, *drawn = Simulation(drawn_from, protocol, STAGE_S * STAGES, by_sample=True).draw(n, rng)
    truth, prior = np.column_stack(drawn), Prior(calibration.scale, calibration.bias_dps)
    rows = []
    for k in range(STAGES):
        seconds = STAGE_S * (k + 1)
        y = merge(_face(net, up, k, protocol.table_dps), _face(net, down, k, -protocol.table_dps), prior)
        exact = answers(calibration, up, down, seconds, protocol)
        means = {
            "net": y[:, :2],
            "model": np.column_stack([exact.scale, exact.bias_dps]),
            "mean": np.broadcast_to([calibration.scale[0], calibration.bias_dps[0]], truth.shape),
        }
        for method, found in means.items():
            error = np.abs(found - truth)
            row = {"method": method, "seconds": seconds, "scale_mae": error[:, 0].mean(), "bias_mae_dps": error[:, 1].mean()}
            if method == "net":
                covered = np.mean(error < y[:, 2:], axis=0)
                row |= {"scale_covered": covered[0], "bias_covered": covered[1]}
            rows.append({name: value if isinstance(value, str) else float(value) for name, value in row.items()})
    return {"errors": rows}


def _face(net: GyrocalNet, residual_dps: Array, stage: int, w_dps: float) -> FaceAnswers:
    """The answer of the network before export, as `gyrocal.calibration.network` gives it for the same readings [n, samples]."""
    y = residual_dps[:, : net.shape.pool * net.shape.stage_columns * (stage + 1)]
    mean, sign, unit = y.mean(1), np.sign(w_dps), net.sizes.unit_dps
    columns = sign * (y.reshape(len(y), -1, net.shape.pool).mean(-1) - mean[:, None]) / unit
    with torch.no_grad():
        correction, log_precision = net.of_columns(torch.from_numpy(columns.astype(np.float32)), stage)
    precision = np.exp(log_precision.double().numpy()) / unit**2
    return FaceAnswers(w_dps, mean + sign * unit * correction.double().numpy(), precision, np.ones(len(y), bool))


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
