"""Steps of the reading that are coarser than the session states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gyrocal.effects.base import Parameter
from gyrocal.effects.quantities import grid_dps
from gyrocal.effects.reading_fault import Detected, ReadingFault
from gyrocal.recording.session import Array, Run


class Quantization(ReadingFault):
    id = "quantization"
    title = "Coarse steps"
    cause = (
        "The readings lie on a grid that is coarser than one count. The chip is set to a larger range than "
        "expected, low bits are lost in a conversion or a shift, or the log was written with too few digits. "
        "If the noise is smaller than a step, averaging does not reduce the error."
    )
    equation = "lsb_dps·round(y/lsb_dps) - y"
    looks_like = (
        "white noise of lsb_dps/√12, if the noise is larger than a step; a stuck bit, which omits steps"
    )
    measure_next = (
        "a histogram of the readings at rest; read the range register back and compare its count with the grid"
    )
    parameters = (
        Parameter(
            "lsb_dps",
            "dps",
            (0.004375, 0.07),
            "LSM6DSO datasheet, table 2: 4.375-70 mdps a count at 125-2000 dps",
            0.07,
        ),
    )

    def missing(self, runs: Sequence[Run], axis: int) -> str | None:
        return None if all(r.lsb_dps is not None for r in runs) else "lsb_dps in session.toml, the size of one count"

    def detect(self, runs: Sequence[Run], axis: int) -> Detected | None:
        """The grid on which all readings of the axis lie, if it is coarser than the count that the session states."""
        stated = [r.lsb_dps for r in runs if r.lsb_dps is not None]
        if len(stated) < len(runs):
            return None
        count_dps = min(stated)
        own = grid_dps([r.gyro_dps[:, axis] for r in runs])
        if not (np.isfinite(own) and np.isfinite(count_dps)):  # constant readings
            return None
        factor = round(own / count_dps)
        if factor < 2 or abs(own / count_dps - factor) > 0.01 * factor:
            return None
        samples = sum(len(r) for r in runs)
        return Detected({"lsb_dps": own}, {}, float(max(1e-300, float(factor) ** -min(samples, 300))))

    def respond(self, run: Run, axis: int, modelled_dps: Array, values: Mapping[str, float], white_sd_dps: float) -> Array:
        """The mean of a noisy rate after rounding, shape [n], deg/s. Noise above half a step hides the grid (dither)."""
        step = values["lsb_dps"]
        own_sd = np.sqrt(max(white_sd_dps**2 - step**2 / 12, (0.05 * step) ** 2))
        turn = 2 * np.pi * modelled_dps / step
        out = modelled_dps.copy()
        for k in range(1, 9):
            weight = step / (np.pi * k) * np.exp(-2 * (np.pi * k * own_sd / step) ** 2)
            out += (-1) ** k * weight * np.sin(k * turn)
        return out

    def step_dps(self, values: Mapping[str, float]) -> float:
        return values.get("lsb_dps", 0.0)

    def distort(self, run: Run, y_dps: Array, values: Mapping[str, float], rng: np.random.Generator) -> Array:
        """The readings [n, 3] with this fault, deg/s."""
        return np.round(y_dps / values["lsb_dps"]) * values["lsb_dps"]
