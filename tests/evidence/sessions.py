"""Small sessions with known noise and a planted term, for the evidence."""

from collections.abc import Callable, Sequence

import numpy as np

from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.inference.fitted import AxisFit
from gyrocal.recording.session import Session
from make_runs import Array, make_run, make_session

WHITE_DPS = 0.04
RATES_DPS = (0.0, 60.0, -60.0, 120.0, -120.0)
Planted = Callable[[Array, Array, float, int], Array]
"""A term [n] from the time [n] s, the temperature [n] degC, the rate dps and the number of the power cycle."""


def session(
    seed: int, planted: Planted | None = None, *, cycles: int = 6, seconds: float = 12.0, rate_hz: float = 20.0,
    rates_dps: Sequence[float] = RATES_DPS, turn_on_dps: float = 0.005,
) -> Session:  # fmt: skip
    """Power cycles of runs at several rates, each with a temperature of its own that rises as the part warms itself."""
    random = np.random.default_rng(seed)
    t_s = np.arange(int(seconds * rate_hz)) / rate_hz
    runs = []
    for cycle in range(cycles):
        room_c, offset_dps = random.uniform(20, 30), turn_on_dps * random.standard_normal()
        for k, rate in enumerate(rates_dps):
            on_s = 3.0 + k * (seconds + 5.0)
            temp_c = room_c + 2.0 * (1 - np.exp(-(on_s + t_s) / 60))
            y = 1.002 * rate + 0.3 + offset_dps + WHITE_DPS * random.standard_normal((3, t_s.size))
            y[:2] -= 1.002 * rate
            if planted is not None:
                y[2] += planted(t_s, temp_c, rate, cycle)
            runs.append(
                make_run(t_s, y.T, table_rate_dps=rate, scenario=f"s{cycle:03d}", power_on_s=on_s, temp_c=temp_c)
            )
    return make_session(*runs, axis="z")


def fitted(made: Session, axis: str = "z") -> AxisFit:
    """The default model of one axis."""
    return fit(made, Model.builtin("default"), axes=[axis]).axes[axis]
