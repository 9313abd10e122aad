"""What a session is to hold, and what it held."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AXES = "xyz"


@dataclass(frozen=True)
class Effect:
    """One planted effect: its id, its parameters named as in the library, and the axes of the sensor that show it."""

    id: str
    parameters: Mapping[str, float]
    axes: str


@dataclass(frozen=True)
class Case:
    """One session to be made. `expected` are the ids to be named, `rivals` those hardly told from them by it.

    Kinds: "null" (nothing to name), "effect", "pair", "set" (two to five effects), "confounded" (real, but this protocol
    cannot show it apart from `rivals`), "unknown" (outside the library). Constant rates: "paper", "full" and "long" (one
    run). With a reference of the rate: "swing" (a slow sinusoid), "staircase" (levels from rest to the highest rate and
    back), "hand" (turned by hand, with an encoder) and "chamber" (a few levels while the temperature ramps up and down).
    `seconds` is the length of one run, `vibration_g` the strongest vibration (rms) of any run.
    """

    name: str
    kind: str
    protocol: str
    seed: int
    seconds: float
    effects: tuple[Effect, ...] = ()
    expected: tuple[str, ...] = ()
    rivals: tuple[str, ...] = ()
    identified_in: tuple[str, ...] = ()
    scenarios: int = 9
    table_axis: str = "z"
    ou_sd_dps: float = 0.0
    ou_tau_s: float = 30.0
    turn_on_sd_dps: float = 0.0
    climate: str = "room"
    full_scale_dps: float = 250.0
    rates_dps: tuple[float, ...] = (30.0, 78.0, 150.0)
    rate_spread: float = 0.03
    latitude_deg: float | None = None
    accelerometer: bool = True
    table_angle: bool = False
    poll_hz: float = 145.0
    odr_hz: float = 416.0
    cutoff_hz: float = 136.0
    noise_density_dps: float = 3.8e-3  # per sqrt(Hz), one-sided, before the low-pass
    reference_sd_dps: float = 0.0
    largest_scale: float | None = None  # uniform up to this size; None: a data sheet's normal distribution
    largest_bias_dps: float = 0.7
    vibration_g: float = 0.0
    file_format: str = "csv"


@dataclass(frozen=True)
class RunTruth:
    """What one run held. Arrays over samples are [n], over axes and samples [3, n]; axes in the order x, y, z.

    `injected_dps[id]` is what the effect added to the reading, through the low-pass; for a fault of the digital side
    (quantization, saturation, sampling_fault, stuck_bit) the reading with the fault minus the reading without.
    `bias_dps` [3] is the bias of this power cycle, turn-on offset included.
    """

    file: str
    scenario: str
    face: str
    day: int
    power_on_s: float
    table_rate_dps: float | None
    t_s: Array
    rate_dps: Array
    temp_c: Array
    table_angle_deg: Array
    acceleration_g: Array
    cycle_s: Array
    scale: Array
    bias_dps: Array
    drift_dps: Array
    earth_dps: Array
    injected_dps: dict[str, Array]


@dataclass(frozen=True)
class Truth:
    """What `make` planted: `scale` and `bias_dps` are [3] at 25 degC; `white_sd_dps` is of one polled sample."""

    case: Case
    scale: Array
    bias_dps: Array
    white_sd_dps: float
    lsb_dps: float
    runs: list[RunTruth] = field(default_factory=list)

    @property
    def effect_ids(self) -> tuple[str, ...]:
        return tuple(effect.id for effect in self.case.effects)

    @property
    def parameters(self) -> dict[str, dict[str, float]]:
        return {effect.id: dict(effect.parameters) for effect in self.case.effects}


def random_of(case: Case, *keys: str | int) -> np.random.Generator:
    """A stream of its own for each purpose: the noise of a seed stays the same whatever effect is planted."""
    return np.random.default_rng([case.seed, *(zlib.crc32(str(key).encode()) for key in keys)])
