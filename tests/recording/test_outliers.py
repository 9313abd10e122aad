"""Single readings that stand out: found where planted, never in noise, and harmless to a fit."""

import numpy as np
import pytest

from gyrocal.calibration.calibrate import calibrate
from gyrocal.diagnosis.answer.add import add
from gyrocal.diagnosis.answer.compare import compare
from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.error_model.model import Model
from gyrocal.inference.fit import fit
from gyrocal.recording.outliers import outliers
from gyrocal.simulation.simulate import simulate
from known import ON_Z

pytestmark = pytest.mark.usefixtures("tests_alone")


@pytest.mark.parametrize("count_dps", [0.0, 0.00875, 0.07])
def test_noise_has_none_however_coarse_its_counts(count_dps: float) -> None:
    y_dps = np.random.default_rng(1).normal(0.3, 0.044, 500_000)
    if count_dps:
        y_dps = np.round(y_dps / count_dps) * count_dps
    assert outliers(y_dps, count_dps)[0].size == 0


@pytest.mark.parametrize("sd_counts", [0.1, 0.15, 0.2, 0.25, 0.3, 0.5, 0.8])
def test_noise_below_a_count_has_none_wherever_between_two_counts_it_lies(sd_counts: float) -> None:
    rng = np.random.default_rng(4)
    for mean in (0.0, 0.2, 0.35, 0.45, 0.49, 0.5, rng.normal(0, 0.3, 100_000).cumsum() / 300):
        codes = np.round(rng.normal(mean, sd_counts, 100_000))
        assert outliers(codes, 1.0)[0].size == 0
        codes[5_000] += 12
        assert outliers(codes, 1.0)[0].tolist() == [5_000]


def test_outliers_side_by_side_keep_their_size() -> None:
    """Among three of the next readings, one that stands off too halves the deviation from the neighbours."""
    y_dps = np.random.default_rng(3).normal(0.3, 0.01, 1_560)
    torn = [87, 88, 90, 146, 216, 218, 236, 689]
    y_dps[torn] -= 2.24
    rows, apart_dps = outliers(y_dps, 0.00875)
    assert rows.tolist() == torn
    assert apart_dps == pytest.approx(-2.24, abs=0.05)


def test_many_of_one_size_are_found_also_several_in_a_row() -> None:
    """Every seventh reading of a run near a border of the codes lacked a carry. More than a twentieth were no outliers."""
    rng = np.random.default_rng(5)
    y_dps = rng.normal(105.9, 0.016, 3_120)
    torn = rng.random(y_dps.size) < 0.15
    torn[:4] = torn[100:106] = True
    y_dps[torn] -= 0.937
    rows, apart_dps = outliers(y_dps, 0.00366)
    np.testing.assert_array_equal(rows, np.flatnonzero(torn))
    assert apart_dps == pytest.approx(-0.937, abs=0.1)


@pytest.mark.parametrize("part", [0.1, 0.4])
def test_many_of_any_size_and_the_rarer_of_two_values_are_none(part: float) -> None:
    rng = np.random.default_rng(6)
    y_dps = rng.normal(0.0, 0.01, 3_000)
    off = rng.random(y_dps.size) < part
    y_dps[off] += rng.uniform(0.2, 2.0, np.count_nonzero(off)) if part < 0.3 else 1.0
    assert outliers(y_dps, 0.0)[0].size == 0


def test_planted_ones_are_found_at_their_rows_and_sizes_even_on_a_step_and_a_slope() -> None:
    rng = np.random.default_rng(2)
    t_s = np.arange(20_000) / 145
    y_dps = rng.normal(0, 0.044, t_s.size) + 0.2 * (t_s > 60) + 3 * np.sin(0.5 * t_s)
    rows = np.sort(rng.choice(t_s.size, 40, replace=False))
    size_dps = rng.choice((-1.0, 1.0), 40) * rng.uniform(1, 5, 40)
    y_dps[rows] += size_dps
    found, apart_dps = outliers(y_dps, 0.0)
    np.testing.assert_array_equal(found, rows)
    np.testing.assert_allclose(apart_dps, size_dps, atol=0.25)


@pytest.mark.parametrize("sd_counts", [0.3, 0.4])
def test_counts_of_a_log_whose_offset_is_corrected_now_and_then_are_none(sd_counts: float) -> None:
    """As a phone does, which takes off its estimate of the bias: the smallest step is that of the estimate."""
    rng = np.random.default_rng(9)
    codes = np.round(rng.normal(0.1, sd_counts, 40_000)) * 0.061
    y_dps = codes - np.repeat(rng.normal(0, 0.005, 20).round(4), 2_000)
    step_dps = float(np.min(np.abs(np.diff(y_dps)), where=np.diff(y_dps) != 0, initial=1.0))
    assert step_dps < 0.01
    assert outliers(y_dps, step_dps)[0].size == 0
    y_dps[7_000] += 1.0
    assert outliers(y_dps, step_dps)[0].tolist() == [7_000]


@pytest.mark.parametrize("white_dps", [0.001, 0.004, 0.02])
@pytest.mark.parametrize("frequency_hz", [0.2, 1.0, 2.0])
def test_a_swing_s_scale_error_is_no_outlier(white_dps: float, frequency_hz: float) -> None:
    """0.6 deg/s of amplitude, which moves by more than the noise from one sample to the next."""
    t_s = np.arange(40_000) / 104
    y_dps = 0.6 * np.sin(2 * np.pi * frequency_hz * t_s) + np.random.default_rng(7).normal(0, white_dps, t_s.size)
    assert outliers(y_dps, 0.0)[0].size == 0
    y_dps[[9_000, 20_001]] += 2.0, -2.0
    assert outliers(y_dps, 0.0)[0].tolist() == [9_000, 20_001]


def test_a_fit_does_not_feel_them() -> None:
    model = Model.builtin("default")
    clean, spoilt = (
        fit(simulate(None, "paper", effects, 3, scenarios=3, seconds=20)[0], model, axes=["z"]).axes["z"].terms
        for effects in (["table_ripple"], ["table_ripple", "bias_jumps:size_dps=4,outliers=0.002"])
    )
    for a, b in zip(clean, spoilt, strict=True):
        for name in a.se:
            assert abs(a.values[name] - b.values[name]) < 0.5 * a.se[name] + 1e-12, (a.effect_id, name)


@pytest.mark.wide
@pytest.mark.slow
@pytest.mark.usefixtures("known_answers")
def test_they_are_shown_named_and_explained() -> None:
    session = simulate(None, "paper", ["bias_jumps:size_dps=3,outliers=0.0005"], 5, scenarios=3, seconds=20)[0]
    comparison = compare(session, ON_Z)
    assert (comparison.where[0].axis, comparison.where[0].against) == ("z", "reading")
    found = diagnose(session, ON_Z)
    assert found.verdict == "add"
    assert found.best is not None
    assert (found.best.effect.id, found.best.axis) == ("bias_jumps", "z")
    assert found.best.values["size_dps"] == pytest.approx(3, rel=0.05)
    before, after, model = add(session, ON_Z, "bias_jumps")
    assert after.pooled.excess_dps < 0.1 * before.pooled.excess_dps
    assert after.verdict == "adequate"
    assert diagnose(session, model).verdict == "adequate"
    assert calibrate(session, [6.0], ["model"], model=model)  # a fault of single readings is no column of the calibration
