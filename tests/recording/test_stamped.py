"""Stamps of a host and uneven samples look alike; the readings of a moving sensor tell which they are."""

import re
from pathlib import Path

import numpy as np
import pytest

from gyrocal.plausibility import check
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import Imported, read_recording
from gyrocal.recording.stamped import even

N = 6000
TRUE_S = np.arange(N) / 100


def rates(t_s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A hand's motion of up to 2 Hz, dps."""
    waves = [40 * np.sin(2 * np.pi * f * t_s + p) for f, p in ((0.5, 0), (1.1, 1), (2.0, 2))]
    return np.column_stack([sum(waves), waves[0] - waves[1], waves[2]]) + rng.normal(0, 0.1, (t_s.size, 3))


def stamped(kind: str, t_s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The stamps that a host gives to samples of these moments."""
    n = t_s.size
    k = np.arange(n)
    steps = {"two steps": np.where(k % 22 == 21, 0.00496, 0.01024), "alternating": np.where(k % 2, 0.006, 0.014)}
    if kind in steps:
        return np.asarray(t_s + np.cumsum(steps[kind] - 0.01))
    if kind == "jitter":
        return np.sort(t_s + rng.uniform(0, 0.009, n))
    if kind == "late":  # a host that stalls, and stamps what waited for it when it is back
        late = t_s.copy()
        for k in range(100, n - 10, 250):
            late[k : k + 4] = t_s[k] + 0.032 + np.arange(4) * 1.5e-3
        return late
    if kind == "read one by one":  # 2 ms each, of what waits when the host looks; as it begins, 0.3 s of them do
        looks = 0.3 + np.cumsum(rng.choice([0.01, 0.03, 0.05], 3 * n))
        moments = looks[np.searchsorted(looks, t_s)]
        for i in range(1, n):
            moments[i] = max(moments[i], moments[i - 1] + rng.uniform(0.0012, 0.0026))
        return moments
    assert kind == "rounding"
    return np.floor(t_s * 125) / 125


def imported(tmp_path: Path, stamps: np.ndarray, readings: np.ndarray) -> tuple[np.ndarray, Imported]:
    rows = "\n".join(f"{t:.7f},{','.join(f'{v:.5f}' for v in row)}" for t, row in zip(stamps, readings, strict=True))
    (tmp_path / "log.csv").write_text(f"t_s,gx_dps,gy_dps,gz_dps\n{rows}\n")
    found = read_recording(tmp_path / "log.csv", Options(defaults={"table_rate_dps": 0.0}))
    return found.session.runs[0].t_s, found


@pytest.mark.parametrize("kind", ["two steps", "alternating", "jitter", "late", "rounding"])
def test_the_stamps_of_a_host_are_replaced_where_the_readings_follow_their_numbers(kind: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    t_s, found = imported(tmp_path, stamped(kind, TRUE_S, rng), rates(TRUE_S, rng))
    assert np.ptp(t_s - TRUE_S) < 0.002
    assert np.diff(t_s).max() < 1.05 * 0.01, "no sample is missing"
    assert found.repaired["times"] == N
    assert "0 samples are missing" not in found.warnings[0].text
    assert "ms rms off an even course of 100 samples a second" in found.warnings[0].text


@pytest.mark.parametrize("kind", ["two steps", "late"])
def test_losses_beside_the_stamps_of_a_host_are_kept(kind: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    left = np.delete(np.arange(N), [1000, *range(2050, 2060), 4444])
    stamps = stamped(kind, TRUE_S, rng)[left]
    t_s, found = imported(tmp_path, stamps, rates(TRUE_S[left], rng))
    assert np.ptp(t_s - TRUE_S[left]) < 0.003
    assert "12 samples are missing" in found.warnings[0].text


def test_samples_that_were_taken_unevenly_keep_their_times(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    for t_s in (
        np.sort(TRUE_S + rng.uniform(0, 0.006, N)),  # a poll that waits, and reads when it is back
        np.cumsum(rng.uniform(0.004, 0.016, N)),
        stamped("alternating", TRUE_S, rng),
        np.cumsum(np.where(np.arange(N) % 10 == 9, 0.0015, 0.0109)),  # two readings at once now and then
        np.delete(TRUE_S, rng.choice(N, 400, replace=False)),
    ):
        kept, found = imported(tmp_path, t_s, rates(t_s, rng))
        assert kept == pytest.approx(t_s - t_s[0], abs=1e-6)
        assert "times" not in found.repaired
        assert found.session.runs[0].sample_s == pytest.approx(kept, abs=1e-9)


def test_a_host_that_was_late_at_rest_has_lost_nothing(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    t_s, found = imported(tmp_path, stamped("late", TRUE_S, rng), rng.normal(0, 0.1, (N, 3)))
    assert np.diff(t_s).max() < 1.05 * 0.01
    assert "missing" not in found.warnings[0].text


@pytest.mark.parametrize("missing", [0, 40])
@pytest.mark.parametrize("turns", [True, False])
def test_samples_that_a_host_reads_one_by_one_from_packets_are_even(turns: bool, missing: int, tmp_path: Path) -> None:
    """Most steps are those of the reading, a fifth of the interval: neither are they bursts, nor the host's own sampling."""
    rng = np.random.default_rng(7)
    true_s = np.delete(TRUE_S, rng.choice(np.arange(200, N - 200), missing, replace=False))
    readings = rates(true_s, rng) if turns else rng.normal(0, 0.1, (true_s.size, 3))
    t_s, found = imported(tmp_path, stamped("read one by one", true_s, rng), readings)
    assert found.repaired["times"] == true_s.size
    assert found.session.sample_rate_hz == pytest.approx(100.0, rel=1e-3)
    assert np.ptp(t_s - true_s) < 0.04
    assert round(np.ptp(t_s) * found.session.sample_rate_hz) + 1 - true_s.size == pytest.approx(missing, abs=4)
    assert not [w for w in check(found.session) if w.code == "sample_rate"]


def test_a_repeated_stamp_does_not_make_uneven_samples_even(tmp_path: Path) -> None:
    """A phone's readings at each frame and some between, of which one has the stamp of the reading before."""
    rng = np.random.default_rng(8)
    steps = np.concatenate([rng.normal(0.0165, 0.0025, 254), rng.normal(0.003, 0.0005, 50)])
    t_s = np.cumsum(rng.permutation(steps))
    readings = rates(t_s, rng)
    readings[150:152] += 300.0  # a knock, which outweighs all other errors of both predictions
    stamps = t_s.copy()
    stamps[11] = stamps[10]
    kept, found = imported(tmp_path, stamps, readings)
    assert np.delete(kept, 11) == pytest.approx(np.delete(t_s, 11) - t_s[0], abs=1e-6)
    assert stamps[10] < kept[11] + t_s[0] < stamps[12]
    assert "1 of 304 times repeat or go back" in found.warnings[0].text


def test_stamps_are_the_course_of_a_sampler_that_wanders(tmp_path: Path) -> None:
    """Rounding to ms is off the numbers' course by less than the sampler's clock, which wanders by 30 ms in some seconds."""
    rng = np.random.default_rng(9)
    number_s = np.arange(2 * N) / 100
    true_s = number_s + 0.03 * np.sin(2 * np.pi * number_s / 20)
    readings = 400 * np.sin(2 * np.pi * np.outer(true_s, [2.0, 1.7, 1.3])) + rng.normal(0, 0.1, (2 * N, 3))
    t_s, found = imported(tmp_path, np.round(true_s, 3), readings)
    assert "times" not in found.repaired
    assert np.ptp(t_s - true_s) < 0.0011


@pytest.mark.parametrize("lost", [0, 40])
def test_the_time_of_a_pause_holds_no_missing_samples(lost: int) -> None:
    """A pause of minutes between two recordings was counted as thousands of missing samples, and told as a pause too."""
    rng = np.random.default_rng(4)
    number = np.concatenate([np.arange(600), 600 + lost + np.arange(600), 10_000 + np.arange(1000)])
    packets_s = np.ceil(number / 4) * 0.08 + rng.uniform(0, 0.004, number.size // 4 + 1)[np.arange(number.size) // 4]
    t_s = np.maximum.accumulate(packets_s)
    readings = rng.normal(0, 1, (3, number.size))
    _, warning = even(t_s, str, "a.csv", readings=list(readings))
    assert warning is not None
    found = re.search(r", (\d+) samples are missing beside 1 pause;", warning.text)
    assert ("missing" in warning.text) == bool(lost)
    if lost:
        assert found is not None
        assert int(found[1]) == pytest.approx(lost, abs=2)


@pytest.mark.parametrize("own", [True, False])
def test_bursts_by_the_clock_of_the_sensor_have_lost_what_lies_between(own: bool, tmp_path: Path) -> None:
    """A logger keeps one packet of four in six and loses the others. One that reads packets late, one by one, loses none."""
    rng = np.random.default_rng(4)
    bursts, interval_s = 400, 1 / 960
    kept = np.cumsum(rng.choice([5, 6, 7], bursts, p=[0.15, 0.7, 0.15])) if own else 6.1 * np.arange(bursts)
    moments = (4 * interval_s * kept[:, None] + interval_s * np.arange(4)).ravel()
    stamps = moments + rng.uniform(-5e-5, 5e-5, moments.size) + (not own) * np.repeat(rng.uniform(0, 8e-3, bursts), 4)
    t_s, found = imported(tmp_path, stamps, rng.normal(0, 0.1, (stamps.size, 3)))
    told = {w.code for w in check(found.session)}
    assert ("times" in found.repaired) == (not own)
    assert ("samples_lost" in told) == own
    if own:
        assert found.session.sample_rate_hz == pytest.approx(960, rel=1e-3)
        assert t_s == pytest.approx(moments - moments[0], abs=2e-4)
    else:
        assert found.session.sample_rate_hz == pytest.approx(960 / 6.1, rel=1e-3)
