"""Find where a model fails by running every test of the residual on every axis."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain

import numpy as np

from gyrocal.diagnosis.finding import Finding
from gyrocal.diagnosis.probes import of_session, probe
from gyrocal.diagnosis.readings import reading_fault, single_readings
from gyrocal.diagnosis.whiteness import too_much_power
from gyrocal.inference.fitted import Fit
from gyrocal.noise.spectrum import Spectrum
from gyrocal.policy import POLICY
from gyrocal.recording.session import AXES
from gyrocal.threads import each
from gyrocal.variables.frequency import Frequency

Progress = Callable[[str], None]


def _line(fitted: Fit, axis: str, spectrum: Spectrum, alarm: float) -> Finding | None:
    """Test for a line in the residual's spectrum."""
    peak = spectrum.peak()
    if peak is None or peak.chance >= alarm:
        return None
    noise_dps = float(np.sqrt(np.median(spectrum.level) * fitted.session.sample_rate_hz / 2))
    strength = float(np.sqrt(spectrum.segments * spectrum.samples / 2) * peak.amplitude_dps / noise_dps)
    note = f"a line of {peak.amplitude_dps * 1e3:.3g} mdps at {peak.frequency_hz:.4g} Hz"
    return Finding(axis, Frequency.name, strength, peak.chance, peak.amplitude_dps, note)


def _bump(fitted: Fit, axis: str, spectrum: Spectrum, alarm: float) -> Finding | None:
    """Test for a bump in the residual's spectrum."""
    bump = spectrum.bump()
    if bump is None or bump.chance >= alarm:
        return None
    note = f"{bump.amplitude_dps * 1e3:.3g} mdps that wander between {bump.low_hz:.3g} and {bump.high_hz:.3g} Hz"
    return Finding(axis, Frequency.name, bump.sigma, bump.chance, bump.amplitude_dps, note)


def _not_white(fitted: Fit, axis: str, spectrum: Spectrum, alarm: float) -> Finding | None:
    """Test for more power than noise in a band of frequencies."""
    return too_much_power(fitted.axes[axis], axis, alarm)


def _code(fitted: Fit, axis: str, spectrum: Spectrum, alarm: float) -> Finding | None:
    """Test for a bit of the reading that does not toggle."""
    steps_dps = (fault.step_dps(values) for fault, values in fitted.model.faults(axis))
    return reading_fault(fitted.session, axis, alarm, max(steps_dps, default=0.0))


def _outliers(fitted: Fit, axis: str, spectrum: Spectrum, alarm: float) -> Finding | None:
    """Test for outliers that neither the model nor the noise's own tail explains."""
    known = any(fault.throws_out(values) for fault, values in fitted.model.faults(axis))
    return None if known else single_readings(fitted.session, axis, alarm)


BEYOND_NOISE = (_line, _bump, _not_white, _code, _outliers)
"""The tests of an axis besides the probes of its variables. Each has an equal share of the alarm rate."""


def find_misfit(
    fitted: Fit, spectra: dict[str, Spectrum], axes: Sequence[str], progress: Progress | None = None,
) -> list[Finding]:  # fmt: skip
    """The findings of every test on each of the ``axes``, strongest first.

    A test reports a finding if the probability that noise alone produces it is below the test's share of
    ``Policy.misfit_alarm``.
    """
    if sum(b.t_s.size for b in fitted.blocks) < POLICY.least_blocks:
        return []
    probes = {axis: of_session(fitted.session, AXES.index(axis)) for axis in axes}
    tests = sum(len(shapes) for on_axis in probes.values() for _, shapes in on_axis)
    share = POLICY.misfit_alarm / max(1, tests + len(BEYOND_NOISE) * len(axes))

    def on(axis: str) -> list[Finding]:
        probed = []
        for against, shape in ((against, shape) for against, shapes in probes[axis] for shape in shapes):
            if progress is not None:
                progress(f"looking at {axis} against {against.replace('_', ' ')}")
            finding = probe(fitted.axes[axis], axis, against, shape, share)
            if finding is not None and finding.chance < share:
                probed.append(finding)
        beyond = [test(fitted, axis, spectra[axis], share) for test in BEYOND_NOISE]
        return probed + [finding for finding in beyond if finding is not None]

    return sorted(chain.from_iterable(each(on, axes, fitted.session.rows)), key=lambda f: -f.strength)
