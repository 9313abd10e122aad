"""Find where a model fails by running every test of the residual on every axis."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from gyrocal import tails
from gyrocal.diagnosis.residual.bias_step import steps_of_runs
from gyrocal.diagnosis.residual.coherence import line_of_reference, of_angles
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.diagnosis.residual.levels import Remainder, spectrum_of
from gyrocal.diagnosis.residual.power_band import hump
from gyrocal.diagnosis.residual.probes import of_session, probe
from gyrocal.diagnosis.residual.rate_wave import over_rate
from gyrocal.diagnosis.residual.reading_tests import dropped_carry, reading_fault, single_readings
from gyrocal.diagnosis.residual.rounding import beside_rounding, is_of_reference, rounding_power
from gyrocal.diagnosis.residual.told_once import curves_within, leader, strongest_first, told_once, without_echoes
from gyrocal.diagnosis.residual.whiteness import too_much_power
from gyrocal.effects.byte_fault import ByteFault
from gyrocal.effects.optional import is_left_of_a_line
from gyrocal.effects.order_tone import over_turns, told_from_frequency
from gyrocal.inference.fitted import Fit
from gyrocal.inference.noise_search import LEAST_WHITE_DPS
from gyrocal.noise.patches import patch
from gyrocal.noise.spectrum import Peak, Spectrum
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES, Array
from gyrocal.threads import each
from gyrocal.units import rate_text
from gyrocal.variables.frequency import Frequency
from gyrocal.variables.order import Order
from gyrocal.variables.reading import Reading
from gyrocal.variables.shapes import TableWave, Transient

Progress = Callable[[str], None]


def _line(fitted: Fit, axis: str, remainder: Remainder, alarm: float) -> Finding | None:
    """Test for a line in the residual's spectrum."""
    spectrum = remainder.spectrum
    peak = _unexplained_peak(fitted, axis, spectrum, alarm)
    if peak is None:
        return None
    if line_of_reference(fitted, axis, peak.frequency_hz, peak.amplitude_dps):
        return None
    noise_dps = float(np.sqrt(np.median(spectrum.level) * fitted.session.sample_rate_hz / 2))
    strength = float(np.sqrt(spectrum.segments * spectrum.samples / 2) * peak.amplitude_dps / noise_dps)
    note = f"a line of {rate_text(peak.amplitude_dps)} at {peak.frequency_hz:.4g} Hz"
    line_hz = peak.frequency_hz
    strength = _at_least(strength, peak.chance)
    return Finding(axis, Frequency.name, strength, peak.chance, peak.amplitude_dps, note, band_hz=(line_hz, line_hz))


def _at_least(strength: float, chance: float) -> float:
    """The strength of a line over the noise of all frequencies, or what its chance says, if that is more.

    The chance is that beside the neighbours of the line, which may lie far below the noise of all frequencies together.
    """
    return max(strength, float(tails.normal_z(max(chance, np.finfo(np.float64).tiny))))


def _unexplained_peak(fitted: Fit, axis: str, spectrum: Spectrum, alarm: float) -> Peak | None:
    """The strongest line that is not left of a line of the model's own terms by a filter; None if noise explains it."""
    return next((peak for peak, left in _peaks(fitted, axis, spectrum, alarm) if not left), None)


def _peaks(fitted: Fit, axis: str, spectrum: Spectrum, alarm: float) -> Iterator[tuple[Peak, bool]]:
    """The lines that noise does not explain, strongest first, and whether a filter may have left them of the model's own."""
    known = [(t.effect, t.values) for t in fitted.model.on(axis)]
    runs = [b.run for b in fitted.blocks]
    while (peak := spectrum.peak()) is not None and peak.chance < alarm:
        hz = peak.frequency_hz
        yield peak, is_left_of_a_line(known, runs, AXES.index(axis), hz, peak.amplitude_dps)
        spectrum = spectrum.without_line(hz)


def _order(fitted: Fit, axis: str, remainder: Remainder, alarm: float) -> Finding | None:
    """Test for a line in the residual's spectrum over the table's angle.

    A line that is no whole number per turn may as well be a frequency, unless the table's motion tells them apart.
    """
    runs = [b.run.about(axis) for b in fitted.blocks]
    turning = [r for r in runs if not r.rate_is_mean and np.any(r.rate_dps)]
    if not turning:
        return None
    peaks = over_turns(turning, [remainder.by_run[r.index] for r in turning], AXES.index(axis)).peaks(1)
    if not peaks or peaks[0].chance >= alarm:
        return None
    (peak,) = peaks
    if peak.whole is None and not told_from_frequency(turning):
        return None
    noise_dps = fitted.axes[axis].noise.white_sd_dps
    strength = peak.amplitude_dps / max(noise_dps, LEAST_WHITE_DPS) * float(np.sqrt(sum(map(len, turning)) / 2))
    note = f"a line of {rate_text(peak.amplitude_dps)}, {peak.words()}"
    strength = _at_least(strength, peak.chance)
    return Finding(axis, Order.name, strength, peak.chance, peak.amplitude_dps, note, TableWave(peak.whole or peak.order))


def _bump(fitted: Fit, axis: str, remainder: Remainder, alarm: float) -> Finding | None:
    """Test for a bump in the residual's spectrum."""
    if of_angles(fitted):
        return None
    bump = remainder.spectrum.bump()
    if bump is None or bump.chance >= alarm:
        return None
    note = f"{rate_text(bump.amplitude_dps)} that wander between {bump.low_hz:.3g} and {bump.high_hz:.3g} Hz"
    return Finding(axis, Frequency.name, bump.sigma, bump.chance, bump.amplitude_dps, note)


def _not_white(fitted: Fit, axis: str, remainder: Remainder, alarm: float) -> Finding | None:
    """Test for more power than noise in a band of frequencies."""
    if of_angles(fitted):
        return None
    return too_much_power(fitted.axes[axis], axis, alarm)


def _hump(fitted: Fit, axis: str, remainder: Remainder, alarm: float) -> Finding | None:
    """Test for more power about one frequency than noise has."""
    if of_angles(fitted):
        return None
    return hump(fitted.axes[axis], axis, alarm)


def _patch(fitted: Fit, axis: str, remainder: Remainder, alarm: float) -> Finding | None:
    """Test for a band that is louder than its neighbours, all the time, from time to time or for some seconds."""
    if of_angles(fitted):
        return None
    lines_hz = [peak.frequency_hz for peak, left in _peaks(fitted, axis, remainder.spectrum, alarm) if left]
    found = patch(list(remainder.by_run.values()), fitted.session.sample_rate_hz, lines_hz)
    if found is None or found.chance >= alarm:
        return None
    note = f"{rate_text(found.amplitude_dps)} between {found.low_hz:.3g} and {found.high_hz:.3g} Hz"
    if found.seconds is None:
        note += ", which come and go" if found.unsteady else " beyond the noise on both sides"
    else:
        run = fitted.session.runs[list(remainder.by_run)[found.run]]
        note += f" for {found.seconds:.2g} s, {found.from_s:.4g} s after the start of {run.file}"
    return Finding(
        axis, Frequency.name, found.sigma, found.chance, found.amplitude_dps, note, band_hz=(found.low_hz, found.high_hz),
    )  # fmt: skip


def _code(fitted: Fit, axis: str, remainder: Remainder, alarm: float) -> Finding | None:
    """Test for a bit of the reading that does not toggle."""
    steps_dps = (fault.step_dps(values) for fault, values in fitted.model.faults(axis))
    return reading_fault(fitted.session, axis, alarm, max(steps_dps, default=0.0))


def _outliers(fitted: Fit, axis: str, remainder: Remainder, alarm: float) -> Finding | None:
    """Test for outliers that neither the model nor the noise's own tail explains."""
    known = any(fault.throws_out(values) for fault, values in fitted.model.faults(axis))
    return None if known else single_readings(fitted.session, axis, alarm)


OF_FREQUENCY = (_line, _bump, _not_white, _hump)
"""The tests against the frequency."""
BEYOND_NOISE = (*OF_FREQUENCY, _order, _code, _outliers)
"""The tests of an axis besides the probes of its variables. Each has an equal share of the alarm rate."""


def _carry(fitted: Fit, axis: str) -> list[Finding]:
    """A lost carry that the model does not explain. Noise does not produce it, so this test has no share of the alarm rate."""
    known = any(isinstance(term.effect, ByteFault) for term in fitted.axes[axis].terms)
    found = None if known else dropped_carry(fitted.session, axis)
    return [] if found is None else [found]


def of_frequency(fitted: Fit, axis: str, by_run: dict[int, Array], share: float) -> list[Finding]:
    """The findings of the tests against the frequency in residuals [n] of runs by their index."""
    remainder = Remainder(by_run, spectrum_of(fitted, axis, by_run))
    return [f for f in (test(fitted, axis, remainder, share) for test in OF_FREQUENCY) if f is not None]


@dataclass(frozen=True)
class Misfit:
    """The findings, strongest first; the probe that fits best on each axis; each test's share of the alarm rate."""

    found: list[Finding]
    nearest: dict[str, Finding]
    share: float


def find_misfit(
    fitted: Fit, remainders: dict[str, Remainder], axes: Sequence[str], progress: Progress | None = None,
) -> Misfit:  # fmt: skip
    """The findings of every test on each of the ``axes``. ``remainders`` holds what the model leaves of each axis.

    A test reports a finding if the probability that noise alone produces it is below the test's share of
    ``Policy.misfit_alarm``. Four shares of each axis are left: for a wave over the rate, for steps of single runs, for
    patches, which are looked for where nothing else is found, and for the test of the excess, which needs the floor.
    """
    if sum(b.t_s.size for b in fitted.blocks) < POLICY.least_blocks:
        return Misfit([], {}, 0.0)
    probes = {axis: of_session(fitted.session, AXES.index(axis)) for axis in axes}
    tests = sum(len(shapes) for on_axis in probes.values() for _, shapes in on_axis)
    share = POLICY.misfit_alarm / max(1, tests + (len(BEYOND_NOISE) + 4) * len(axes))

    block_s = float(np.median(np.concatenate([np.diff(b.t_s) for b in fitted.blocks])))

    def on(axis: str) -> tuple[list[Finding], Finding | None]:
        probed = []
        current = beside_rounding(fitted, axis)
        for against, shape in ((against, shape) for against, shapes in probes[axis] for shape in shapes):
            if progress is not None:
                progress(f"looking at {axis} against {against.replace('_', ' ')}")
            finding = probe(current, axis, against, shape, share)
            if finding is not None:
                probed.append(finding)
        waves = over_rate(current, axis, share)
        beyond = [waves, *(test(fitted, axis, remainders[axis], share) for test in BEYOND_NOISE)]
        # where rounding could not be fitted, it may be all of what is smaller
        rounding = rounding_power(current) if current is fitted.axes[axis] else 0.0
        found = [f for f in (*(p for p in probed if p.chance < share), *beyond) if f is not None] + _carry(fitted, axis)
        found = [f for f in found if f.against == Reading.name or f.amplitude_dps**2 / 2 > rounding]
        found = [f for f in found if not is_of_reference(f.against, f.amplitude_dps, current)]
        found = told_once(found, [b.run.about(axis) for b in fitted.blocks], block_s)
        if any(isinstance(f.shape, Transient) for f in found):
            found += curves_within(current, axis, probes[axis], found, share)
        once = steps_of_runs(current, axis, share, alone=not found)
        if once is not None and leader(current, [*found, once]) is once:
            found.append(once)
        found = without_echoes(fitted, axis, found, share, of_frequency)
        if not found:  # whatever another test finds is in some patch of the spectrogram too
            seen = _patch(fitted, axis, remainders[axis], share)
            found = [] if seen is None or seen.amplitude_dps**2 / 2 <= rounding else [seen]
        return found, min(probed, key=lambda f: f.chance, default=None)

    tested = dict(zip(axes, each(on, axes, fitted.session.rows), strict=True))
    found = strongest_first(chain.from_iterable(findings for findings, _ in tested.values()))
    return Misfit(found, {axis: best for axis, (_, best) in tested.items() if best is not None}, share)
