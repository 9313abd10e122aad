"""The test of whiteness: quiet on noise of the model's kind, loud on what no term of the model makes."""

from dataclasses import replace

import numpy as np
import pytest

from gyrocal.diagnosis.residual import whiteness
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.diagnosis.residual.whiteness import too_much_power
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.noise.spectrum import spectrum
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate
from make_runs import make_run, make_session


def with_signal(session: Session, signal_dps: np.ndarray) -> Session:
    return session.with_runs(
        replace(r, frame=r.table.with_columns(gz_dps=r.gyro_dps[:, 2] + signal_dps[: len(r)])) for r in session.runs
    )


def test_its_chances_are_uniform_on_noise() -> None:
    chances = []
    for seed in range(6):
        session = simulate(None, "paper", [], seed, scenarios=3, seconds=30)[0]
        fitted = fit(session, Model.builtin("default"))
        for axis in fitted.axes:
            found = too_much_power(fitted.axes[axis], axis, alarm=2.0)
            assert found is not None
            chances.append(found.chance)
    assert min(chances) > 0.01 / len(chances)
    assert np.mean(np.array(chances) < 0.5) < 0.8


@pytest.mark.parametrize("band_hz", [(0.4, 0.8), (1.5, 3.0)])
def test_band_limited_rumble_is_found_with_its_band_and_size(band_hz: tuple[float, float]) -> None:
    rng = np.random.default_rng(7)
    session = simulate(None, "paper", [], 1, scenarios=3, seconds=30)[0]
    n = len(session.runs[0])
    frequency_hz = np.fft.rfftfreq(n, 1 / session.sample_rate_hz)
    inside = (frequency_hz > band_hz[0]) & (frequency_hz < band_hz[1])
    rumble = np.fft.irfft(inside * np.exp(2j * np.pi * rng.random(inside.size)), n)
    rumble *= 0.012 / rumble.std()
    fitted = fit(with_signal(session, rumble), Model.builtin("default"), axes=["z"])
    found = too_much_power(fitted.axes["z"], "z", alarm=1e-4)
    assert found is not None
    assert found.against == "frequency"
    assert 0.2 * 0.012 < found.amplitude_dps < 2 * 0.012


def test_a_sweep_is_a_bump_and_low_pass_noise_and_a_tone_are_none() -> None:
    from scipy.signal import butter, lfilter

    rng = np.random.default_rng(8)
    rate_hz, t_s = 145.0, np.arange(2900) / 145.0
    white = [rng.normal(0, 0.044, t_s.size) for _ in range(12)]
    quiet = [lfilter(*butter(2, 33, fs=rate_hz), y) for y in white]
    tone = [y + 0.05 * np.sin(2 * np.pi * 23.4 * t_s + i) for i, y in enumerate(white)]
    for residuals in (white, quiet, tone):
        found = spectrum(residuals, rate_hz).bump()
        assert found is None or found.chance > 1e-3
    sweep = 0.02 * np.sin(2 * np.pi * (18 + 4 * t_s / t_s[-1]) * t_s)  # 18 to 26 Hz
    bump = spectrum([y + sweep for y in white], rate_hz).bump()
    assert (bump.low_hz, bump.high_hz) == pytest.approx((18, 26), abs=2.5)
    assert bump.amplitude_dps == pytest.approx(0.02, rel=0.25)
    assert bump.sigma > 7
    assert bump.chance < 1e-8


def test_a_line_in_a_quiet_part_of_the_spectrum_is_as_strong_as_its_chance_says() -> None:
    """It was found with a chance of 1e-202 and told as 0.6 sigma, the noise of all frequencies being that of the highest."""
    rng = np.random.default_rng(2)
    t_s = np.arange(6000) / 100
    line = np.outer(0.05 * np.sin(4 * np.pi * t_s), [1, 0, 0])
    blue = [np.diff(rng.normal(0, 3.0, (t_s.size + 2, 3)), n=2, axis=0) for _ in range(2)]
    runs = [make_run(t_s, y + line, table_rate_dps=0.0, scenario=f"s{i}") for i, y in enumerate(blue)]
    (found,) = (f for f in measure(make_session(*runs)).where if f.note.startswith("a line of"))
    assert found.band_hz == (pytest.approx(2.0, abs=0.01),) * 2
    assert found.strength > 10


def test_a_band_beside_which_there_is_no_power_at_all_is_no_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    """Readings of 100 000 deg/s leave nothing but rounding in some bands, by which another was divided."""
    bands = [whiteness._Band(k, k + 1.0, ratio, ratio, 40.0) for k, ratio in enumerate((0.0, 50.0, 0.0, 30.0, 40.0))]
    monkeypatch.setattr(whiteness, "_bands", lambda _: bands)
    found = too_much_power(None, "z", 0.5)  # type: ignore[arg-type]
    assert found is None or found.band_hz[0] > 2.0
