"""Training of network `gyrocal` on scenarios drawn from what a calibration knows."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from gyrocal.calibration import limit
from gyrocal.calibration.estimator import Calibration, calibration_of
from gyrocal.calibration.scenarios import Protocol, Simulation, answers
from gyrocal.error_model.model import Model
from gyrocal_export import run_folder
from gyrocal_export.files import two_digits_up
from gyrocal_export.nets.gyrocal import (
    BLOCKS,
    BLOCKS_A_STAGE,
    STAGES,
    GyrocalNet,
    GyrocalShape,
    Knowledge,
    negative_log_likelihood,
)
from gyrocal_export.run_folder import Report, Training

GRID, COARSE = 64, 12
"""Values that stand for a nonlinear parameter in the scenarios that are drawn, and in the answer that is exact."""
BLOCK_S = 0.25
STEPS_AN_EPOCH = 400


@dataclass(frozen=True)
class GyrocalConfig(Training):
    """All that a training depends on. New scenarios are drawn for every step; each is seen after 2, 4 and 6 s.

    ``weight_decay`` is for float32's sake: smaller weights cancel less, which brings C and onnxruntime nearer.
    """

    net: str = "gyrocal"
    scenarios: int = 512
    """A step."""
    validation_scenarios: int = 4000
    learning_rate: float = 6e-3
    weight_decay: float = 0.02
    shape: GyrocalShape = field(default_factory=GyrocalShape)


def known(config: GyrocalConfig, grid: int = GRID) -> tuple[Calibration, Protocol]:
    """What the training draws from: a fitted model, or the laws of the campaign ``table2``."""
    if config.model is None:
        return limit.table2(grid), limit.PROTOCOL
    return calibration_of(Model.open(config.model), config.axis, alternatives=grid), Protocol()


def train_gyrocal(config: GyrocalConfig, out: Path, report: Report) -> dict[str, Any]:
    """Train the network and write its run folder.

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
    simulation = Simulation(calibration, protocol, STAGES * BLOCKS_A_STAGE * BLOCK_S)
    training_seed, validation_seed = np.random.SeedSequence(config.seed).spawn(2)
    rng = np.random.default_rng(training_seed)

    first = simulation.draw(4000, np.random.default_rng(config.seed))
    net = GyrocalNet(config.shape, _knowledge(calibration, protocol, first))
    _least_squares(net, first)
    checked_on = simulation.draw(config.validation_scenarios, np.random.default_rng(validation_seed))
    checks = _tensors(net, checked_on)
    steps = config.epochs * STEPS_AN_EPOCH
    optimiser = torch.optim.AdamW(net.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, config.learning_rate, total_steps=steps, pct_start=0.1)

    def epoch(_: int) -> float:
        trained = 0.0
        for _ in range(STEPS_AN_EPOCH):
            value = _loss(net, *_tensors(net, simulation.draw(config.scenarios, rng)))
            optimiser.zero_grad()
            value.backward()
            torch.nn.utils.clip_grad_norm_(net.parameters(), 5.0)
            optimiser.step()
            schedule.step()
            trained += float(value.detach()) / STEPS_AN_EPOCH
        return trained

    def check() -> float:
        with torch.no_grad():
            return float(_loss(net, *checks))

    best = run_folder.keep_best(out, config, epoch, check, lambda: save(net, out / "net.pt", protocol), report)
    metrics = best | evaluate(load(out)[0], checked_on, known(config, grid=COARSE)[0], protocol)
    data = {
        "source": f"drawn from {calibration.name}, afresh for every step",
        "labels": "the truth that was drawn",
        "training_scenarios": config.epochs * STEPS_AN_EPOCH * config.scenarios,
        "validation_scenarios": config.validation_scenarios,
    }
    run_folder.finish(out, config.named(), ["--net gyrocal"], data, metrics)
    return metrics


Scenarios = tuple[np.ndarray[Any, Any], np.ndarray[Any, Any], np.ndarray[Any, Any], np.ndarray[Any, Any]]


def _knowledge(calibration: Calibration, protocol: Protocol, drawn: Scenarios) -> Knowledge:
    up, down = drawn[:2]
    return Knowledge(
        calibration.scale, calibration.bias_dps, protocol.table_dps,
        unit_dps=two_digits_up(float(np.std(np.concatenate([up - up.mean(0), down - down.mean(0)])))),
        clip_dps=two_digits_up(float(max(np.abs(up).max(), np.abs(down).max()))),
    )  # fmt: skip


def _least_squares(net: GyrocalNet, drawn: Scenarios) -> None:
    """Start from the best linear answer of each stage."""
    know = net.knowledge
    center, scale, bias = know.center_dps, drawn[2] - know.scale[0], drawn[3] - know.bias_dps[0]
    x = np.concatenate([drawn[0] - center[0], -drawn[1] - center[1]]) / know.unit_dps
    u = np.concatenate([know.table_dps * scale + bias, know.table_dps * scale - bias]) / know.unit_dps
    with torch.no_grad():
        for stage in range(STAGES):
            seen = BLOCKS_A_STAGE * (stage + 1)
            weight = np.linalg.lstsq(x[:, :seen], u, rcond=None)[0]
            net.straight[stage, :seen] = torch.from_numpy(weight.astype(np.float32))


def _tensors(net: GyrocalNet, drawn: Scenarios) -> tuple[Tensor, Tensor, Tensor]:
    know = net.knowledge
    truth = np.column_stack([(drawn[2] - know.scale[0]) / know.scale[1], (drawn[3] - know.bias_dps[0]) / know.bias_dps[1]])
    up, down, t = (torch.from_numpy(x.astype(np.float32)) for x in (drawn[0], drawn[1], truth))
    return up, down, t


def _loss(net: GyrocalNet, up: Tensor, down: Tensor, truth: Tensor) -> Tensor:
    """Over all stages of the same scenarios."""
    stage = torch.eye(STAGES).repeat_interleave(len(up), 0)
    mean, variance = net.standard(up.repeat(STAGES, 1), down.repeat(STAGES, 1), stage)
    return negative_log_likelihood(mean, variance, truth.repeat(STAGES, 1))


def evaluate(net: GyrocalNet, drawn: Scenarios, calibration: Calibration, protocol: Protocol) -> dict[str, Any]:
    """Mean absolute errors after 2, 4 and 6 s, how often the truth is within one standard deviation; beside it the model's
    exact answer from the same blocks and the prior."""
    truth = np.column_stack(drawn[2:])
    up, down = (torch.from_numpy(x.astype(np.float32)) for x in drawn[:2])
    rows = []
    for k in range(STAGES):
        seconds = (k + 1) * BLOCKS_A_STAGE * BLOCK_S
        with torch.no_grad():
            y = net(up, down, torch.eye(STAGES)[k].expand(len(up), STAGES)).numpy()
        seen = BLOCKS_A_STAGE * (k + 1)
        exact = answers(calibration, drawn[0][:, :seen], drawn[1][:, :seen], seconds, protocol, blocks=True)
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


def save(net: GyrocalNet, path: Path, protocol: Protocol) -> None:
    """Write a checkpoint."""
    numbers = {"rate_hz": protocol.rate_hz, "table_dps": protocol.table_dps, "clip_dps": net.knowledge.clip_dps}
    metadata = {"name": "gyrocal", **{name: f"{value:.9g}" for name, value in numbers.items()}}
    torch.save(
        {"state": net.state_dict(), "shape": asdict(net.shape), "knowledge": asdict(net.knowledge), "metadata": metadata},
        path,
    )


def load(run: Path) -> tuple[GyrocalNet, dict[str, str]]:
    """The network of a run folder, and its metadata (name, rate_hz, table_dps)."""
    checkpoint = torch.load(run / "net.pt", weights_only=True)
    net = GyrocalNet(GyrocalShape(**checkpoint["shape"]), Knowledge(**checkpoint["knowledge"]))
    net.load_state_dict(checkpoint["state"])
    assert net.straight.shape == (STAGES, BLOCKS)
    return net.eval(), checkpoint["metadata"]
