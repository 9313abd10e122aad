"""A vibration at one frequency."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from gyrocal.effects.base import Effect, Law, Looks, Objection, Parameter, Refinement, Values, elapsed_s
from gyrocal.effects.optional import is_left_of_a_line
from gyrocal.effects.order_tone import harmonic_of_turn
from gyrocal.effects.wave import Tone
from gyrocal.parameter import POSITIVE
from gyrocal.recording.once import once
from gyrocal.recording.session import AXES, Array, Run

LOWEST_HZ = 1.0
PEAKS = 2
BESIDE = 2
"""Samples of a measured rate before and after each reading that describe it, whatever delays or smooths it."""


@once
def _power(runs: Sequence[Run], axis: int) -> tuple[Array, Array]:
    """Frequencies [k] in Hz, and the mean periodogram [k] of the readings divided by its level between lines."""
    from gyrocal.noise.spectrum import evenly_spaced, spectrum

    steady = [r for r in runs if not r.rate_is_mean]
    residuals = [_left(r, axis) for r in steady]
    counts_dps = (r.count_dps(axis) for r in steady)
    even, rate_hz = evenly_spaced(residuals, [r.sample_s for r in steady], runs[0].sample_rate_hz)
    found = spectrum(even, rate_hz, LOWEST_HZ, max(counts_dps, default=0.0))
    return found.frequency_hz, found.ratio


def _left(run: Run, axis: int) -> Array:
    """The readings of an axis [n] without the true rate, and without all that follows a measured one: motion has lines too."""
    own_dps = run.rate_dps if run.axis_index == axis else np.zeros(len(run))
    rates = [run.about(name).rate_dps for name in AXES] if run.three_axes else [run.rate_dps]
    if run.table_rate_dps is not None or not np.isfinite(rates).all():
        return np.asarray(run.gyro_dps[:, axis] - own_dps)
    beside = [np.clip(np.arange(len(run)) + k, 0, len(run) - 1) for k in range(-BESIDE, BESIDE + 1)]
    columns = np.column_stack([np.ones(len(run)), *(w[at] for w in rates for at in beside)])
    size = np.linalg.norm(columns, axis=0) + 1e-300
    y = run.gyro_dps[:, axis]
    return np.asarray(y - columns / size @ np.linalg.lstsq(columns / size, y, rcond=1e-9)[0])


class VibrationTone(Tone):
    id = "vibration_tone"
    wanders = True
    title = "A vibration's tone"
    cause = (
        "A motor, a fan, mains hum in the supply or a resonance of the mount vibrates at a fixed frequency. A tone "
        "averages out over whole periods. A tone above half the sampling rate is aliased and may appear at a few "
        "hertz."
    )
    equation = "A_dps·sin(2π·f_hz·t + phase)"
    looks_like = (
        "table_ripple, if the table turns at one rate only (a tone keeps its frequency when the rate changes)"
    )
    measure_next = (
        "a run at another table rate and one at rest with the motor on; at another sampling rate an alias changes its "
        "frequency, a true tone does not"
    )
    parameters = (
        Parameter(
            "f_hz", "Hz", (1.0, 200.0), "fans and motors; up to half the sampling rate", 23.0, POSITIVE,
            search=(1.0, 200.0), sized=False,
        ),
        Parameter("A_dps", "dps", (0.002, 0.2), "consumer MEMS gyroscopes near motors and fans", 0.03),
        Parameter("phase_deg", "deg", (-180.0, 180.0), "unknown at the start of each run", sized=False),
    )
    nonlinear = ("f_hz",)
    is_line = True
    offered_as = "a vibration"
    law = Law({"f_hz": 3.0, "A_dps": 0.02, "phase_deg": 90.0}, "0.02*cos(2*pi*3*t)")

    def variants(self, runs: Sequence[Run], axis: int) -> list[Values]:
        """The strongest lines of the spectrum, averaged over the runs."""
        frequency_hz, power = _power(runs, axis)
        tops = np.flatnonzero((power >= np.roll(power, 1)) & (power >= np.roll(power, -1)))
        peaks = tops[np.argsort(power[tops])[::-1][:PEAKS]]
        return [{"f_hz": float(frequency_hz[k]), "A_dps": 0.0} for k in peaks]

    def looks(self, runs: Sequence[Run], axis: int) -> Looks:
        return Looks(int(_power(runs, axis)[0].size))

    def highest_hz(self, runs: Sequence[Run], values: Mapping[str, float]) -> float:
        return values["f_hz"]

    def objections(
        self, values: Values, runs: Sequence[Run], axis: int, known: Sequence[tuple[Effect, Values]]
    ) -> Iterable[Objection]:
        """Rectified vibration has a line of its own, which the gyroscope's low-pass changes; a pulse once a turn has many."""
        f_hz = values["f_hz"]
        if harmonic_of_turn(runs, axis, f_hz) or is_left_of_a_line(known, runs, axis, f_hz, values["A_dps"]):
            yield Objection.REPEATS

    def refinement(self, name: str, values: Mapping[str, float], runs: Sequence[Run], axis: int) -> Refinement:
        return Refinement(0.2 / (values["f_hz"] * max(r.duration_s for r in runs)))

    def periods(self, run: Run, values: Mapping[str, float]) -> Array:
        return values["f_hz"] * elapsed_s(run)
