"""What a model was fitted on is kept with it, and what lies beyond is counted and told once."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.calibration.apply import apply
from gyrocal.cli import main
from gyrocal.error_model.fitted_on import FittedOn
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.inference.fit import fit
from gyrocal.recording.session import Session
from make_runs import make_run, make_session

RATE_HZ, SECONDS = 100.0, 20.0
T_S = np.arange(round(RATE_HZ * SECONDS)) / RATE_HZ
COOL_C, WARM_C = 18.0, 34.0
RNG = np.random.default_rng(3)


def recorded(table_rate_dps: float, temp_c: np.ndarray, **fields: object) -> object:
    """A run about z with a scale of 1 %, a bias of 0.5 dps at 25 degC and 0.02 dps/degC."""
    gyro = RNG.normal(0, 0.03, (T_S.size, 3))
    gyro[:, 2] += 1.01 * table_rate_dps + 0.5 + 0.02 * (temp_c - 25)
    acc = {"ax_g": 0.0, "ay_g": 0.0, "az_g": 1.0}
    return make_run(T_S, gyro, table_rate_dps=table_rate_dps, temp_c=temp_c, **acc, **fields)


def chamber() -> Session:
    ramps = [np.linspace(COOL_C, WARM_C, T_S.size), np.linspace(WARM_C, COOL_C, T_S.size)]
    return make_session(*(recorded(rate, ramp) for rate in (0.0, 78.0, -78.0) for ramp in ramps), corrected="bench")


@pytest.fixture(scope="module")
def model() -> Model:
    return fit(chamber(), Model.builtin("paper").add("bias_temperature", "z")).model


def test_a_fitted_model_keeps_its_ranges(model: Model, tmp_path: Path) -> None:
    ranges = model.fitted_on.ranges
    assert ranges["temp_c"] == (COOL_C, WARM_C)
    assert ranges["az_g"] == (1.0, 1.0)
    assert ranges["rate_z_dps"] == pytest.approx((-1.01 * 78, 1.01 * 78), abs=0.7)
    assert ranges["rate_x_dps"] == pytest.approx((0.0, 0.0), abs=0.15)
    model.save(tmp_path / "m.toml")
    assert Model.open(tmp_path / "m.toml").fitted_on == FittedOn(ranges, "bench")


def test_the_next_fit_has_the_ranges_of_its_own_session(model: Model) -> None:
    warm = make_session(*(recorded(rate, np.full(T_S.size, 50.0)) for rate in (0.0, 78.0)))
    assert fit(warm, model).model.fitted_on.ranges["temp_c"] == (50.0, 50.0)
    assert fit(warm, model).model.fitted_on.corrected == ""


def test_a_single_reading_that_stands_out_is_no_rate_of_the_fit() -> None:
    session = chamber()
    table = session.runs[0].table
    spike = pl.Series("gx_dps", np.where(np.arange(T_S.size) == 700, 2000.0, table["gx_dps"].to_numpy()))
    torn = session.with_runs((replace(session.runs[0], frame=table.with_columns(spike)), *session.runs[1:]))
    assert fit(torn, Model.builtin("paper")).model.fitted_on.ranges["rate_x_dps"][1] < 1


def test_an_old_model_file_opens_as_before(model: Model, tmp_path: Path) -> None:
    lines = model.toml().splitlines()
    old = [line for line in lines if not line.startswith(("fitted_on", "corrected"))]
    assert len(lines) - len(old) == 2
    (tmp_path / "old.toml").write_text("\n".join(old))
    opened = Model.open(tmp_path / "old.toml")
    assert opened.fitted_on == FittedOn()
    assert opened.terms == Model.open(_saved(model, tmp_path)).terms
    session = make_session(recorded(300.0, np.full(T_S.size, WARM_C + 20)))
    done = apply(_folder(session, tmp_path), opened, tmp_path / "out")
    assert (done.outside, done.warnings) == ({}, [])
    rates = Session.open(tmp_path / "out").runs[0].gyro_dps[:, 2]
    assert float(rates.mean()) == pytest.approx(300.0, abs=0.1)  # extrapolated as before


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("fitted_on = { temp = [1.0, 2.0] }", "no range 'temp'"),
        ("fitted_on = { temp_c = [2.0, 1.0] }", "temp_c is [2.0, 1.0]"),
        ("fitted_on = { temp_c = [1.0] }", "least and the greatest"), ("fitted_on = [1.0]", "must be a table"),
        ("fitted_on = { temp_c = [nan, 1.0] }", "temp_c is"), ("corrected = 1", "write text in quotes"),
    ],
)  # fmt: skip
def test_a_wrong_range_in_a_file_is_one_line(model: Model, tmp_path: Path, line: str, why: str) -> None:
    kept = [text for text in model.toml().splitlines() if not text.startswith(("fitted_on", "corrected"))]
    (tmp_path / "m.toml").write_text("\n".join([kept[0], *kept[1:5], line, *kept[5:]]))
    with pytest.raises(InputError) as told:
        Model.open(tmp_path / "m.toml")
    assert why in str(told.value)
    assert "\n" not in str(told.value)


def _folder(session: Session, folder: Path) -> Path:
    session.save(folder / "session")
    return folder / "session"


def _saved(model: Model, folder: Path) -> Path:
    model.save(folder / "m.toml")
    return folder / "m.toml"


def test_apply_clamps_the_temperature_counts_and_tells_once(
    model: Model, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    warm_c = np.where(np.arange(T_S.size) < 300, 30.0, WARM_C + 20)
    session = make_session(recorded(78.0, warm_c), recorded(0.0, np.full(T_S.size, 25.0)), recorded(-78.0, warm_c))
    arguments = ["apply", str(_folder(session, tmp_path)), "--model", str(_saved(model, tmp_path)), "--out"]
    assert main([*arguments, str(tmp_path / "out"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["outside"] == {"temperature": 2 * (T_S.size - 300)}
    (warning,) = told["warnings"]
    assert (warning["code"], warning["blocking"]) == ("beyond_model", False)
    assert all(words in warning["text"] for words in ("temp_c reaches 54", "18 to 34", "3400", "6000"))
    before, after = session.runs[0].gyro_dps[:, 2], Session.open(tmp_path / "out").runs[0].gyro_dps[:, 2]
    values = {t.effect_id: t.values for t in model.on("z")}
    at_end = before - values["bias"]["bias_dps"] - (WARM_C - 25) * values["bias_temperature"]["k1_dps_per_c"]
    assert after[300:] == pytest.approx(at_end[300:] / (1 + values["scale"]["scale"]), abs=0.02)
    assert Session.open(tmp_path / "out").runs[0].temp_c == pytest.approx(warm_c)
    assert main([*arguments, str(tmp_path / "again")]) == 0
    assert capsys.readouterr().out.count("beyond_model") == 1


@pytest.mark.parametrize(("table_rate_dps", "rows"), [(78.0, {}), (80.0, {}), (300.0, {"rate": T_S.size})])
def test_apply_counts_rates_beyond_the_table_s(
    model: Model, tmp_path: Path, table_rate_dps: float, rows: dict[str, int]
) -> None:
    session = make_session(recorded(table_rate_dps, np.full(T_S.size, 25.0)), recorded(0.0, np.full(T_S.size, 25.0)))
    done = apply(_folder(session, tmp_path), model, tmp_path / "out")
    assert done.outside == rows
    assert [w.code for w in done.warnings] == ["beyond_model"] * bool(rows)


def test_apply_counts_accelerations(model: Model, tmp_path: Path) -> None:
    session = make_session(recorded(0.0, np.full(T_S.size, 25.0)))
    run = session.runs[0]
    tilted = session.with_runs([replace(run, frame=run.table.with_columns(pl.lit(0.6).alias("ax_g")))])
    assert apply(_folder(tilted, tmp_path), model, tmp_path / "out").outside == {"acceleration": T_S.size}


def test_a_part_of_a_degree_is_counted_and_no_warning(model: Model, tmp_path: Path) -> None:
    session = make_session(recorded(0.0, np.full(T_S.size, WARM_C + 0.5)))
    done = apply(_folder(session, tmp_path), model, tmp_path / "out")
    assert (done.outside, done.warnings) == ({"temperature": T_S.size}, [])


def test_its_own_session_is_within(model: Model, tmp_path: Path) -> None:
    done = apply(_folder(chamber(), tmp_path), model, tmp_path / "out")
    assert (done.outside, done.warnings) == ({}, [])


def test_calibrate_tells_once(model: Model, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    warm = [recorded(rate, np.full(T_S.size, WARM_C + 20), face=face) for rate, face in ((78.0, "up"), (78.0, "down"))]
    folder, file = _folder(make_session(*warm), tmp_path), _saved(model, tmp_path)
    assert main(["calibrate", str(folder), "--model", str(file), "--seconds", "2,6", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    (warning,) = [w for w in told["warnings"] if w["code"] == "beyond_model"]
    assert "temp_c reaches 54" in warning["text"]
    assert "1200 (temperature)" in warning["text"]
    assert main(["calibrate", str(folder), "--method", "baseline", "--model", str(file), "--json"]) == 0
    assert "beyond_model" not in capsys.readouterr().out
