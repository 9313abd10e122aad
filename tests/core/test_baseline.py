"""Eq. (9)-(10) and its errors against numpy on the same counts."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from .conftest import HERE, LSB_DPS, Build, run, ticks

Run = tuple[NDArray[np.int64], NDArray[np.int64]]


@pytest.fixture(scope="module")
def estimate(build: Build) -> Path:
    return build(HERE / "estimate.c")


def baseline(estimate: Path, a: Run, b: Run, w: tuple[float, float], rate_hz: float = 145.0) -> list[list[float]]:
    text = f"baseline {LSB_DPS} {w[0]} {w[1]} {rate_hz}\n"
    for t, counts in (a, b):
        text += f"{len(t)}\n" + "".join(f"{x} {y}\n" for x, y in zip(t, counts, strict=True))
    return [[float(x) for x in line.split()] for line in run(estimate, text).splitlines()]


def closed_form(a: Run, b: Run, w: tuple[float, float], seconds: float, rate_hz: float) -> list[float]:
    mean, var, n, chi2, dof = [], [], [], 0.0, 0
    for t, counts in (a, b):
        keep = t - t[0] < seconds * 1e6
        t, y = t[keep], counts[keep] * LSB_DPS
        mean.append(y.mean())
        var.append(((y[1:] - y[:-1]) ** 2).sum() / (2 * (len(y) - 1)))
        n.append(len(y))
        block = (t - t[0]) // 250_000
        for k in np.unique(block):
            inside = y[block == k]
            if len(inside) >= 0.5 * 0.25 * rate_hz:
                chi2 += len(inside) * (inside.mean() - y.mean()) ** 2 / var[-1]
                dof += 1
        dof -= 1
    scale = (mean[0] - mean[1]) / (w[0] - w[1]) - 1
    se = np.sqrt(var[0] / n[0] + var[1] / n[1]) / abs(w[0] - w[1])
    bias_se = np.sqrt(w[1] ** 2 * var[0] / n[0] + w[0] ** 2 * var[1] / n[1]) / abs(w[0] - w[1])
    return [scale, se, mean[0] - (1 + scale) * w[0], bias_se, np.sqrt(chi2 / dof), *n]


def test_noiseless_counts_give_scale_and_bias_exactly(estimate: Path) -> None:
    t = ticks(1000)
    got = baseline(estimate, (t, np.full(1000, 8960)), (t, np.full(1000, -8960 - 8)), (78.0, -78.0))
    for scale, se, bias, bias_se, misfit, *_ in got:
        assert scale == pytest.approx((8960 + 8968) * LSB_DPS / 156 - 1, abs=1e-15)
        assert bias == pytest.approx(-4 * LSB_DPS, abs=1e-13)
        assert se == bias_se == 0.0
        assert np.isnan(misfit)
    assert len(got) == 3


@pytest.mark.parametrize(("rate_hz", "w"), [(145.0, (78.0, -78.0)), (102.4, (-30.0, 30.0)), (416.0, (77.3, -77.3))])
def test_against_numpy_with_noise_gaps_and_jitter(estimate: Path, rate_hz: float, w: tuple[float, float]) -> None:
    rng = np.random.default_rng(int(rate_hz))
    runs = []
    for rate in w:
        t = ticks(int(rate_hz * 6.4), rate_hz) + rng.integers(0, 900, int(rate_hz * 6.4)) + 123_456
        keep = rng.random(len(t)) > 0.05
        keep[int(2.3 * rate_hz) : int(2.6 * rate_hz)] = False  # one block is left out, its neighbour is short
        keep[0] = True
        t = t[keep]
        ripple = 0.2 * np.sin(2 * np.pi * t / 4.6e6)
        runs.append(
            (t, np.rint((1.004 * rate - 0.05 + ripple + rng.normal(0, 0.0448, len(t))) / LSB_DPS).astype(np.int64))
        )
    got = baseline(estimate, runs[0], runs[1], w, rate_hz)
    assert len(got) == 3
    for seconds, answer in zip((2, 4, 6), got, strict=True):
        np.testing.assert_allclose(answer, closed_form(*runs, w, seconds, rate_hz), rtol=1e-10, atol=1e-12)


def test_a_sample_at_two_seconds_belongs_to_what_follows(estimate: Path) -> None:
    t = ticks(700, 100.0)
    counts = np.arange(700) % 11
    assert [a[5:] for a in baseline(estimate, (t, counts), (t, counts), (78.0, -78.0), 100.0)] == [
        [200] * 2,
        [400] * 2,
        [600] * 2,
    ]


def test_a_checkpoint_needs_a_later_sample_or_an_end_within_one_and_a_half_periods(estimate: Path) -> None:
    def checkpoints(n: int) -> int:
        t = ticks(n)
        counts = np.arange(n) % 7
        return len(baseline(estimate, (t, counts), (t, counts), (78.0, -78.0)))

    assert [checkpoints(n) for n in (288, 289, 290, 291, 579, 580, 870)] == [0, 0, 1, 1, 1, 2, 3]


def test_misfit_is_one_for_white_noise_and_rises_with_a_ripple(estimate: Path) -> None:
    rng = np.random.default_rng(5)
    t = ticks(1000)
    white, rippled = [], []
    for _ in range(40):
        a, b = (np.rint(rng.normal(r, 5, 1000)).astype(np.int64) for r in (8900, -8900))
        white.append(baseline(estimate, (t, a), (t, b), (78.0, -78.0))[2][4])
        wave = np.rint(10 * np.sin(2 * np.pi * t / 4.6e6)).astype(np.int64)
        rippled.append(baseline(estimate, (t, a + wave), (t, b + wave), (78.0, -78.0))[2][4])
    assert np.mean(np.square(white)) == pytest.approx(1.0, abs=4 * np.sqrt(2 / (46 * 40)))
    assert min(rippled) > 5
