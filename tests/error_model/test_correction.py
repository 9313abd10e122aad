"""A correction is the inverse of the model: it returns the true rate, and the heading after a corrected recording is right."""

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray
from scipy.integrate import trapezoid

from gyrocal.calibration.at_rest import biases_at_rest
from gyrocal.effects import base
from gyrocal.error_model.correction import correct
from gyrocal.error_model.formula import FormulaEffect
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.recording.session import AXES, Run
from make_runs import make_run

T_S = np.arange(0, 20, 0.01)
TRUE_DPS = np.column_stack([30 * np.sin(0.7 * T_S), 20 * np.cos(1.1 * T_S), 80 * np.sin(0.4 * T_S) + 10])
TEMP_C = 25 + 0.4 * T_S


def model_of(*terms: tuple[str, str, dict[str, float]]) -> Model:
    return Model("planted", tuple(Term.of(base.effect(i), axis, values) for i, axis, values in terms))


EVERY_AXIS = [("scale", a, {"scale": s}) for a, s in zip(AXES, (0.01, -0.02, 0.015), strict=True)]
EVERY_AXIS += [("bias", a, {"bias_dps": b}) for a, b in zip(AXES, (0.3, -0.2, 0.5), strict=True)]


def reading(true_dps: NDArray[np.float64], **columns: object) -> Run:
    return make_run(T_S, true_dps, table_rate_dps=0.0, temp_c=TEMP_C, **columns)  # type: ignore[arg-type]


def test_scale_bias_and_misalignment_are_a_matrix_and_its_inverse() -> None:
    """A reading (I + S)·w + M·w + b is a linear map, which numpy inverts."""
    model = model_of(
        *EVERY_AXIS, ("misalignment", "x", {"m_y": 0.01, "m_z": -0.02}), ("misalignment", "y", {"m_x": 0.015, "m_z": 0.005}),
        ("misalignment", "z", {"m_x": -0.01, "m_y": 0.02}),
    )  # fmt: skip
    matrix = np.array([[1.01, 0.01, -0.02], [0.015, 0.98, 0.005], [-0.01, 0.02, 1.015]])
    measured = TRUE_DPS @ matrix.T + [0.3, -0.2, 0.5]
    done = correct(model, reading(measured))
    assert done.rate_dps == pytest.approx((measured - [0.3, -0.2, 0.5]) @ np.linalg.inv(matrix).T, abs=1e-8)
    assert done.rate_dps == pytest.approx(TRUE_DPS, abs=1e-8)
    assert (done.applied, done.left) == (["scale", "bias", "misalignment"], {})


def test_effects_of_rate_and_temperature_are_undone() -> None:
    model = model_of(
        *EVERY_AXIS, ("scale_nonlinearity", "z", {"k3": 2e-7}), ("scale_asymmetry", "z", {"k": 0.001}),
        ("scale_temperature", "z", {"k_per_c": 1e-4}),
        ("bias_temperature", "z", {"k1_dps_per_c": 0.02, "k2_dps_per_c2": 0.001}),
    )  # fmt: skip
    w = TRUE_DPS[:, 2]
    warm = TEMP_C - 25
    measured = TRUE_DPS * [1.01, 0.98, 1.015] + [0.3, -0.2, 0.5]
    measured[:, 2] += 2e-7 * w**3 + 0.001 * np.abs(w) + 1e-4 * warm * w + 0.02 * warm + 0.001 * warm**2
    assert correct(model, reading(measured)).rate_dps == pytest.approx(TRUE_DPS, abs=1e-8)


def test_effects_of_the_table_and_lost_readings_stay_and_are_told() -> None:
    model = model_of(
        *EVERY_AXIS, ("table_ripple", "z", {"amplitude_1": 0.01}), ("lag", "z", {"tau_s": 0.005}),
        ("quantization", "z", {"lsb_dps": 0.07}), ("warmup", "z", {"A_dps": 0.05, "tau_s": 20.0}),
    )  # fmt: skip
    done = correct(model, reading(TRUE_DPS))
    assert set(done.left) == {"table_ripple", "lag", "quantization", "warmup"}
    assert "turntable" in done.left["table_ripple"]
    assert "power_on_s" in done.left["warmup"]
    assert done.applied == ["scale", "bias"]
    assert "warmup" in correct(model, reading(TRUE_DPS, power_on_s=3.0)).applied


def test_a_formula_is_undone_unless_it_belongs_to_the_table() -> None:
    known = Model("f", (*model_of(*EVERY_AXIS).terms, Term.of(FormulaEffect("k*temp_c", "warm"), "z", {"k": 0.01})))
    measured = TRUE_DPS * [1.01, 0.98, 1.015] + [0.3, -0.2, 0.5]
    measured[:, 2] += 0.01 * TEMP_C
    assert correct(known, reading(measured)).rate_dps == pytest.approx(TRUE_DPS, abs=1e-8)
    table = Model("f", (*model_of(*EVERY_AXIS).terms, Term.of(FormulaEffect("k*sin(theta)", "wave"), "z", {"k": 0.01})))
    assert "turntable" in correct(table, reading(TRUE_DPS)).left["wave"]


def test_the_bias_of_this_power_cycle_comes_from_a_rest() -> None:
    model = model_of(*EVERY_AXIS, ("bias_temperature", "z", {"k1_dps_per_c": 0.02}))
    noise = np.random.default_rng(3).normal(0.0, 0.05, TRUE_DPS.shape)
    still = np.where(T_S[:, None] < 5, 0.0, TRUE_DPS)
    measured = still * [1.01, 0.98, 1.015] + [0.9, 0.1, -0.4] + noise
    measured[:, 2] += 0.02 * (TEMP_C - 25)
    run = reading(measured)
    bias = biases_at_rest(model, (run,), 5.0)[run.scenario]
    se = 0.05 / np.sqrt(500)
    assert [bias[a] for a in AXES] == pytest.approx([0.9, 0.1, -0.4], abs=5 * se)
    with pytest.raises(InputError, match="shorter than"):
        biases_at_rest(model, (run,), 50.0)


def test_the_heading_after_a_minute_is_right_after_correction() -> None:
    t_s = np.arange(0, 60, 0.01)
    true = np.column_stack([np.zeros_like(t_s), np.zeros_like(t_s), 90 * np.sin(0.3 * t_s) + 5])
    noise = np.random.default_rng(5).normal(0.0, 0.05, true.shape)
    measured = true * [1.01, 0.98, 1.015] + [0.3, -0.2, 0.5] + noise
    done = correct(model_of(*EVERY_AXIS), make_run(t_s, measured, table_rate_dps=0.0))
    heading = [trapezoid(rate[:, 2] - true[:, 2], t_s) for rate in (measured, done.rate_dps)]
    assert abs(heading[0]) > 20
    assert abs(heading[1]) < 5 * 0.05 * np.sqrt(60 * 0.01)


def test_tables_of_every_kind_give_the_same_rates() -> None:
    pandas = pytest.importorskip("pandas")
    model = model_of(*EVERY_AXIS)
    frame = pl.DataFrame({"t_s": T_S, **{f"g{a}_dps": TRUE_DPS[:, i] for i, a in enumerate(AXES)}, "note": ["a"] * T_S.size})
    expected = correct(model, reading(TRUE_DPS)).rate_dps
    of_polars = model.correct(frame)
    assert of_polars.columns == frame.columns
    assert of_polars.select("gx_dps", "gy_dps", "gz_dps").to_numpy() == pytest.approx(expected)
    of_pandas = model.correct(pandas.DataFrame({c: frame[c].to_numpy() for c in frame.columns}))
    assert of_pandas[["gx_dps", "gy_dps", "gz_dps"]].to_numpy() == pytest.approx(expected)
    of_numpy = model.correct(np.column_stack([T_S, TRUE_DPS]))
    assert of_numpy[:, 1:] == pytest.approx(expected)
    with pytest.raises(InputError, match="no column gz_dps"):
        model.correct(frame.drop("gz_dps"))
    with pytest.raises(InputError, match="shape"):
        model.correct(TRUE_DPS)


def test_a_warm_up_is_removed_from_a_table_whose_time_since_power_on_is_said() -> None:
    model = model_of(("warmup", "z", {"A_dps": 0.05, "tau_s": 20.0}))
    warm = 0.05 * np.exp(-(T_S + 3.0) / 20.0)
    frame = {"t_s": T_S, "gx_dps": 0 * T_S, "gy_dps": 0 * T_S, "gz_dps": 30.0 + warm}
    assert model.correct(frame, power_on_s=3.0)["gz_dps"] == pytest.approx(np.full(T_S.size, 30.0), abs=1e-9)
    assert model.correct(frame)["gz_dps"] == pytest.approx(30.0 + warm)
    assert model.correct(np.column_stack(list(frame.values())), power_on_s=3.0)[:, 3] == pytest.approx(30.0, abs=1e-9)


def test_a_model_without_values_is_refused() -> None:
    with pytest.raises(InputError, match="no fitted values"):
        correct(Model.builtin("default"), reading(TRUE_DPS))
