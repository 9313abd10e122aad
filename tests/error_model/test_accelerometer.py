"""The accelerometer in a model: its file, and what is corrected with it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.error_model.accelerometer import ACCELERATIONS, AccelerometerModel
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.shown import pandas_of

MATRIX = np.array([[1.02, 0.0, 0.0], [0.004, 0.99, 0.0], [-0.003, 0.006, 1.01]])
BIAS_G = np.array([0.01, -0.03, 0.05])


@pytest.fixture
def model() -> Model:
    acc = AccelerometerModel.of(MATRIX, np.full((3, 3), 1e-4 / 3), BIAS_G, np.full(3, 2e-4 / 3), np.full(3, 0.002))
    return Model("m", (Term("bias", "z", {"bias_dps": 0.5}),), accelerometer=acc)


@pytest.fixture
def table() -> tuple[pl.DataFrame, np.ndarray]:
    true_g = np.random.default_rng(1).normal(size=(50, 3))
    reading_g = true_g @ MATRIX.T + BIAS_G
    rates = {name: np.zeros(50) for name in ("gx_dps", "gy_dps", "gz_dps")}
    return pl.DataFrame({"t_s": np.arange(50) / 100, **rates, **dict(zip(ACCELERATIONS, reading_g.T, strict=True))}), true_g


def test_a_model_file_keeps_it(model: Model, tmp_path: Path) -> None:
    model.save(tmp_path / "m.toml")
    read = Model.open(tmp_path / "m.toml")
    assert read.accelerometer == model.accelerometer
    assert Model.open("default").accelerometer is None
    (tmp_path / "m.toml").write_text((tmp_path / "m.toml").read_text().replace("white_sd_g", "white_g"))
    with pytest.raises(InputError, match="accelerometer has no 'white_g'"):
        Model.open(tmp_path / "m.toml")


@pytest.mark.parametrize("wrong", ["3", "{ }", "{ matrix = [[1, 0, 0]], bias_g = [0, 0, 0] }",
                                   "{ matrix = [[1, 0, 0], [0, 1, 0], [0, 0, 0]], bias_g = [0, 0, 0] }",
                                   "{ matrix = [[1, 0, 0], [0, 1, 0], [0, 0, nan]], bias_g = [0, 0, 0] }"])  # fmt: skip
def test_other_content_is_refused(model: Model, tmp_path: Path, wrong: str) -> None:
    text = replace(model, accelerometer=None).toml().replace("effects = [", f"accelerometer = {wrong}\neffects = [")
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(InputError, match="accelerometer"):
        Model.open(tmp_path / "m.toml")


def test_tables_and_samples_are_corrected(model: Model, table: tuple[pl.DataFrame, np.ndarray]) -> None:
    frame, true_g = table
    done = model.correct(frame)
    assert done.select(ACCELERATIONS).to_numpy() == pytest.approx(true_g)
    assert done["gz_dps"].to_numpy() == pytest.approx(-0.5)
    assert model.correct(pandas_of(frame))[list(ACCELERATIONS)].to_numpy() == pytest.approx(true_g)
    readings = frame.select(ACCELERATIONS).to_numpy()
    assert model.corrector().acceleration(readings) == pytest.approx(true_g)
    assert model.corrector().acceleration(readings[3]) == pytest.approx(true_g[3])
    with pytest.raises(InputError, match="no accelerometer"):
        replace(model, accelerometer=None).corrector().acceleration(readings)


def test_what_is_missing_stays_missing(model: Model, table: tuple[pl.DataFrame, np.ndarray]) -> None:
    frame, true_g = table
    holes = frame.with_columns(pl.when(pl.int_range(pl.len()) == 4).then(None).otherwise("ay_g").alias("ay_g"))
    done = model.correct(holes)
    assert done["ay_g"].null_count() == done["az_g"].null_count() == 1, "a z depends on y"
    assert done["ax_g"].to_numpy() == pytest.approx(true_g[:, 0]), "an x does not"
    assert model.correct(frame.drop("az_g"))["ax_g"].equals(frame["ax_g"]), "two axes alone are left as they are"
