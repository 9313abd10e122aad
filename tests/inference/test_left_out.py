"""Columns that the data cannot tell from others: what a value that holds both may still be wrong by."""

import numpy as np
import pytest

from gyrocal.diagnosis.answer.compare import compare
from gyrocal.error_model.model import Model, Term
from gyrocal.inference.fit import fit
from gyrocal.present.report import stand_in_words
from gyrocal.recording.session import Session
from make_runs import make_run, make_session

WHITE_DPS, SECONDS, HZ = 0.05, 60.0, 20.0


def turning(
    *rates_dps: float, scale: float = 0.0, bias_dps: float = 0.0, temp_c: float | None = None, per_c: float = 0.0, seed: int = 0
) -> Session:
    """A run of each rate about z in one power cycle; the bias is that at 25 degC, at a constant ``temp_c``."""
    rng, t_s = np.random.default_rng(seed), np.arange(round(SECONDS * HZ)) / HZ
    warm_dps = 0.0 if temp_c is None else per_c * (temp_c - 25)
    runs = []
    for rate_dps in rates_dps:
        gyro_dps = rng.normal(0, WHITE_DPS, (t_s.size, 3)) + bias_dps + warm_dps
        gyro_dps[:, 2] += (1 + scale) * rate_dps
        columns = {} if temp_c is None else {"temp_c": np.full(t_s.size, temp_c)}
        runs.append(make_run(t_s, gyro_dps, table_rate_dps=rate_dps, scenario="s0", **columns))
    return make_session(*runs)


def bias(session: Session, model: Model | None = None) -> tuple[float, float]:
    """Bias of z and its standard error."""
    term = fit(session, model or Model.builtin("default"), axes="z").axes["z"].terms
    found = next(t for t in term if t.effect_id == "bias")
    return found.values["bias_dps"], found.se["bias_dps"]


@pytest.mark.parametrize("rate_dps", [78.0, -30.0])
def test_at_one_rate_the_error_of_the_bias_allows_for_the_scale(rate_dps: float) -> None:
    for seed, scale in enumerate((-0.02, 0.0, 0.02)):
        value, se = bias(turning(rate_dps, scale=scale, bias_dps=0.3, seed=seed))
        assert value == pytest.approx(0.3 + scale * rate_dps, abs=0.02)
        assert se == pytest.approx(abs(0.02 * rate_dps), rel=0.02)


def test_rest_and_two_rates_tell_the_bias_alone() -> None:
    for rates_dps in ((0.0,), (78.0, -78.0), (0.0, 78.0)):
        value, se = bias(turning(*rates_dps, scale=0.02, bias_dps=0.3))
        assert se < 0.02
        assert value == pytest.approx(0.3, abs=4 * se + 1e-3)


def test_at_one_temperature_the_bias_at_25_degc_is_not_known() -> None:
    model = Model.builtin("default").with_term(Term("bias_temperature", "z", {"k1_dps_per_c": 0.0}))
    value, se = bias(turning(0.0, bias_dps=0.3, temp_c=45.0, per_c=0.01), model)
    assert value == pytest.approx(0.5, abs=0.02)
    assert se > 0.2
    assert bias(turning(0.0, bias_dps=0.3, temp_c=25.0), model)[1] < 0.02


def test_the_words_name_what_is_not_told_apart() -> None:
    words = stand_in_words(compare(turning(78.0, scale=0.02), Model.builtin("default")))
    assert words.startswith("On z, this session does not tell the scale error from the bias")
    assert stand_in_words(compare(turning(78.0, -78.0), Model.builtin("default"))) == ""
