"""``gc_correct`` and ``apply`` beyond the temperatures that a model was fitted on: those at the end of the range, counted."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gyrocal.calibration.beyond import beyond, columns_of
from gyrocal.calibration.targets.base import render
from gyrocal.error_model.correction import correct
from gyrocal.error_model.fitted_on import FittedOn
from gyrocal.error_model.model import Model
from make_runs import make_run

from .conftest import Build, run
from .test_correct import ACC_G, LEAST, PLANTED, POWER_ON_S, T_S, N, model_of, readings

PROGRAM = """
#include "correction.h"
#include <stdio.h>
int main(void) {
    double y[3], w[3];
    gc_effect_input_t in = {0};
    while (scanf("%lf %lf %lf %f %f %f %f %f", y, y + 1, y + 2, &in.temp_c, &in.power_on_s, in.acc_g, in.acc_g + 1,
                 in.acc_g + 2) == 8) {
        const int error = gc_correct(&gyrocal_model, NULL, y, &in, w);
        printf("%d %u %.17g %.17g %.17g\\n", error, gc_correct_beyond(&gyrocal_model, &in, w), w[0], w[1], w[2]);
    }
    return 0;
}
"""
LOW_C, HIGH_C = 5.0, 38.5
RANGES = {
    "temp_c": (LOW_C, HIGH_C), "rate_x_dps": (-300.0, 300.0), "rate_y_dps": (-500.0, 500.0), "rate_z_dps": (-1000.0, 1000.0),
    "ax_g": (-2.0, 2.0), "ay_g": (-2.0, 2.0), "az_g": (-0.5, 0.5),
}  # fmt: skip
MODEL = replace(model_of(PLANTED), fitted_on=FittedOn(RANGES))
TEMPERATURE, RATE, ACCELERATION = 1, 2, 4


def in_c(build: Build, folder: Path, model: Model, temp_c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bits of ``gc_correct_beyond`` [n] and rates [n, 3]."""
    (folder / "correction.h").write_text(render("c", model).text)
    (folder / "beyond.c").write_text(PROGRAM)
    rows = np.column_stack([readings(), temp_c, POWER_ON_S + T_S, ACC_G])
    text = "".join(" ".join(map(repr, map(float, row))) + "\n" for row in rows)
    found = np.array(run(build(folder / "beyond.c", folder), text).split(), float).reshape(N, 5)
    assert not found[:, 0].any()
    return found[:, 1].astype(int), found[:, 2:]


def in_python(model: Model, temp_c: np.ndarray) -> np.ndarray:
    columns = {f"a{a}_g": ACC_G[:, i] for i, a in enumerate("xyz")} | {"temp_c": temp_c}
    return correct(model, make_run(T_S, readings(), table_rate_dps=0.0, power_on_s=POWER_ON_S, **columns)).rate_dps


@pytest.mark.parametrize(("beyond_c", "end_c"), [(HIGH_C + 20, HIGH_C), (LOW_C - 20, LOW_C)])
def test_20_degrees_beyond_count_as_the_end_of_the_range(build: Build, tmp_path: Path, beyond_c: float, end_c: float) -> None:
    temp_c, end = np.full(N, beyond_c), np.full(N, end_c)
    for name in ("beyond", "end"):
        (tmp_path / name).mkdir()
    bits, far = in_c(build, tmp_path / "beyond", MODEL, temp_c)
    at_end_bits, at_end = in_c(build, tmp_path / "end", MODEL, end)
    assert np.array_equal(far, at_end)
    assert np.array_equal(in_python(MODEL, temp_c), in_python(MODEL, end))
    assert far == pytest.approx(in_python(MODEL, temp_c), abs=LEAST)
    assert (bits & TEMPERATURE == TEMPERATURE).all()
    assert not (at_end_bits & TEMPERATURE).any()


def test_both_count_the_same_samples(build: Build, tmp_path: Path) -> None:
    temp_c = np.linspace(LOW_C - 20, HIGH_C + 20, N)
    bits, _ = in_c(build, tmp_path, MODEL, temp_c)
    acc = {f"a{a}_g": ACC_G[:, i] for i, a in enumerate("xyz")}
    rates_dps = in_python(MODEL, temp_c)
    found = beyond(MODEL, [columns_of(make_run(T_S, readings(), temp_c=temp_c, **acc), rates_dps)])
    counted = {"temperature": TEMPERATURE, "rate": RATE, "acceleration": ACCELERATION}
    assert found.rows == {name: np.count_nonzero(bits & bit) for name, bit in counted.items()}
    assert found.rows["temperature"] == np.count_nonzero((temp_c < LOW_C) | (temp_c > HIGH_C))
    assert found.rows["rate"] == np.count_nonzero(np.abs(rates_dps[:, 2]) > 1000 + 0.05 * 2000 + 2)


def test_a_model_without_ranges_is_as_before(build: Build, tmp_path: Path) -> None:
    temp_c = np.linspace(-20.0, 70.0, N)
    bits, rates = in_c(build, tmp_path, model_of(PLANTED), temp_c)
    assert not bits.any()
    assert rates == pytest.approx(in_python(model_of(PLANTED), temp_c), abs=LEAST)
    assert np.abs(rates - in_python(MODEL, temp_c)).max() > 0.1
