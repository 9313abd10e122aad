"""Single samples in Python: the true rate behind planted errors, the numbers of ``apply``, of a batch and of the C core."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from core.test_correct import (
    ACC_G,
    PLANTED,
    POWER_ON_S,
    T_S,
    TEMP_C,
    TRUE_DPS,
    N,
    model_of,
    of_python,
    readings,
)
from gyrocal.effects.base import effects
from gyrocal.error_model.fitted_on import FittedOn
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from make_runs import make_run

INPUTS: dict[str, Any] = {"temp_c": TEMP_C, "power_on_s": POWER_ON_S + T_S, "acc_g": ACC_G}


def one_by_one(model: Model, measured: np.ndarray, bias: dict[str, float] | None = None) -> np.ndarray:
    corrector = model.corrector(bias)
    rows = zip(measured.tolist(), TEMP_C.tolist(), (POWER_ON_S + T_S).tolist(), ACC_G.tolist(), strict=True)
    return np.array([corrector(reading, temp_c, power_on_s, acc_g) for reading, temp_c, power_on_s, acc_g in rows])


@pytest.mark.parametrize("effect", [e for e in effects().values() if e.on_device and not e.uncorrected], ids=lambda e: e.id)
def test_the_term_of_a_sample_is_that_of_a_run(effect: Any) -> None:
    """Both are written in the effect's file. The device's effects all have a term of single samples."""
    columns = {f"a{a}_g": ACC_G[:, k] for k, a in enumerate("xyz")} | {"temp_c": TEMP_C}
    run = make_run(T_S, table_rate_dps=78.0, power_on_s=POWER_ON_S, **columns)
    for start in filter(effect.runs_on_device, effect.variants([run], 2)):
        values = start | {name: 0.01 * (k + 1) for k, name in enumerate(effect.coding.used(start))}
        term = effect.at_sample(values)
        samples = [term(78.0, *row) for row in zip(TEMP_C, POWER_ON_S + T_S, ACC_G, strict=True)]
        assert samples == pytest.approx(effect.term(run.as_measured(), 2, values), rel=1e-12)


def test_the_true_rate_comes_back() -> None:
    assert one_by_one(model_of(PLANTED), readings()) == pytest.approx(TRUE_DPS, abs=1e-8)


def test_the_numbers_are_those_of_apply_and_of_a_batch() -> None:
    model, own = model_of(PLANTED), {"x": 0.9, "z": -0.4}
    assert one_by_one(model, readings(), own) == pytest.approx(of_python(model, readings(), **own), abs=1e-8)
    assert model.corrector(own).batch(readings(), **INPUTS) == pytest.approx(one_by_one(model, readings(), own), abs=1e-8)


def test_a_model_of_one_axis_leaves_the_others() -> None:
    model = model_of([
        ("scale", "z", {"scale": 0.02}), ("bias", "z", {"bias_dps": 0.5}), ("misalignment", "x", {"m": 0.01}),
        ("centripetal", "x", {"k": 1e-6}),
    ])  # fmt: skip
    x, y, z = TRUE_DPS.T
    measured = np.column_stack([x + 0.01 * z + 1e-6 * z**2, y, 1.02 * z + 0.5])
    assert one_by_one(model, measured) == pytest.approx(TRUE_DPS, abs=1e-8)
    assert one_by_one(model, measured) == pytest.approx(of_python(model, measured), abs=1e-8)


def test_an_input_that_is_missing_leaves_its_effects() -> None:
    corrector = model_of(PLANTED).corrector()
    without = of_python(model_of(PLANTED), readings(), temp=False)
    inputs = {**INPUTS, "temp_c": np.nan}
    assert corrector.batch(readings(), **inputs) == pytest.approx(without, abs=1e-8)
    assert corrector(readings()[5], np.nan, POWER_ON_S + T_S[5], ACC_G[5]) == pytest.approx(without[5], abs=1e-8)
    bare = model_of([p for p in PLANTED if p[0] in ("scale", "bias", "misalignment", "scale_nonlinearity", "scale_asymmetry",
                                                    "centripetal")])  # fmt: skip
    assert corrector(readings()[5]) == pytest.approx(bare.corrector()(readings()[5]), abs=1e-9)


def test_a_temperature_beyond_the_fit_counts_as_its_end() -> None:
    model = replace(model_of(PLANTED), fitted_on=FittedOn({"temp_c": (10.0, 30.0)}))
    assert one_by_one(model, readings()) == pytest.approx(of_python(model, readings()), abs=1e-8)
    assert model.corrector().batch(readings(), **INPUTS) == pytest.approx(of_python(model, readings()), abs=1e-8)


def test_a_reading_that_is_not_a_number_spoils_no_other() -> None:
    measured = readings()
    measured[3] = np.nan
    got = model_of(PLANTED).corrector().batch(measured, **INPUTS)
    assert np.isnan(got[3]).all()
    assert np.delete(got, 3, axis=0) == pytest.approx(np.delete(TRUE_DPS, 3, axis=0), abs=1e-8)
    assert np.isnan(one_by_one(model_of(PLANTED), measured)[3]).all()


def test_what_cannot_be_removed_is_told() -> None:
    others = [("table_ripple", "z", {"amplitude_1": 0.01}), ("thermal_lag", "z", {"k_dps_s_per_c": 0.1}), ("drift", "y", {})]
    corrector = model_of([*PLANTED, *others]).corrector()
    assert corrector.left == {
        "table_ripple": "it belongs to the turntable and not to the sensor", "thermal_lag": "it needs more than one sample",
        "drift": "the model has no value of it on y",
    }  # fmt: skip
    assert repr(corrector).startswith("<Corrector: removes scale, bias, misalignment")
    one_axis = model_of([("scale", "z", {"scale": 0.01}), ("scale", "x", {}), ("scale", "y", {})]).corrector()
    assert repr(one_axis) == "<Corrector: removes scale; leaves scale on x, y>"


@pytest.mark.parametrize("single", [True, False])
def test_what_no_rate_explains_is_an_error(single: bool) -> None:
    model = model_of([("scale", "z", {"scale": 0.0}), ("scale_nonlinearity", "z", {"k3": -1e-3})])
    with pytest.raises(InputError, match="reading 500, 500, 500 dps: the model's errors are too large"):
        _ = model.corrector()([500.0] * 3) if single else model.corrector().batch(np.full((N, 3), 500.0))


def test_arguments_that_do_not_fit_are_named() -> None:
    corrector = model_of(PLANTED).corrector()
    with pytest.raises(InputError, match=r"readings_dps has the shape \(3,\); give \[n, 3\]"):
        corrector.batch([1.0, 2.0, 3.0])
    with pytest.raises(InputError, match=r"temp_c has the shape \(2,\); give \[400\]"):
        corrector.batch(readings(), [20.0, 21.0])
    with pytest.raises(InputError, match="bias_dps has the axis 'w'; give it by x, y and z"):
        model_of(PLANTED).corrector({"w": 1.0})
    with pytest.raises(InputError, match="no fitted values"):
        Model.open("default").corrector()
