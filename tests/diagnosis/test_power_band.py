"""A sensor's low-pass within the examined frequencies is no hump, and a hump behind one is still found."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt, welch

from gyrocal.diagnosis.residual.power_band import hump, of_block_means
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.recording.session import Session
from make_runs import make_run, make_session

WHITE_DPS, COUNT_DPS, SAMPLES = 0.002, 0.001, 12_000
PART, LOGGER = 8, 1
"""A part's filter runs faster than the samples are read; a logger's is applied to the samples."""


def session(seed: int, rate_hz: float, knee_hz: float, order: int, fine: int, hump_dps: float = 0.0) -> Session:
    """Noise at ``fine`` times the sample rate through a Butterworth filter, then sampled, and a hump at 1.2 to 2.2 Hz."""
    rng = np.random.default_rng((5, seed))
    low_pass = butter(order, knee_hz, fs=fine * rate_hz, output="sos")
    y = sosfilt(low_pass, rng.normal(size=(fine * (SAMPLES + 200), 3)), axis=0)[::fine][-SAMPLES:]
    y *= WHITE_DPS / y.std()
    wanders = sosfilt(butter(2, (1.2, 2.2), "band", fs=rate_hz, output="sos"), rng.normal(size=(SAMPLES, 3)), axis=0)
    y += hump_dps * wanders / wanders.std()
    gyro = np.round(y / COUNT_DPS) * COUNT_DPS
    return make_session(make_run(np.arange(SAMPLES) / rate_hz, gyro, table_rate_dps=0.0, lsb_dps=COUNT_DPS))


@pytest.mark.parametrize("fine", [PART, LOGGER])
@pytest.mark.parametrize(("rate_hz", "knee_hz", "order"), [(20.0, 4.0, 2), (20.0, 3.0, 2), (25.0, 4.0, 1), (50.0, 5.0, 2)])
def test_a_low_pass_is_no_hump(rate_hz: float, knee_hz: float, order: int, fine: int) -> None:
    """Behind a second-order filter at a fifth of 20 Hz, each session had "1.7 mdps beyond noise, most between 1 and 2.7 Hz"."""
    for seed in range(2):
        fitted = fit(session(seed, rate_hz, knee_hz, order, fine), Model.builtin("default"), axes="z").axes["z"]
        assert hump(fitted, "z", 1e-4) is None
    disturbed = session(0, rate_hz, knee_hz, order, fine, 1.2e-3)
    found = hump(fit(disturbed, Model.builtin("default"), axes="z").axes["z"], "z", 1e-4)
    assert found is not None
    assert found.band_hz is not None
    assert found.band_hz[0] < 2.0 < found.band_hz[1] * 1.2


@pytest.mark.parametrize("digital", [False, True])
@pytest.mark.parametrize(("samples", "knee_hz", "order"), [(2, 4.0, 2), (3, 3.0, 4), (10, 5.0, 1)])
def test_the_density_of_block_means_is_that_of_filtered_noise(samples: int, knee_hz: float, order: int, digital: bool) -> None:
    """Welch's estimate for a long recording: the filter applied to the samples, or to samples sixteen times as fast."""
    rng, rate_hz, fine = np.random.default_rng(7), 10.0 * samples, 1 if digital else 16
    low_pass = butter(order, knee_hz, fs=fine * rate_hz, output="sos")
    y = sosfilt(low_pass, rng.normal(size=fine * samples * 200_000))[::fine]
    frequency_hz, density = welch(y.reshape(-1, samples).mean(axis=1), fs=10.0, nperseg=200)
    inside = (frequency_hz > 0.1) & (frequency_hz < 4.9)
    expected = of_block_means(frequency_hz[inside], knee_hz, order, 0.1, samples, digital=digital)
    ratio = density[inside] / expected
    assert np.abs(ratio / np.median(ratio) - 1).max() < 0.12
