"""Network `gyrocal`, which estimates a correction of the mean of one face's readings and its precision.

A face at true rate w determines only one number, u = w·scale + bias. Its mean over 2, 4 or 6 s is a first estimate, which
ripple and transient bias. The network is the head of Fig. 2, the same for both faces. Its input is the readings less their
mean, and its output is a correction and a precision. Therefore a constant added to the readings is added to the
answer, and the weights contain nothing about the spreads of scale and bias. The answers of both faces and the priors are
combined in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn.functional import avg_pool1d, leaky_relu

STAGES = 3
"""Number of stages: answers after 2, 4 and 6 s."""
LARGEST_LOG_PRECISION = 9.0
"""The largest log precision of u in units: a standard deviation of a hundredth of a unit, smaller than any after 6 s."""


@dataclass(frozen=True)
class GyrocalShape:
    """The sizes that Fig. 2 leaves open, chosen by measurement (docs/network.md).

    The first convolution's taps are ``pool`` samples apart, so that with its average pool it is a convolution over means of
    ``pool`` samples, the columns. A stage has ``stage_columns`` of them.
    """

    pool: int = 29
    stage_columns: int = 10
    first_channels: int = 8
    first_kernel: int = 5
    second_channels: int = 12
    second_kernel: int = 3
    second_pool: int = 2
    hidden: int = 32
    """Number of neurons in each of the two layers after the convolutions."""
    leak: float = 0.1

    @property
    def samples(self) -> int:
        """Number of samples of the longest stage."""
        return self.pool * self.stage_columns * STAGES

    def features(self, stage: int) -> int:
        """Number of times in the second layer's output at a stage."""
        convolved = self.stage_columns * (stage + 1) - self.first_kernel - self.second_kernel + 2
        return convolved // self.second_pool


@dataclass(frozen=True)
class Range:
    """Sizes of the training data: ``unit_dps``, the rms of a column less the mean; the largest column less the mean; and the
    largest sample less its column that is accepted."""

    unit_dps: float
    column_dps: float
    sample_dps: float


class GyrocalNet(nn.Module):
    """Readings of one face less their mean [N, 1, samples] (dps; turned, so that the true rate is positive; zero beyond the
    stage) and the stage [N, 3] (one-hot: 2, 4 or 6 s) -> [N, 2]: u less the mean and the log of its precision, in units."""

    def __init__(self, shape: GyrocalShape, sizes: Range) -> None:
        super().__init__()
        self.shape, self.sizes = shape, sizes
        self.first = nn.Conv1d(1, shape.first_channels, shape.first_kernel)
        self.second = nn.Conv1d(shape.first_channels, shape.second_channels, shape.second_kernel)
        self.third = nn.Linear(shape.second_channels * shape.features(STAGES - 1), shape.hidden, bias=False)
        self.start = nn.Parameter(0.1 * torch.randn(STAGES, shape.hidden))
        """The third layer's biases, one set for each stage."""
        self.fourth = nn.Linear(shape.hidden, shape.hidden)
        self.last = nn.Linear(shape.hidden, 2)
        self.straight = nn.Parameter(torch.zeros(STAGES, STAGES * shape.stage_columns))
        """The linear part of the correction, which bypasses the layers: the least-squares answer that they refine."""

    def of_columns(self, x: Tensor, stage: int) -> tuple[Tensor, Tensor]:
        """Correction and log precision of u, in units [N], from a stage's columns in units [N, stage_columns (stage + 1)]."""
        shape = self.shape
        h = leaky_relu(self.first(x[:, None]), shape.leak)
        h = leaky_relu(avg_pool1d(self.second(h), shape.second_pool), shape.leak)
        seen = shape.features(stage)
        weight = self.third.weight.unflatten(1, (shape.second_channels, -1))[:, :, :seen].flatten(1)
        h = leaky_relu(h[:, :, :seen].flatten(1) @ weight.T + self.start[stage], shape.leak)
        out = self.last(leaky_relu(self.fourth(h), shape.leak))
        correction = x @ self.straight[stage, : x.shape[1]] + out[:, 0]
        return correction, out[:, 1].clamp(-LARGEST_LOG_PRECISION, LARGEST_LOG_PRECISION)

    def forward(self, readings: Tensor, stage: Tensor) -> Tensor:
        columns = avg_pool1d(readings / self.sizes.unit_dps, self.shape.pool)[:, 0]
        answers = []
        for k in range(STAGES):
            correction, log_precision = self.of_columns(columns[:, : self.shape.stage_columns * (k + 1)], k)
            answers.append(torch.stack([correction, log_precision], 1))
        return torch.einsum("nk,kny->ny", stage, torch.stack(answers))


def negative_log_likelihood(correction: Tensor, log_precision: Tensor, truth: Tensor) -> Tensor:
    """The negative log-likelihood of the true correction under the answer, which rewards accuracy and a correct precision."""
    return 0.5 * (torch.exp(log_precision) * (correction - truth) ** 2 - log_precision).mean()
