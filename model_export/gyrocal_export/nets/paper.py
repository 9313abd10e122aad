"""The network of Yampolsky and Klein, "Data-Driven Gyroscope Calibration", Fig. 2."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import torch
from torch import Tensor, nn

EPS = 1e-5
INPUT_EPS = 0.01
"""The eps of the normalisation in dps^2, about the noise of a reading. It prevents amplifying the constant true rate."""


@dataclass(frozen=True)
class Shape:
    """The sizes that Fig. 2 leaves open, chosen by measurement (docs/network.md).

    ``head_*`` is the convolution of each run, ``combined_*`` the one over both; kernels and pools are in samples of
    their input. Times of both outputs are multiples of four, as the C kernel computes four columns at once.
    """

    window: int = 290
    head_channels: int = 4
    head_kernel: int = 3
    head_pool: int = 24
    combined_channels: int = 8
    combined_kernel: int = 5
    combined_pool: int = 2
    hidden: int = 16
    leak: float = 0.2
    dropout: float = 0.0

    @property
    def head_columns(self) -> int:
        """Number of columns at the output of a head."""
        return (self.window - self.head_kernel + 1) // self.head_pool

    @property
    def combined_columns(self) -> int:
        """Number of columns after both heads are combined."""
        return (self.head_columns - self.combined_kernel + 1) // self.combined_pool


class Block(nn.Sequential):
    """BatchNorm, convolution over time, average pooling, LeakyReLU."""

    def __init__(self, channels_in: int, channels: int, kernel: int, pool: int, leak: float, eps: float) -> None:
        super().__init__(
            nn.BatchNorm2d(channels_in, eps),
            nn.Conv2d(channels_in, channels, (1, kernel)),
            nn.AvgPool2d((1, pool)),
            nn.LeakyReLU(leak),
        )


class Labels(nn.Module):
    """Convert outputs in standard deviations of the training labels to scale and bias in dps."""

    mean: Tensor
    sd: Tensor

    def __init__(self, mean: Tensor, sd: Tensor) -> None:
        super().__init__()
        self.register_buffer("mean", mean)
        self.register_buffer("sd", sd)

    def forward(self, z: Tensor) -> Tensor:
        return self.mean + self.sd * z


class PaperNet(nn.Module):
    """[N, 1, 2, window] of each run (row 0 measured - true rate, row 1 true rate, dps) -> [N, 2]: scale, bias_dps.

    Each image is first clipped to +-``clip_dps``, the training range of row 0. Row 1 is constant for one table rate, and shows
    only its sign after clipping. The rows are normalised separately, as channels of the image, which does not change the 2 x k
    convolution. If they were normalised together, the rate would hide the deviations from it.
    The last layer's outputs are in standard deviations of the training labels, ``label_mean`` and ``label_sd`` [2].
    """

    def __init__(self, shape: Shape, clip_dps: float, label_mean: Tensor, label_sd: Tensor) -> None:
        super().__init__()
        self.shape = shape
        self.clip_dps = clip_dps
        head = (2, shape.head_channels, shape.head_kernel, shape.head_pool, shape.leak, INPUT_EPS)
        self.up, self.down = Block(*head), Block(*head)
        self.combined = Block(
            2 * shape.head_channels,
            shape.combined_channels,
            shape.combined_kernel,
            shape.combined_pool,
            shape.leak,
            EPS,
        )
        self.fc1 = nn.Linear(shape.combined_channels * shape.combined_columns, shape.hidden)
        self.dropout = nn.Dropout(shape.dropout)
        self.fc2 = nn.Linear(shape.hidden, 2)
        self.labels: nn.Module = Labels(label_mean, label_sd)

    def forward(self, up: Tensor, down: Tensor) -> Tensor:
        up, down = (image.clamp(-self.clip_dps, self.clip_dps).transpose(1, 2) for image in (up, down))
        joined = self.combined(torch.cat([self.up(up), self.down(down)], dim=1))
        hidden = self.dropout(torch.tanh(self.fc1(joined.flatten(1))))
        return self.labels(self.fc2(hidden))

    def folded(self) -> PaperNet:
        """The same network in evaluation mode, with ``labels`` folded into the last layer's weights."""
        net = copy.deepcopy(self).eval()
        if isinstance(net.labels, Labels):
            with torch.no_grad():
                mean, sd = net.labels.mean.double(), net.labels.sd.double()
                net.fc2.weight.copy_(net.fc2.weight.double() * sd[:, None])
                net.fc2.bias.copy_(net.fc2.bias.double() * sd + mean)
            net.labels = nn.Identity()
        return net


def loss(y: Tensor, truth: Tensor) -> Tensor:
    """Eq. (17): 100 times the root mean square error over both outputs together.

    Scale counts in percent and bias in dps, as in the paper's Table 1 of labels, where both are of one size. As a
    fraction, scale would hardly weigh: at 78 dps an error of 1 mdps is 0.0013 % of scale.
    """
    error = (y - truth) * torch.tensor([100.0, 1.0])
    return 100.0 * torch.sqrt(torch.mean(error**2))
