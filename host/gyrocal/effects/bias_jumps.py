"""The bias jumps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gyrocal.effects.base import Effect, Parameter, Values, elapsed_s
from gyrocal.session import Array, Run


class BiasJumps(Effect):
    id = "bias_jumps"
    title = "Jumps of the bias"
    cause = (
        "The bias steps to a new value from one sample to the next and stays there: a trapped charge or a stress "
        "in the package lets go, a knock moves the mount, or the chip's own calibration changes a trim. Single "
        "readings far off (outliers) are bits lost on the bus."
    )
    equation = "±size_dps from each of n moments on"
    looks_like = "drift and colored_noise, once averaged; turn_on_bias, where it jumps between runs"
    measure_next = (
        "the same recording again: jumps come at other moments; look for knocks in the accelerometer at the same time"
    )
    parameters = (
        Parameter("n", "jumps a run", (1.0, 5.0), "rare: parts that jump more often are faulty", 1.0),
        Parameter("size_dps", "dps", (0.01, 0.2), "consumer MEMS gyroscopes' random telegraph steps", 0.05),
        Parameter("first", "fraction of the run", (0.2, 0.8), "the first jump's moment: any"),
    )
    scope = "run"

    def draw(self, values: Mapping[str, float], rng: np.random.Generator) -> Values:
        drawn = super().draw(values, rng)
        return {**drawn, "size_dps": drawn["size_dps"] * float(rng.choice((-1.0, 1.0)))}

    def columns(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        return np.zeros((len(run), 0))

    def term(self, run: Run, axis: int, values: Mapping[str, float]) -> Array:
        """Jumps evenly spaced from the first to the end of the run, there and back; which way first is drawn."""
        n = round(values["n"])
        at_s = run.duration_s * np.linspace(values["first"], 1.0, n, endpoint=False)
        jumps_so_far = np.searchsorted(at_s, elapsed_s(run), side="right")
        return values["size_dps"] * (jumps_so_far % 2).astype(np.float64)
