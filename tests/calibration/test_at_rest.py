"""``apply --bias rest:S``: what turns in these seconds never becomes the bias, and what is at rest there does."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from gyrocal.calibration.apply import apply
from gyrocal.calibration.calibrate import calibrate
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.recording.session import Run, Session
from make_runs import make_run, make_session

BIAS_DPS = np.array([1.5, -3.0, 0.7])
SCALE = 0.02
OWN_DPS = 0.04
"""Offset of this power cycle from the model's bias."""
SWING_DPS = 20 * np.sin(2 * np.pi * np.arange(800) / 100)

LINES = ", ".join(
    f'{{ id = "scale", axis = "{a}", scale = {SCALE} }}, {{ id = "bias", axis = "{a}", bias_dps = {b} }}, '
    f'{{ id = "turn_on_bias", axis = "{a}", sd_dps = 0.03 }}'
    for a, b in zip("xyz", BIAS_DPS, strict=True)
)


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Model:
    file = tmp_path_factory.mktemp("at_rest") / "m.toml"
    file.write_text(f'format = "gyrocal-model/1"\nname = "m"\neffects = [{LINES}]\n')
    return Model.open(file)


def recorded(
    rate_dps: Any, *, stated: float | None = None, scenario: str = "s0", off_dps: float = OWN_DPS, **columns: Any
) -> Run:
    """Eight seconds of a sensor of known errors, turning about z."""
    rng = np.random.default_rng(3)
    t_s = np.arange(800) / 100.0
    true = np.zeros((800, 3))
    true[:, 2] = rate_dps
    gyro = (1 + SCALE) * true + BIAS_DPS + off_dps + rng.normal(0, 0.05, (800, 3))
    return make_run(t_s, gyro, table_rate_dps=stated, scenario=scenario, **columns)


def as_csv(run: Run, folder: Path) -> Path:
    run.table.write_csv(folder / "one.csv")
    return folder / "one.csv"


def mean_dps(path: Path) -> float:
    return float(pl.read_csv(path)["gz_dps"].mean())  # type: ignore[arg-type]


def test_a_table_s_rate_is_no_bias(model: Model, tmp_path: Path) -> None:
    make_session(recorded(78.0, stated=78.0)).save(tmp_path / "s")
    with pytest.raises(InputError, match=r"table_rate_dps is 78; use --bias model"):
        apply(tmp_path / "s", model, tmp_path / "out", "rest:5")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_run_at_rest_of_a_power_cycle_is_used(model: Model, tmp_path: Path, order: tuple[int, ...]) -> None:
    runs = (recorded(78.0, stated=78.0), recorded(0.0, stated=0.0))
    make_session(*(runs[i] for i in order)).save(tmp_path / "s")
    apply(tmp_path / "s", model, tmp_path / "out", "rest:5")
    corrected = {r.table_rate_dps: float(r.gyro_dps[:, 2].mean()) for r in Session.open(tmp_path / "out").runs}
    assert corrected == pytest.approx({78.0: 78.0, 0.0: 0.0}, abs=0.02)


def test_a_power_cycle_without_a_rest_is_refused_beside_one_that_has_one(model: Model, tmp_path: Path) -> None:
    make_session(recorded(0.0, stated=0.0), recorded(30.0, stated=30.0, scenario="s1")).save(tmp_path / "s")
    with pytest.raises(InputError, match=r"001_up\.csv: table_rate_dps is 30"):
        apply(tmp_path / "s", model, tmp_path / "out", "rest:5")


@pytest.mark.parametrize(("rate_dps", "rests"), [(0.0, True), (0.5, False), (-30.0, False), (SWING_DPS, False)])
def test_a_reference_says_whether_the_part_is_at_rest(model: Model, tmp_path: Path, rate_dps: Any, rests: bool) -> None:
    noise = np.random.default_rng(4).normal(0, 0.3, 800)
    table = as_csv(recorded(rate_dps, rate_ref_dps=rate_dps + noise), tmp_path)
    if rests:
        apply(table, model, tmp_path / "out.csv", "rest:5")
        assert mean_dps(tmp_path / "out.csv") == pytest.approx(0.0, abs=0.02)
    else:
        with pytest.raises(InputError, match="the reference"):
            apply(table, model, tmp_path / "out.csv", "rest:5")


@pytest.mark.parametrize("rate_dps", [-30.0, 3.0, 300.0])
def test_a_table_that_turns_by_its_readings_is_refused_with_both_numbers(model: Model, tmp_path: Path, rate_dps: float) -> None:
    table = as_csv(recorded(rate_dps), tmp_path)
    with pytest.raises(InputError, match=r"z reads \S+ dps and the model's bias is 0.7 dps") as refused:
        apply(table, model, tmp_path / "out.csv", "rest:5")
    read_dps = float(str(refused.value).split("z reads ")[1].split()[0])
    assert read_dps == pytest.approx((1 + SCALE) * rate_dps + BIAS_DPS[2] + OWN_DPS, abs=0.06)


def test_a_part_that_moves_to_and_fro_is_refused(model: Model, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"z varies by 14.* dps \(rms\), so the part moves"):
        apply(as_csv(recorded(SWING_DPS), tmp_path), model, tmp_path / "out.csv", "rest:5")


@pytest.mark.parametrize("off_dps", [0.0, -0.1, 0.2, 1.5])
def test_a_rest_whose_bias_has_moved_gives_the_bias(model: Model, tmp_path: Path, off_dps: float) -> None:
    """Noise, a power cycle's own offset and what temperature does are no motion."""
    apply(as_csv(recorded(0.0, off_dps=off_dps), tmp_path), model, tmp_path / "out.csv", "rest:5")
    assert mean_dps(tmp_path / "out.csv") == pytest.approx(0.0, abs=0.02)


def test_a_stated_rest_far_from_the_model_s_bias_is_believed(model: Model, tmp_path: Path) -> None:
    make_session(recorded(0.0, stated=0.0, off_dps=6.0)).save(tmp_path / "s")
    apply(tmp_path / "s", model, tmp_path / "out", "rest:5")
    assert all(float(r.gyro_dps[:, 2].mean()) == pytest.approx(0.0, abs=0.02) for r in Session.open(tmp_path / "out").runs)


@pytest.mark.parametrize("late", [False, True])
def test_a_turn_by_its_angle_is_judged_by_its_readings(model: Model, tmp_path: Path, late: bool) -> None:
    """A part that rests for six seconds and then turns by 90 deg begins at rest; one that turns at once does not."""
    turning = (np.arange(800) >= 600) if late else (np.arange(800) < 200)
    run = recorded(45.0 * turning, turn_deg=90.0)
    make_session(run).save(tmp_path / "s")
    if late:
        apply(tmp_path / "s", model, tmp_path / "out", "rest:5")
        z_dps = list(itertools.chain(*(r.gyro_dps[:600, 2] for r in Session.open(tmp_path / "out").runs)))
        assert float(np.mean(z_dps)) == pytest.approx(0.0, abs=0.02)
    else:
        with pytest.raises(InputError, match="so the part moves"):
            apply(tmp_path / "s", model, tmp_path / "out", "rest:5")


def test_the_noise_of_a_reference_is_no_turn(model: Model, tmp_path: Path) -> None:
    """A mean of 0.2 dps over 1.5 s is noise beside 2.5 dps of noise of a sample, and one of 2 dps is a turn."""
    rng = np.random.default_rng(8)

    def refused(rate_dps: float, number: int) -> bool:
        folder = tmp_path / f"{rate_dps:g}_{number}"
        folder.mkdir()
        table = as_csv(recorded(rate_dps, rate_ref_dps=rate_dps + rng.normal(0, 2.5, 800)), folder)
        try:
            apply(table, model, folder / "out.csv", bias="rest:1.5")
        except InputError as error:
            return "the reference turns" in str(error)
        return False

    assert sum(refused(0.0, number) for number in range(40)) <= 1
    assert all(refused(2.0, number) for number in range(10))


def test_a_session_at_rest_is_told_what_gives_its_bias() -> None:
    t_s = np.arange(500) / 100
    rest = make_run(t_s, np.random.default_rng(2).normal(0.3, 0.05, (t_s.size, 3)), table_rate_dps=0.0)
    with pytest.raises(InputError, match=r"scale cannot be determined.* The bias can: `gyrocal explain SESSION"):
        calibrate(make_session(rest))
