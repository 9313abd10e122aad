"""Correlations of fitted parameters against the closed form of least squares."""

import numpy as np
import pytest

from gyrocal.api import InputError, Model, fit
from make_runs import make_run, make_session


def test_scale_and_bias_are_confused_as_the_rates_of_the_runs_say() -> None:
    """In y = scale·w + bias with white noise the correlation is -mean(w) / rms(w)."""
    rates = [30.0, 78.0, 120.0]
    t_s = np.arange(400) / 100
    noise = np.random.default_rng(5).normal(0, 0.05, (400, 3))
    runs = [make_run(t_s, noise + np.array([0, 0, 1.01 * w]), table_rate_dps=w) for w in rates]
    found = fit(make_session(*runs), Model.open("paper"), axes="z")
    table = found.correlations("z")
    assert sorted(table["parameter"]) == ["bias.bias_dps", "scale.scale"]
    expected = -np.mean(rates) / np.sqrt(np.mean(np.square(rates)))
    assert table.drop("parameter").to_numpy() == pytest.approx(np.array([[1, expected], [expected, 1]]), abs=1e-6)
    with pytest.raises(InputError, match="covers z"):
        found.correlations("x")
