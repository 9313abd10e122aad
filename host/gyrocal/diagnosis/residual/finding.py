"""The result of one test of the residual."""

from __future__ import annotations

from dataclasses import dataclass, field

from gyrocal.inference.blocks import BLOCK_S
from gyrocal.variables.shapes import Shape, Steps


@dataclass(frozen=True)
class Finding:
    """A misfit on one axis that depends on one variable.

    ``chance`` is the probability that noise alone produces as much. ``strength`` is the signal-to-noise ratio in standard
    deviations. ``shape`` is the fitted shape if a probe made the finding.
    """

    axis: str
    against: str
    strength: float
    chance: float
    amplitude_dps: float
    note: str
    shape: Shape | None = field(default=None, repr=False, compare=False)
    snr: float = 0.0
    """Signal-to-noise ratio in standard deviations, if ``strength`` is limited by the reference of the test."""
    band_hz: tuple[float, float] | None = field(default=None, repr=False, compare=False)
    """The lowest and the highest frequency of a finding against the frequency, Hz."""
    of_sets: bool = False
    """True if no test of the residual finds it, but sets of effects explain the axis, and noise alone does not."""

    @property
    def times_rate(self) -> bool:
        """True if the shape is proportional to the true rate."""
        return isinstance(self.shape, Steps) and self.shape.times_rate

    @property
    def above_blocks(self) -> bool:
        """True for a line or a band of frequencies that block means do not show."""
        return self.band_hz is not None and self.band_hz[0] > 0.5 / BLOCK_S
