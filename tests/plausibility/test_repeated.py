"""A recording that is in a session twice counts as two independent ones, and predicts itself."""

import numpy as np

from gyrocal.plausibility import check
from gyrocal.recording.session import Array
from make_runs import make_run, make_session


def codes(*readings: Array) -> list[tuple[str, str | None, bool]]:
    """The ``same_readings`` of a session at rest with these readings [n, 3] in power cycles of their own."""
    made = [
        make_run(np.arange(len(gyro)) / 100.0, gyro, table_rate_dps=0.0, scenario=f"s{k}")
        for k, gyro in enumerate(readings)
    ]
    return [(w.code, w.file, w.blocking) for w in check(make_session(*made)) if w.code == "same_readings"]


def noise(seed: int, n: int = 500) -> Array:
    counts = np.random.default_rng(seed).normal(0.3, 0.04, (n, 3)) / 0.00875
    return np.asarray(np.rint(counts) * 0.00875)


def test_a_run_that_is_there_twice_blocks() -> None:
    assert codes(noise(1), noise(2), noise(1)) == [("same_readings", "002_up.csv", True)]


def test_other_runs_do_not() -> None:
    assert codes(noise(1), noise(2), noise(3)) == []
    assert codes(noise(1, 40), noise(1, 40)) == []  # a few coarse readings may agree by chance
    dead = noise(1) * [1.0, 1.0, 0.0]
    assert codes(dead, noise(2) * [1.0, 1.0, 0.0]) == []
    assert codes(dead, dead) == [("same_readings", "001_up.csv", True)]  # an axis that no run has says nothing


def test_readings_without_noise_are_no_copies() -> None:
    still = np.zeros((500, 3))
    assert codes(still, still, noise(1)) == []
