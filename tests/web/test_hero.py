"""The large picture of an effect: its curve lies through the residual, and it stands for the effect that is named."""

from __future__ import annotations

import numpy as np
import pytest

from gyrocal.web import charts
from gyrocal.web.against import panels
from gyrocal.web.hero import picture
from gyrocal.web.strip import share


def points(n: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    there = {panel.key(axis): np.full(n, np.nan) for panel in panels() for axis in "xyz"}
    temp_c = np.linspace(-20.0, 70.0, n)
    residual = 0.02 * (temp_c - 25) + rng.normal(0, 0.01, n)
    return {**there, "temperature": temp_c, "run": np.zeros(n, int), "x": residual, "y": residual, "z": residual}


@pytest.mark.parametrize("offset_dps", [0.0, 0.4, -3.0])
def test_the_curve_lies_through_the_means_whatever_the_bias_does(offset_dps: float) -> None:
    """The effect is stated at 25 degC and the bias moves when it is added: the two differ by a constant that is nobody's."""
    of = points(4000)
    shown = picture("z", of["z"] + offset_dps, of, {0: "000_up.csv"})
    assert shown is not None
    assert shown.view == "temperature"
    assert np.abs(np.array(shown.left) - np.array(shown.curve)).max() < 1e-6


def test_the_curve_lies_through_the_means_whatever_the_scale_does() -> None:
    """A transient in proportion to the rate, on both faces: part of it is in the scale until the effect is added."""
    of = points(4000)
    rate_dps = np.where(np.arange(4000) < 2000, 78.0, -78.0)
    of["rate_z"] = rate_dps
    signal = -0.002 * rate_dps * np.exp(-(np.arange(4000) % 2000) / 400)
    of["z"] = signal + 0.0007 * rate_dps + 0.3
    shown = picture("z", signal, of, {0: "000_up.csv"})
    assert shown is not None
    assert shown.run is None
    assert np.abs(np.array(shown.left) - np.array(shown.curve)).max() < 1e-6


def test_no_tick_stands_at_the_odd_ends_of_the_data() -> None:
    of = points(4000)
    shown = picture("z", of["z"], of, {0: "000_up.csv"})
    assert shown is not None
    across = charts.hero(charts.LIGHT, shown, shown.left, shown.curve, ["words"])["xAxis"]
    assert across["max"] == shown.edges[-1]
    assert not across["axisLabel"]["showMinLabel"]
    assert not across["axisLabel"]["showMaxLabel"]


def test_an_excess_that_is_small_beside_the_noise_stays_pale() -> None:
    assert share(5.1, worst=5.1, floor=45.0) == pytest.approx(11, abs=1)
    assert share(51.0, worst=51.0, floor=45.0) == 100
    assert share(0.0, worst=0.0, floor=0.0) == 0
