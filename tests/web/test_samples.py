"""The last ten seconds of a sensor, made short enough to be drawn thirty times a second."""

from __future__ import annotations

import numpy as np

from gyrocal.web.device.samples import KEPT, SHOWN_S, STRETCHES, Samples


def test_a_frame_holds_every_spike_of_the_last_seconds_and_no_other() -> None:
    samples = Samples()
    t_s = np.arange(3000) / 145.0
    rows = np.column_stack([t_s, np.zeros((3000, 7))])
    rows[100, 1], rows[2500, 1], rows[2600, 3] = 9.0, 7.0, -5.0  # the first is older than what is shown
    for chunk in np.array_split(rows, 200):
        samples.extend(chunk.tolist())
    frame = samples.frame()
    assert (frame.first_s, frame.newest_s) == (0.0, t_s[-1])
    low, width = (np.array(curves, dtype=float) for curves in (frame.lows, frame.widths))
    high = low[..., 1] + width[..., 1]
    assert low.shape[1] <= STRETCHES + 1
    assert (high[0].max(), low[2, :, 1].min(), np.abs(width[1, :, 1]).max()) == (7.0, -5.0, 0.0)
    assert abs(low[0, np.argmax(high[0]), 0] - t_s[2500]) <= SHOWN_S / STRETCHES
    assert np.all(np.diff(low[0, :, 0]) > 0)


def test_white_noise_is_drawn_as_a_band_and_its_mean_not_as_a_wave() -> None:
    samples = Samples()
    noise = np.random.default_rng(1).normal(0, 1.0, 4000)
    samples.extend([[i / 400, 0.0, 0.0, z, 0.0, 0.0, 1.0, 25.0] for i, z in enumerate(noise.tolist())])
    frame = samples.frame(5.0)
    line = np.array(frame.means[2], dtype=float)[:, 1]
    assert line.std() < 0.5  # the mean of 11 samples and more
    assert np.corrcoef(line[1:], line[:-1])[0, 1] > -0.3  # a zigzag has -1
    assert np.array(frame.widths[2], dtype=float)[1:-1, 1].min() > 1.0


def test_what_the_device_has_not_is_a_gap() -> None:
    samples = Samples()
    samples.extend([[0.01 * i, 1.0, 2.0, 3.0, None, None, None, 25.0] for i in range(1200)])
    means = samples.frame().means
    assert {value for _, value in means[3]} == {None}
    assert {value for _, value in means[6]} == {25.0}


def test_a_clock_that_begins_anew_forgets_what_was() -> None:
    samples = Samples()
    samples.extend([[float(i), *[1.0] * 7] for i in range(5)])
    samples.extend([[0.5, *[2.0] * 7], [1.5, *[2.0] * 7]])
    assert samples.latest(100.0)[:, 0].tolist() == [0.5, 1.5]


def test_the_ring_keeps_the_latest() -> None:
    samples = Samples()
    for first in range(0, KEPT + 1000, 500):
        samples.extend([[float(first + i), *[0.0] * 7] for i in range(500)])
    kept = samples.latest(1e9)
    assert len(kept) == KEPT
    assert np.all(np.diff(kept[:, 0]) == 1.0)
