"""Windows and labels to train on: from the simulator, or from recorded sessions as the paper cuts them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from gyrocal.calibration.calibrate import baseline
from gyrocal.calibration.estimator import calibration_of
from gyrocal.calibration.network import image
from gyrocal.calibration.scenarios import Protocol, Simulation
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.recording.session import Run, Session
from gyrocal.simulation.simulate import paper_windows

SIMULATED_SECONDS = 6.0
RECORDED_SECONDS = 50.0  # later samples are used only for the labels
GRID = 32  # values that stand for a nonlinear parameter that differs from run to run
STRIDE = 0.6  # distance between windows of a recorded run, as a fraction of a window


class Pairs(NamedTuple):
    """The images of both faces [m, 1, 2, window] and the labels [m, 2] (scale, bias in dps), one row for each window."""

    up: Tensor
    down: Tensor
    label: Tensor


@dataclass(frozen=True)
class Windows:
    """Windows of the two runs of each scenario, and the labels that a network should estimate from them.

    Attributes:
        up, down: measured minus true rate (dps), [n, per_run, window].
        label: scale and bias in dps, [n, 2].
    """

    up: Tensor
    down: Tensor
    label: Tensor
    table_dps: float
    rate_hz: float

    def pairs(self) -> Pairs:
        """The windows as a network takes them."""
        per_run, window = self.up.shape[1:]
        images = [
            torch.from_numpy(image(x.reshape(-1, window).numpy(), w))
            for x, w in ((self.up, self.table_dps), (self.down, -self.table_dps))
        ]
        return Pairs(images[0], images[1], self.label.repeat_interleave(per_run, 0))

    def largest_dps(self) -> float:
        """The training range: the largest |measured - true rate| in dps."""
        return float(max(self.up.abs().max(), self.down.abs().max()))


def simulated(n: int, seed: int, window: int, model: str | None = None, axis: str = "z") -> Windows:
    """Simulate ``n`` scenarios of the paper's campaign or of a fitted model, and cut the windows of their first 6 s.

    The labels are the truth.
    """
    if model is None:
        data = paper_windows(n, seed, SIMULATED_SECONDS)
        drawn = data["up"], data["down"], data["scale"], data["bias_dps"]
        protocol = Protocol(data["rate_hz"], data["w_up_dps"])
    else:
        protocol = Protocol()
        calibration = calibration_of(Model.open(model), axis, alternatives=GRID)
        simulation = Simulation(calibration, protocol, SIMULATED_SECONDS, by_sample=True)
        drawn = simulation.draw(n, np.random.default_rng(seed))
    label = np.stack(drawn[2:], axis=1)
    per_run = drawn[0].shape[1] // window
    up, down = (
        torch.from_numpy(face[:, : per_run * window].reshape(n, per_run, window).astype(np.float32)) for face in drawn[:2]
    )
    return Windows(up, down, torch.from_numpy(label.astype(np.float32)), protocol.table_dps, protocol.rate_hz)


def recorded(paths: Iterable[Path], window: int) -> Windows:
    """Cut windows of the first 50 s of every up/down pair of the sessions. The labels are the baseline of the whole runs.

    Raises:
        InputError: there is no pair, the runs are too short, or their table or sample rates differ.
    """
    ups, downs, labels, rates = [], [], [], set()
    for path in paths:
        for scenario, runs in Session.open(path).by_scenario():
            pair = {np.sign(run.table_rate_dps * run.face_sign): run for run in runs if run.table_rate_dps}
            if set(pair) != {1.0, -1.0}:
                continue
            up, down = pair[1.0], pair[-1.0]
            rates.add((abs(float(up.rate_dps[0])), abs(float(down.rate_dps[0])), up.sample_rate_hz))
            cut = [_cut(run, window) for run in (up, down)]
            n = min(map(len, cut))
            if n == 0:
                raise InputError(f"{path}: scenario {scenario} is shorter than a window of {window} samples")
            ups.append(cut[0][:n])
            downs.append(cut[1][:n])
            whole = baseline(up, down)
            labels.append((whole.scale, whole.bias_dps))
    if not labels:
        raise InputError("no scenario has an up and a down run at one table rate: nothing to train on")
    if len(rates) > 1 or len(set(next(iter(rates))[:2])) > 1:
        raise InputError(f"one network takes one table rate and one sample rate; the sessions have {sorted(rates)}")
    n = min(map(len, ups))
    table_dps, _, rate_hz = rates.pop()
    first, second = (torch.from_numpy(np.stack([x[:n] for x in face])) for face in (ups, downs))
    return Windows(first, second, torch.tensor(labels, dtype=torch.float32), table_dps, rate_hz)


def split(data: Windows, seed: int, share: float = 0.2) -> tuple[Windows, Windows]:
    """Split into training and validation scenarios, at least one of each.

    Raises:
        InputError: there are fewer than two scenarios.
    """
    n = len(data.label)
    if n < 2:
        raise InputError("training needs two scenarios at least, one of them for validation: record more, or simulate")
    order = torch.randperm(n, generator=torch.Generator().manual_seed(seed))
    held = max(1, round(share * n))
    return _take(data, order[held:]), _take(data, order[:held])


def _take(data: Windows, rows: Tensor) -> Windows:
    return Windows(data.up[rows], data.down[rows], data.label[rows], data.table_dps, data.rate_hz)


def _residual(run: Run) -> np.ndarray:
    return run.gyro_dps[:, run.axis_index] - run.rate_dps


def _cut(run: Run, window: int) -> np.ndarray:
    x = _residual(run)[: round(RECORDED_SECONDS * run.sample_rate_hz)].astype(np.float32)
    starts = range(0, len(x) - window + 1, round(STRIDE * window))
    return np.array([x[i : i + window] for i in starts], np.float32).reshape(-1, window)
