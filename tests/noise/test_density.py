"""The noise density that a fit finds and `export` writes against the Allan deviation of allantools."""

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.signal import butter, lfilter

from gyrocal.calibration.targets import kalibr
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.noise.allan import model_deviation
from gyrocal.noise.drift import ou_noise
from make_runs import make_run, make_session
from real_recordings import recording

RATE_HZ = 100.0
WHITE = np.random.default_rng(5).normal(0, 0.05, (40_000, 3))


def wandering() -> np.ndarray:
    return WHITE + ou_noise(len(WHITE), 1 / RATE_HZ, 0.01, 20.0, 3, np.random.default_rng(6))


def low_passed() -> np.ndarray:
    return np.asarray(lfilter(*butter(2, 20.0, fs=RATE_HZ), WHITE, axis=0))


def mpu(file: str) -> np.ndarray:
    text = recording("mpu6050_multipose_tedaldi", file).read_text()
    raw = pl.read_csv(io.StringIO(text[text.index("ax,") :]))
    return raw.select(f"g{a}" for a in "xyz").to_numpy() / 131.0


def xsens() -> np.ndarray:
    raw: pl.DataFrame = pl.read_csv(recording("xsens_mti_multipose_imutk", "xsens_raw.csv.gz"))
    return raw.select(f"gyr_{a}_cnt" for a in "xyz").to_numpy()[:4500] / 83.2


SERIES: dict[str, Callable[[], np.ndarray]] = {
    "white": lambda: WHITE, "wandering": wandering, "low-passed": low_passed, "coarse": lambda: np.round(WHITE / 0.1) * 0.1,
    "MPU-6050, 449 s": lambda: mpu("example_data_tinit_calc.csv"), "MPU-6050, 100 s": lambda: mpu("imu_static_test.csv"),
    "Xsens MTi, 45 s": xsens,
}  # fmt: skip


@pytest.mark.parametrize("name", SERIES)
def test_the_noise_of_a_fit_is_that_of_allantools(
    name: str, tmp_path: Path, require_module: Callable[[str], None]
) -> None:
    """At 0.1 to 1 s, where white noise rules, also beside drift, a low-pass, and counts coarser than the noise."""
    require_module("allantools")
    import allantools

    gyro_dps = SERIES[name]()
    t_s = np.arange(len(gyro_dps)) / RATE_HZ
    fitted = fit(make_session(make_run(t_s, gyro_dps, table_rate_dps=0.0)), Model.open("default"))
    largest = 0.0
    for i, axis in enumerate("xyz"):
        tau_s, theirs, _, _ = allantools.oadev(gyro_dps[:, i], rate=RATE_HZ, data_type="freq", taus=[0.1, 0.3, 1.0])
        found = fitted.axes[axis].noise
        chance = 1 / np.sqrt(2 * t_s[-1] / tau_s)
        assert np.all(np.abs(model_deviation(tau_s, found, RATE_HZ) / theirs - 1) < 0.03 + 2.5 * chance)
        largest = max(largest, float(theirs[0] * tau_s[0] ** 0.5))
    text = kalibr.render(fitted.model, RATE_HZ, 1.0).text
    written = next(line for line in text.splitlines() if line.startswith("gyroscope_noise_density"))
    assert float(written.split()[1]) == pytest.approx(np.deg2rad(largest), rel=0.08)
