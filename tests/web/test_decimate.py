"""Short enough for a screen, and no spike lost: against brute force."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gyrocal.present.decimate import Pyramid, by_octave
from gyrocal.present.spectra import Curve
from gyrocal.web.pictures.charts import LIGHT
from gyrocal.web.state.traces import Traces
from gyrocal.web.values.views import ModelView, RunView, SessionView
from gyrocal.web.widgets.plots import STRETCHES, Timeline, curves


def written(folder: Path, values: np.ndarray) -> Pyramid:
    def fill(samples: np.ndarray) -> None:
        samples[:] = values

    Pyramid.write(folder, len(values), values.shape[1], fill)
    return Pyramid(folder)


@pytest.fixture(scope="module")
def pyramid(tmp_path_factory: pytest.TempPathFactory) -> Pyramid:
    return written(
        tmp_path_factory.mktemp("pyramid") / "p", np.random.default_rng(1).normal(size=(2, 70_001)).astype(np.float32)
    )


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 70_000), st.integers(1, 70_001), st.integers(1, 900), st.integers(0, 1))
def test_a_window_holds_its_extremes(pyramid: Pyramid, start: int, length: int, stretches: int, channel: int) -> None:
    stop = min(70_001, start + length)
    s = pyramid.window(channel, start, stop, stretches)
    inside = pyramid.samples[channel, start:stop]
    assert len(s.mean) <= 2 * stretches or len(s.mean) == stop - start
    assert s.first[0] >= start
    assert s.last[-1] < stop
    assert np.all(np.diff(s.first) >= 0)
    assert np.all(s.first <= s.last)
    assert np.all(s.low <= s.mean + 1e-6)
    assert np.all(s.mean <= s.high + 1e-6)
    if len(s.mean) == stop - start:
        for values in (s.low, s.mean, s.high):
            np.testing.assert_array_equal(values, inside)
    else:  # the next recording may begin where the window ends
        assert (s.low.min(), s.high.max()) == (inside.min(), inside.max())


def test_every_spike_is_seen_where_it_is(tmp_path: Path) -> None:
    values = np.zeros((1, 500_000), np.float32)
    places = np.array([3, 77_777, 250_000, 499_999])
    values[0, places] = 5.0
    seen = written(tmp_path / "p", values).window(0, 0, 500_000, 700)
    tall = seen.first[seen.high == 5.0]
    assert len(tall) == 4
    assert np.abs(tall - places).max() <= 500_000 / 700 * 1.1


def test_missing_samples_are_no_extremes(tmp_path: Path) -> None:
    values = np.full((1, 10_000), np.nan, np.float32)
    values[0, ::7] = 1.0
    seen = written(tmp_path / "p", values).window(0, 0, 10_000, 100)
    assert set(seen.low) | set(seen.high) | set(seen.mean) == {1.0}


def test_a_curve_by_octaves_keeps_its_line_and_every_low_point() -> None:
    x = np.arange(1, 8001) * 0.01
    y = np.ones(8000)
    y[4321] = 50.0
    centre, s = by_octave(x, y, 300)
    assert len(centre) <= 300
    assert s.high.max() == 50.0
    assert s.first[np.argmax(s.high)] <= x[4321] <= s.last[np.argmax(s.high)]
    assert centre[0] == s.first[0] == s.last[0] == x[0]
    assert by_octave(np.zeros(0), np.zeros(0), 300)[0].size == 0


def test_white_noise_is_a_band_about_its_mean_and_no_wave(tmp_path: Path) -> None:
    """The line of white noise of standard deviation 1 scatters as means do, and the band holds the samples."""
    noise = np.random.default_rng(3).normal(size=(1, 400_000)).astype(np.float32)
    s = written(tmp_path / "p", noise).window(0, 0, 400_000, 400)
    assert np.std(s.mean) == pytest.approx(1 / np.sqrt(1000), rel=0.15)
    assert s.low.max() < -1.5
    assert s.high.min() > 1.5


def test_the_mean_of_a_trace_is_exact_at_every_level(tmp_path: Path) -> None:
    values = np.random.default_rng(4).normal(size=(1, 65_536)).astype(np.float32)
    pyramid = written(tmp_path / "p", values)
    for stretches in (4, 64, 512):
        s = pyramid.window(0, 0, 65_536, stretches)
        np.testing.assert_allclose(s.mean, values.reshape(stretches, -1).mean(axis=1), atol=1e-6)


@pytest.mark.parametrize("rows", [5000, 200_001])
def test_nothing_is_drawn_between_two_recordings(tmp_path: Path, rows: int) -> None:
    """Neither a mean nor the model joins the end of a recording to the beginning of the next, however far one zooms.

    The last interval of a recording whose length is no multiple of the stored cells held the next one's first samples.
    """
    runs = 3
    for name in ("measured", "modelled", "residual"):
        written(tmp_path / name, np.repeat(np.arange(3.0), rows)[None].repeat(3, axis=0).astype(np.float32))
    np.save(tmp_path / "t_s.npy", np.tile(np.arange(rows) / 100.0, runs))
    np.savez(tmp_path / "points.npz", run=np.zeros(1))
    entries = [RunView(f"{i}.csv", f"s{i}", "up", "z", 78.0, 1, i * rows, rows, rows / 100) for i in range(runs)]
    traces = Traces(SessionView(tmp_path, "", "z", 100.0, entries, tmp_path))
    traces.take(model(tmp_path))
    for window in ((0.0, 100.0), (33.3, 33.4)):
        for series in Timeline(traces, list(enumerate(entries)), ("z",), LIGHT).series(window):
            if series["type"] == "custom":
                assert all(low == high for _, _, low, high in series["data"])  # an interval holds one recording
            else:
                pairs = zip(series["data"], series["data"][1:], strict=False)
                assert all(a[1] is None or b[1] is None or a[1] == b[1] for a, b in pairs)


def model(folder: Path) -> ModelView:
    return ModelView("", {}, "", [], "mdps", [], [], {}, folder, [], None, [], {}, {}, {}, {})


def test_ten_million_samples_zoom_at_once(tmp_path: Path) -> None:
    """Eighteen recordings of half a million samples on three axes: any window in a blink, down to the single sample."""
    runs, rows, rate_hz = 18, 555_556, 145.0
    n = runs * rows
    ramp = (np.arange(n, dtype=np.float32) % 1000) * 1e-3

    def fill(samples: np.ndarray) -> None:
        samples[:] = ramp

    for name in ("measured", "modelled", "residual"):
        Pyramid.write(tmp_path / name, 3, n, fill)
    np.save(tmp_path / "t_s.npy", np.tile(np.arange(rows) / rate_hz, runs))
    np.savez(tmp_path / "points.npz", run=np.zeros(1))
    entries = [RunView(f"{i:03d}.csv", f"s{i:03d}", "up", "z", 78.0, 1, i * rows, rows, rows / rate_hz) for i in range(runs)]
    traces = Traces(SessionView(tmp_path, "", "z", rate_hz, entries, tmp_path))
    alone = Timeline(traces, list(enumerate(entries)), ("x", "y", "z"), LIGHT)  # before there is a model
    assert [s["name"] for s in alone.series((0.0, 100.0)) if s["type"] == "line"] == ["x measured", "y measured", "z measured"]
    assert len(alone.options((0.0, 100.0), "s")["grid"]) == 1
    traces.take(model(tmp_path))
    line = Timeline(traces, list(enumerate(entries)), ("x", "y", "z"), LIGHT)
    took = []
    for window in ((0.0, 100.0), (20.0, 60.0), (49.0, 51.0), (50.0, 50.01), (50.0, 50.0001)):
        began = time.process_time()
        series = line.series(window)
        took.append(time.process_time() - began)
        assert all(len(s["data"]) <= 2 * STRETCHES + 4 * runs for s in series)
    assert min(took) < 0.2, took
    assert sorted(took)[2] < 0.2, took
    finest = [p for p in series[0]["data"] if p[1] is not None]
    steps = np.diff([x for x, _ in finest])
    assert np.median(steps) == pytest.approx(1 / rate_hz, abs=2e-4)  # single samples
    assert np.median(np.diff([y for _, y in finest])) == pytest.approx(1.0, abs=0.02)  # mdps, the ramp's own


def test_the_part_of_a_spectrum_that_is_shown_lies_on_its_axis() -> None:
    """A line of 38.68 Hz at a sampling rate of 100 Hz: four times the frequency is not on the axis."""
    x = np.linspace(0.01, 50.0, 500).tolist()
    words = ("z", "left over", "/√Hz", "noise alone", "frequency, Hz")
    drawn = curves(LIGHT, {"z": Curve(x, x, x)}, *words, [(38.68, 38.68, "a line")], (38.68 / 4, 38.68 * 4))
    zoom = drawn["dataZoom"][0]
    assert 0.01 < zoom["startValue"] < 38.68 < zoom["endValue"] == 50.0
