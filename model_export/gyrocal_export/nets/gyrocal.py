"""Network `gyrocal`: each face's block means -> how far its mean rate is off, and how sure that is; merged as Gaussians.

A face at true rate w says something of one number alone, u = w·scale + bias. So one small network, the same for both faces,
takes a face's means over blocks of 0.25 s and answers with a mean m and a precision p of u: the part of the problem that is not
linear, a transient whose time constant nobody knows. What remains is linear and Gaussian and is done in closed form: two
measurements of u and the priors of scale and bias give both, with standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

BLOCKS_A_STAGE = 8
STAGES = 3
"""Answers after 2, 4 and 6 s: 8, 16 and 24 blocks."""
BLOCKS = BLOCKS_A_STAGE * STAGES
LARGEST_LOG_PRECISION = 9.0
"""Of u in units: a hundredth of a unit, better than any 6 s."""


@dataclass(frozen=True)
class GyrocalShape:
    """``hidden`` neurons in each of two layers, LeakyReLU of slope ``leak``: chosen by measurement (docs/network.md)."""

    hidden: int = 32
    leak: float = 0.1


@dataclass(frozen=True)
class Knowledge:
    """What is known before anything is measured: mean and standard deviation of scale and bias, the table's speed; and two
    sizes of the training data: ``unit_dps``, of what a face reads, and ``clip_dps``, the largest |measured - true rate|."""

    scale: tuple[float, float]
    bias_dps: tuple[float, float]
    table_dps: float
    unit_dps: float
    clip_dps: float

    @property
    def scale_units(self) -> float:
        """What one standard deviation of scale moves a face's mean rate by, in units."""
        return self.table_dps * self.scale[1] / self.unit_dps

    @property
    def bias_units(self) -> float:
        return self.bias_dps[1] / self.unit_dps

    @property
    def center_dps(self) -> tuple[float, float]:
        """Where both faces' readings are expected, turned so that the true rate is positive."""
        middle = self.table_dps * self.scale[0]
        return middle + self.bias_dps[0], middle - self.bias_dps[0]


class GyrocalNet(nn.Module):
    """Block means of both faces [N, 24] (measured - true rate, deg/s; what lies beyond the stage counts as nothing) and the
    stage [N, 3] (one-hot: 2, 4 or 6 s) -> [N, 4]: scale, bias_dps and their standard deviations."""

    blocks_of: Tensor

    def __init__(self, shape: GyrocalShape, knowledge: Knowledge) -> None:
        super().__init__()
        self.shape, self.knowledge = shape, knowledge
        self.first = nn.Linear(BLOCKS, shape.hidden, bias=False)
        self.start = nn.Parameter(0.1 * torch.randn(STAGES, shape.hidden))
        """The first layer's biases, one set a stage."""
        self.second = nn.Linear(shape.hidden, shape.hidden)
        self.last = nn.Linear(shape.hidden, 2)
        self.straight = nn.Parameter(torch.zeros(STAGES, BLOCKS))
        """The linear part of m, past the layers: the least squares that the layers correct."""
        self.register_buffer("blocks_of", stage_blocks())

    def face(self, x: Tensor, stage: Tensor) -> tuple[Tensor, Tensor]:
        """Mean m and precision p of u, in units, of one face's centered block means [N, 24]; shapes [N, 1]."""
        leaky = nn.functional.leaky_relu
        h = leaky(self.first(x) + stage @ self.start, self.shape.leak)
        out = self.last(leaky(self.second(h), self.shape.leak))
        m = ((stage @ self.straight) * x).sum(1, keepdim=True) + out[:, :1]
        return m, torch.exp(out[:, 1:].clamp(-LARGEST_LOG_PRECISION, LARGEST_LOG_PRECISION))

    def standard(self, up: Tensor, down: Tensor, stage: Tensor) -> tuple[Tensor, Tensor]:
        """Posterior mean and variance of scale and bias [N, 2], in deviations and variances of their priors."""
        know = self.knowledge
        faces = []
        for y, sign, center in ((up, 1.0, know.center_dps[0]), (down, -1.0, know.center_dps[1])):
            x = (sign / know.unit_dps) * y.clamp(-know.clip_dps, know.clip_dps) - center / know.unit_dps
            faces.append(self.face(x * (stage @ self.blocks_of), stage))
        return merge(know.scale_units, know.bias_units, *faces[0], *faces[1])

    def forward(self, up: Tensor, down: Tensor, stage: Tensor) -> Tensor:
        mean, variance = self.standard(up, down, stage)
        know = self.knowledge
        center = torch.tensor([know.scale[0], know.bias_dps[0]])
        sd = torch.tensor([know.scale[1], know.bias_dps[1]])
        return torch.cat([center + sd * mean, sd * torch.sqrt(variance)], dim=1)


def stage_blocks() -> Tensor:
    """[3, 24]: 1 for the blocks that a stage has seen."""
    return (torch.arange(BLOCKS) < BLOCKS_A_STAGE * torch.arange(1, STAGES + 1)[:, None]).float()


def merge(a: float, b: float, m_up: Tensor, p_up: Tensor, m_down: Tensor, p_down: Tensor) -> tuple[Tensor, Tensor]:
    """Two measurements of a·s + b·t (up) and a·s - b·t (down), s and t standard normal: their posterior [N, 2].

    Written out so that nothing cancels.
    """
    both, cross = p_up + p_down, 2 * p_up * p_down
    det = 1 + (a * a + b * b) * both + 2 * a * a * b * b * cross
    s = a * (p_up * m_up + p_down * m_down + b * b * cross * (m_up + m_down)) / det
    t = b * (p_up * m_up - p_down * m_down + a * a * cross * (m_up - m_down)) / det
    return torch.cat([s, t], 1), torch.cat([1 + b * b * both, 1 + a * a * both], 1) / det


def negative_log_likelihood(mean: Tensor, variance: Tensor, truth: Tensor) -> Tensor:
    """Of the truth [N, 2] (in deviations of the priors) under the posterior: it pays to be right, and to know how right."""
    return 0.5 * (torch.log(variance) + (mean - truth) ** 2 / variance).mean()
