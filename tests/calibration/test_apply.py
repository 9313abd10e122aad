"""``apply``: another day's recording, corrected, is as good as the noise allows; the bias comes from where the user says."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.calibration.apply import apply
from gyrocal.cli import main
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.inference.fit import fit
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate


@pytest.fixture(scope="module")
def days(tmp_path_factory: pytest.TempPathFactory) -> tuple[Model, Path]:
    """A model fitted on two days of a session with two effects, and the third day as a session of its own."""
    folder = tmp_path_factory.mktemp("apply")
    session, _ = simulate(None, "full", ["bias_temperature", "scale_asymmetry"], 5, seconds=20.0)
    known = session.with_runs(r for r in session.runs if r.day != session.days[-1])
    session.with_runs(r for r in session.runs if r.day == session.days[-1]).save(folder / "day3")
    model = Model.builtin("default")
    for axis in "xyz":
        model = model.add("bias_temperature", axis).add("scale_asymmetry", axis)
    return fit(known, model).model, folder / "day3"


def rms_about_truth(session: Session) -> float:
    """rms of reading minus true rate about z, without each run's mean, which is the bias of its power cycle, deg/s."""
    errors = [(r.gyro_dps[:, 2] - r.rate_dps) for r in session.runs]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def test_another_day_corrected_is_as_good_as_the_noise(days: tuple[Model, Path], tmp_path: Path) -> None:
    model, day = days
    done = apply(day, model, tmp_path / "out")
    before, after = rms_about_truth(Session.open(day)), rms_about_truth(Session.open(tmp_path / "out"))
    white = model.noise_on("z").white_sd_dps
    assert white is not None
    turn_on = model.value("turn_on_bias", "z", "sd_dps")
    assert before > 3 * after
    assert after < 1.03 * float(np.hypot(white, 3 * turn_on))
    assert {"scale", "bias", "bias_temperature", "scale_asymmetry"} <= set(done.applied)
    assert done.rows == Session.open(day).rows


def test_tables_and_sessions_give_the_same_numbers(days: tuple[Model, Path], tmp_path: Path) -> None:
    model, day = days
    apply(day, model, tmp_path / "out")
    file = Session.open(day).runs[3].file
    done = apply(day / file, model, tmp_path / "one.parquet")
    one, whole = pl.read_parquet(tmp_path / "one.parquet"), pl.read_csv(tmp_path / "out" / file)
    assert one.columns == pl.read_csv(day / file).columns
    for name in ("gx_dps", "gy_dps", "gz_dps"):
        assert one[name].to_numpy() == pytest.approx(whole[name].to_numpy(), abs=1e-7)
    assert done.rows == one.height


def test_the_bias_of_a_calibration_file_is_used(days: tuple[Model, Path], tmp_path: Path) -> None:
    model, day = days
    file = tmp_path / "cal.json"
    estimate = {"scenario": "all", "axis": "z", "bias_dps": 1.5, "bias_se_dps": 0.01, "trusted": True}
    file.write_text(json.dumps({"estimates": [estimate]}))
    table = day / Session.open(day).runs[0].file
    apply(table, model, tmp_path / "a.csv")
    apply(table, model, tmp_path / "b.csv", str(file))
    a, b = (pl.read_csv(tmp_path / f"{n}.csv")["gz_dps"].to_numpy() for n in "ab")
    shift = 1.5 - model.value("bias", "z", "bias_dps")
    assert a - b == pytest.approx(shift / (1 + model.value("scale", "z", "scale")), rel=0.01)
    file.write_text(json.dumps({"estimates": [{**estimate, "trusted": False}]}))
    with pytest.raises(InputError, match="can be trusted"):
        apply(table, model, tmp_path / "c.csv", str(file))


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1]])
def test_of_several_biases_the_surest_that_is_trusted_is_taken(
    days: tuple[Model, Path], tmp_path: Path, order: list[int]
) -> None:
    """In whatever order they stand: the surest is without trust, one lacks its error, and of the others one has the smaller."""
    model, day = days
    each = [(9.0, 0.001, False), (1.5, 0.01, True), (3.0, 0.05, True), (5.0, None, True)]
    estimates = [
        {"scenario": "all", "axis": "z", "bias_dps": bias_dps, "bias_se_dps": se_dps, "trusted": trusted}
        for bias_dps, se_dps, trusted in (each[i] for i in order)
    ]
    for name, chosen in (("all", estimates), ("one", [e for e in estimates if e["bias_dps"] == 1.5])):
        (tmp_path / f"{name}.json").write_text(json.dumps({"estimates": chosen}))
        apply(day / Session.open(day).runs[0].file, model, tmp_path / f"{name}.csv", str(tmp_path / f"{name}.json"))
    assert (tmp_path / "all.csv").read_bytes() == (tmp_path / "one.csv").read_bytes()


@pytest.mark.parametrize(
    ("bias", "reason"), [("rest:", "seconds after rest"), ("rest:-1", "more than 0"), ("nothing.json", "No such file")]
)
def test_a_bias_that_cannot_be_used_is_refused(days: tuple[Model, Path], tmp_path: Path, bias: str, reason: str) -> None:
    model, day = days
    with pytest.raises(InputError, match=reason):
        apply(day, model, tmp_path / "out", bias)
    assert not (tmp_path / "out").exists()


def test_the_command(days: tuple[Model, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, day = days
    model.save(tmp_path / "m.toml")
    whole = Session.open(day)
    whole.with_runs(r for r in whole.runs if r.table_rate_dps == 0).save(tmp_path / "rests")
    arguments = ["apply", str(tmp_path / "rests"), "--model", str(tmp_path / "m.toml"), "--out", str(tmp_path / "out")]
    assert main([*arguments, "--bias", "rest:2", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert set(told) == {"rows", "applied", "left", "outside", "accelerometer", "warnings"}
    assert all(set(one) == {"effect", "why"} for one in told["left"])
    assert main(arguments) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["apply", str(day), *arguments[2:5], str(tmp_path / "turning"), "--bias", "rest:2", "--json"]) == 2
    assert "table_rate_dps is" in capsys.readouterr().err
