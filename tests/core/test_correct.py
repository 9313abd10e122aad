"""``gc_correct`` with an exported ``correction.h``: the numbers of ``apply``, and the true rate behind planted errors."""

from pathlib import Path

import numpy as np
import pytest

from gyrocal.calibration.targets.base import render
from gyrocal.effects import base
from gyrocal.effects.base import effects
from gyrocal.error_model.correction import correct
from gyrocal.error_model.model import Model, Term
from gyrocal.recording.session import AXES
from make_runs import make_run

from .conftest import Build, run

PROGRAM = """
#include "correction.h"
#include <stdio.h>
int main(int argc, char **argv) {
    const double own[3] = {0.9, 0.1, -0.4};
    double y[3], w[3];
    gc_effect_input_t in = {0};
    (void)argv;
    while (scanf("%lf %lf %lf %f %f %f %f %f", y, y + 1, y + 2, &in.temp_c, &in.power_on_s, in.acc_g, in.acc_g + 1,
                 in.acc_g + 2) == 8) {
        const int error = gc_correct(&gyrocal_model, argc > 1 ? own : NULL, y, &in, w);
        printf("%d %.17g %.17g %.17g\\n", error, w[0], w[1], w[2]);
    }
    return 0;
}
"""
N = 400
RNG = np.random.default_rng(7)
TRUE_DPS = RNG.uniform(-1, 1, (N, 3)) * [300.0, 500.0, 2000.0]
TEMP_C, ACC_G = RNG.uniform(-20, 70, N), RNG.normal(0.0, 0.7, (N, 3))
T_S, POWER_ON_S = np.arange(N) / 100, 3.0
LEAST = 2e-5
"""deg/s: what the iteration and the columns in float leave at 2000 deg/s, a thousandth of a sensor's step."""

PLANTED: list[tuple[str, str, dict[str, float]]] = [
    *(("scale", a, {"scale": s}) for a, s in zip(AXES, (0.01, -0.02, 0.015), strict=True)),
    *(("bias", a, {"bias_dps": b}) for a, b in zip(AXES, (0.3, -0.2, 0.5), strict=True)),
    ("misalignment", "x", {"m_y": 0.01, "m_z": -0.02}), ("misalignment", "z", {"m_x": -0.01, "m_y": 0.02}),
    ("bias_temperature", "y", {"k1_dps_per_c": 0.02, "k2_dps_per_c2": -1e-3, "k3_dps_per_c3": 1e-5}),
    ("scale_temperature", "z", {"k_per_c": 1e-4}), ("drift", "x", {"k_dps_per_s": 3e-4}),
    ("g_sensitivity", "x", {"gx_dps_per_g": 0.05, "gy_dps_per_g": -0.03, "gz_dps_per_g": 0.02}),
    ("g2_sensitivity", "y", {"k_dps_per_g2": 0.01, "kx_dps_per_g2": 0.002}),
    ("scale_nonlinearity", "z", {"k3": 2e-9}), ("scale_asymmetry", "z", {"k": 1e-3}),
    ("centripetal", "y", {"k": 1e-6}), ("warmup", "z", {"A_dps": 0.05, "tau_s": 20.0}),
]  # fmt: skip


def model_of(planted: list[tuple[str, str, dict[str, float]]]) -> Model:
    return Model("planted", tuple(Term.of(base.effect(i), axis, values) for i, axis, values in planted))


def readings() -> np.ndarray:
    """The readings [n, 3] by the formulas of the effects, written out."""
    x, y, z = TRUE_DPS.T
    warm, p_s, a = TEMP_C - 25, POWER_ON_S + T_S, ACC_G
    rx = 1.01 * x + 0.01 * y - 0.02 * z + 0.3 + 3e-4 * p_s + a @ [0.05, -0.03, 0.02]
    ry = 0.98 * y - 0.2 + 0.02 * warm - 1e-3 * warm**2 + 1e-5 * warm**3 + 0.01 * (a**2).sum(axis=1) + 0.002 * a[:, 0] ** 2
    ry += 1e-6 * y**2
    rz = 1.015 * z - 0.01 * x + 0.02 * y + 0.5 + 1e-4 * warm * z + 2e-9 * z**3 + 1e-3 * np.abs(z) + 0.05 * np.exp(-p_s / 20)
    return np.column_stack([rx, ry, rz])


def corrected_in_c(build: Build, folder: Path, model: Model, measured: np.ndarray, *words: str, **missing: bool) -> np.ndarray:
    """Error code and rates [n, 4] of ``gc_correct``."""
    (folder / "correction.h").write_text(render("c", model).text)
    (folder / "correct.c").write_text(PROGRAM)
    nan = np.full(N, np.nan)
    rows = np.column_stack([measured, nan if missing.get("temp") else TEMP_C, POWER_ON_S + T_S, ACC_G])
    text = "".join(" ".join(map(repr, map(float, row))) + "\n" for row in rows)
    return np.array(run(build(folder / "correct.c", folder), text, *words).split(), float).reshape(N, 4)


def of_python(model: Model, measured: np.ndarray, temp: bool = True, **bias: float) -> np.ndarray:
    columns = {f"a{a}_g": ACC_G[:, i] for i, a in enumerate(AXES)} | ({"temp_c": TEMP_C} if temp else {})
    return correct(model, make_run(T_S, measured, table_rate_dps=0.0, power_on_s=POWER_ON_S, **columns), bias or None).rate_dps


def test_every_effect_that_can_be_undone_on_a_device_is_planted() -> None:
    undone = {e.id for e in effects().values() if e.on_device and not e.uncorrected}
    assert undone == {i for i, _, _ in PLANTED} - {"scale", "bias", "misalignment"}


def test_the_true_rate_comes_back(build: Build, tmp_path: Path) -> None:
    got = corrected_in_c(build, tmp_path, model_of(PLANTED), readings())
    assert not got[:, 0].any()
    assert got[:, 1:] == pytest.approx(TRUE_DPS, abs=LEAST)
    assert np.abs(readings() - TRUE_DPS).max() > 30


def test_the_numbers_are_those_of_apply(build: Build, tmp_path: Path) -> None:
    model = model_of(PLANTED)
    got = corrected_in_c(build, tmp_path, model, readings(), "own bias")
    assert got[:, 1:] == pytest.approx(of_python(model, readings(), x=0.9, y=0.1, z=-0.4), abs=LEAST)


def test_the_numbers_are_those_of_the_corrector(build: Build, tmp_path: Path) -> None:
    """Sample by sample, in C and in Python."""
    model = model_of(PLANTED)
    got = corrected_in_c(build, tmp_path, model, readings(), "own bias")
    corrector = model.corrector({"x": 0.9, "y": 0.1, "z": -0.4})
    samples = [corrector(*row) for row in zip(readings(), TEMP_C, POWER_ON_S + T_S, ACC_G, strict=True)]
    assert got[:, 1:] == pytest.approx(np.array(samples), abs=LEAST)


def test_without_a_thermometer_its_effects_are_left(build: Build, tmp_path: Path) -> None:
    model = model_of(PLANTED)
    got = corrected_in_c(build, tmp_path, model, readings(), temp=True)
    assert got[:, 1:] == pytest.approx(of_python(model, readings(), temp=False), abs=LEAST)


def test_a_model_of_one_axis_leaves_the_others(build: Build, tmp_path: Path) -> None:
    """The table turned about z alone: x and y have no scale, and their leaks are fractions of the rate about z."""
    model = model_of([
        ("scale", "z", {"scale": 0.02}), ("bias", "z", {"bias_dps": 0.5}), ("misalignment", "x", {"m": 0.01}),
        ("centripetal", "x", {"k": 1e-6}),
    ])  # fmt: skip
    x, y, z = TRUE_DPS.T
    got = corrected_in_c(build, tmp_path, model, np.column_stack([x + 0.01 * z + 1e-6 * z**2, y, 1.02 * z + 0.5]))
    assert got[:, 1:] == pytest.approx(TRUE_DPS, abs=LEAST)


def test_what_no_rate_explains_is_an_error(build: Build, tmp_path: Path) -> None:
    model = model_of([("scale", "z", {"scale": 0.0}), ("scale_nonlinearity", "z", {"k3": -1e-3})])
    got = corrected_in_c(build, tmp_path, model, np.full((N, 3), 500.0))
    assert (got[:, 0] == -47).all()


def test_what_the_file_cannot_hold_is_told() -> None:
    others = [("table_ripple", "z", {"amplitude_1": 0.01}), ("thermal_lag", "z", {"k_dps_s_per_c": 0.1})]
    left = render("c", model_of([*PLANTED, *others])).left
    assert set(left) == {"table_ripple", "thermal_lag"}
    assert "turntable" in left["table_ripple"]
    assert "no twin" in left["thermal_lag"]
