"""What a campaign teaches of its runs' spread, against what was planted; and what that is worth after six seconds."""

from dataclasses import replace

import numpy as np
import pytest

from gyrocal.calibration import limit
from gyrocal.calibration.estimator import MAX_COLUMNS, calibration_of
from gyrocal.calibration.scenarios import answers
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.inference.fit import fit
from gyrocal.noise.axis import AxisNoise
from gyrocal.noise.power_cycles import TurnOnBias, TurnOnScale
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import (
    BIAS_SD_DPS,
    LOG_TAU,
    RIPPLE_SD_DPS,
    SCALE_MEAN,
    SCALE_SD,
    TABLE_RATE_DPS,
    TRANSIENT_SD_DPS,
    paper_windows,
    simulate,
)

MEAN_TAU_S = float(np.exp(np.mean(LOG_TAU)))
TAU_SD_S = MEAN_TAU_S * (LOG_TAU[1] - LOG_TAU[0]) / np.sqrt(12)

SCENARIOS = 24


@pytest.fixture(scope="module")
def campaign() -> Session:
    return simulate(None, "table2", seed=5, scenarios=SCENARIOS, seconds=20.0)[0]


@pytest.fixture(scope="module")
def learned(campaign: Session) -> Model:
    return fit(campaign, both(), axes=["z"]).model


def both() -> Model:
    """What the campaign has, not fitted yet."""
    start = Model.builtin("default").with_term(Term("table_ripple", "z", {"amplitude_1": 0.0}))
    return start.with_term(Term("spin_up", "z", {"A": 0.0, "tau_s": 2.0}))


def as_if_one(model: Model) -> Model:
    """The model with one time constant for all runs."""
    term = model.term("spin_up", "z")
    assert term is not None
    return model.with_term(replace(term, values={n: v for n, v in term.values.items() if n != "tau_s_sd"}))


@pytest.mark.parametrize(
    ("effect", "name", "truth"),
    [
        ("scale", "scale", SCALE_MEAN),
        ("scale", "scale_sd", SCALE_SD),
        ("turn_on_bias", "sd_dps", BIAS_SD_DPS),
        ("table_ripple", "amplitude_1", np.sqrt(2) * RIPPLE_SD_DPS / TABLE_RATE_DPS),
        ("spin_up", "A", 0.0),
        ("spin_up", "A_sd", TRANSIENT_SD_DPS / TABLE_RATE_DPS),
        ("spin_up", "tau_s", MEAN_TAU_S),
        ("spin_up", "tau_s_sd", TAU_SD_S),
    ],
)
def test_what_was_planted_is_learned(learned: Model, effect: str, name: str, truth: float) -> None:
    line = learned.line(effect, "z")
    assert line is not None
    error = line.se[name]
    if name == "amplitude_1":  # the error is that of these runs' own waves; their sizes were drawn from the population
        error = float(np.hypot(error, truth / (2 * np.sqrt(2 * SCENARIOS))))
    assert abs(line.values[name] - truth) < 3.5 * error


def test_what_varies_is_not_called_drift(learned: Model) -> None:
    assert learned.value("colored_noise", "z", "sd_dps") < 0.006, "planted: 0.002"


def test_answers_come_close_to_the_limit(learned: Model) -> None:
    data = paper_windows(1000, 123)
    truth = np.column_stack([data["scale"], data["bias_dps"]])
    for seconds in (4.0, 6.0):
        best = limit.limit(data["up"], data["down"], seconds, grid=12)
        least = np.abs(np.column_stack([best.scale, best.bias_dps]) - truth).mean(0)
        ratio = []
        for model in (as_if_one(learned), learned):
            found = answers(calibration_of(model, "z"), data["up"], data["down"], seconds, limit.PROTOCOL)
            ratio.append(np.abs(np.column_stack([found.scale, found.bias_dps]) - truth).mean(0) / least)
        assert np.all(ratio[0] > 1.15), "one time constant for all runs"
        assert np.all(ratio[1] < 1.08), ratio[1]


def test_the_model_file_keeps_it_and_the_device_holds_it(learned: Model, tmp_path) -> None:
    learned.save(tmp_path / "m.toml")
    kept = calibration_of(Model.open(tmp_path / "m.toml"), "z")
    calibration = calibration_of(learned, "z")
    assert kept.alternatives == calibration.alternatives == 6
    assert len(calibration.columns) == MAX_COLUMNS
    np.testing.assert_allclose(kept.prior_information, calibration.prior_information, rtol=1e-6)
    taus_s = [c.values["tau_s"] for c in calibration.run_columns[-6:]]
    steps = np.diff(np.log(taus_s))
    np.testing.assert_allclose(steps, steps[0])


def test_fitting_again_changes_little(campaign: Session, learned: Model) -> None:
    again = fit(campaign, learned, axes=["z"]).model
    for effect, name in (("spin_up", "tau_s"), ("spin_up", "tau_s_sd"), ("spin_up", "A_sd"), ("scale", "scale_sd")):
        old, new = learned.line(effect, "z"), again.line(effect, "z")
        assert old is not None
        assert new is not None
        assert abs(new.values[name] - old.values[name]) < 0.2 * old.se[name]


def test_one_time_constant_for_all_runs_is_learned_as_one() -> None:
    planted = ["table_ripple", "spin_up:A=0.003,tau_s=1.5"]
    session, _ = simulate(None, "paper", planted, 3, scenarios=6, seconds=15.0, vary=True)
    found = fit(session, both(), axes=["z"]).model
    term = found.term("spin_up", "z")
    assert term is not None
    assert "tau_s_sd" not in term.values
    assert term.values["tau_s"] == pytest.approx(1.5, rel=0.1)
    assert term.values["A"] == pytest.approx(0.003, rel=0.1)
    assert calibration_of(found, "z").alternatives == 0


def test_a_spread_that_is_not_positive_is_refused(learned: Model, tmp_path) -> None:
    text = learned.toml().replace("tau_s_sd = ", "tau_s_sd = -")
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(InputError, match="tau_s_sd"):
        Model.open(tmp_path / "m.toml")


def test_a_prior_is_as_wide_as_its_spread_and_the_error_of_its_mean() -> None:
    terms = Term("scale", "z", {"scale": 0.002}, {"scale": 3e-4}), Term("bias", "z", {"bias_dps": 0.1}, {"bias_dps": 0.04})
    noise = AxisNoise(0.04, turn_on_bias=TurnOnBias(0.03), turn_on_scale=TurnOnScale(4e-4))
    found = calibration_of(Model("m", terms, {"z": noise}), "z")
    assert found.scale == pytest.approx((0.002, 5e-4), rel=0.01)
    assert found.bias_dps == pytest.approx((0.1, 0.05), rel=0.01)
