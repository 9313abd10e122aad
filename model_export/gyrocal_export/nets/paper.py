"""The network of Yampolsky and Klein, "Data-Driven Gyroscope Calibration", Fig. 2."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import torch
from torch import Tensor, nn


@dataclass(frozen=True)
class Shape:
    """What Fig. 2 leaves open; chosen by measurement (docs/network.md).

    ``head_*`` is the convolution of each run, ``combined_*`` the one over both; kernels and pools are in samples of
    their input. Times of both outputs are multiples of four, as the C kernel computes four columns at once.
    """

    window: int = 290
    head_channels: int = 4
    head_kernel: int = 9
    head_pool: int = 10
    combined_channels: int = 8
    combined_kernel: int = 5
    combined_pool: int = 3
    hidden: int = 16
    leak: float = 0.01
    dropout: float = 0.0

    @property
    def head_columns(self) -> int:
        return (self.window - self.head_kernel + 1) // self.head_pool

    @property
    def combined_columns(self) -> int:
        return (self.head_columns - self.combined_kernel + 1) // self.combined_pool


class Block(nn.Sequential):
    """BatchNorm, convolution, average pooling, LeakyReLU."""

    def __init__(self, channels_in: int, channels: int, kernel: tuple[int, int], pool: int, leak: float) -> None:
        super().__init__(
            nn.BatchNorm2d(channels_in),
            nn.Conv2d(channels_in, channels, kernel),
            nn.AvgPool2d((1, pool)),
            nn.LeakyReLU(leak),
        )


class PaperNet(nn.Module):
    """[N, 1, 2, window] of each run (row 0 measured - true rate, row 1 true rate, dps) -> [N, 2]: scale, bias_dps.

    Each image is first clipped to +-``clip_dps``, the training range of row 0. Row 1, one constant in a network for one
    table rate, so becomes +-``clip_dps``: of row 0's size, and its sign is all that it can tell.
    The last layer's outputs are in standard deviations of the training labels.
    """

    def __init__(self, shape: Shape, clip_dps: float, label_mean: Any, label_sd: Any) -> None:
        super().__init__()
        self.shape = shape
        self.clip_dps = clip_dps
        kernel, pool = shape.head_kernel, shape.head_pool
        self.up = Block(1, shape.head_channels, (2, kernel), pool, shape.leak)
        self.down = Block(1, shape.head_channels, (2, kernel), pool, shape.leak)
        self.combined = Block(
            2 * shape.head_channels, shape.combined_channels, (1, shape.combined_kernel), shape.combined_pool, shape.leak
        )
        self.fc1 = nn.Linear(shape.combined_channels * shape.combined_columns, shape.hidden)
        self.dropout = nn.Dropout(shape.dropout)
        self.fc2 = nn.Linear(shape.hidden, 2)
        self.register_buffer("label_mean", torch.as_tensor(label_mean, dtype=torch.float32))
        self.register_buffer("label_sd", torch.as_tensor(label_sd, dtype=torch.float32))

    def forward(self, up: Tensor, down: Tensor) -> Tensor:
        up, down = (image.clamp(-self.clip_dps, self.clip_dps) for image in (up, down))
        joined = self.combined(torch.cat([self.up(up), self.down(down)], dim=1))
        hidden = self.dropout(torch.tanh(self.fc1(joined.flatten(1))))
        return self.label_mean + self.label_sd * self.fc2(hidden)

    def config(self) -> dict[str, Any]:
        """What `__init__` was given, as JSON values."""
        return {
            "shape": asdict(self.shape),
            "clip_dps": self.clip_dps,
            "label_mean": self.label_mean.tolist(),
            "label_sd": self.label_sd.tolist(),
        }


def loss(y: Tensor, truth: Tensor) -> Tensor:
    """Eq. (17): 100 times the root mean square error over both outputs together."""
    return 100.0 * torch.sqrt(torch.mean((y - truth) ** 2))
