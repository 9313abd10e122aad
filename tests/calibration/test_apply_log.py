"""``apply`` on any log: every format that is read gives the same corrected table, with no true rate and as --map says."""

import gzip
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.io import savemat

from gyrocal.calibration.apply import apply
from gyrocal.cli import main
from gyrocal.error_model.fitted_on import FittedOn
from gyrocal.error_model.model import Model
from gyrocal.error_model.term import Term
from gyrocal.errors import InputError
from recording.test_readers import ACC, GYRO, START_NS, T_NS, N, ulog, write_bag

MAPS = ["t_s=stamp:ns", *(f"g{a}_dps=w{a}:rad/s" for a in "xyz"), *(f"a{a}_g=f{a}:m/s2" for a in "xyz")]
TEXT = pl.DataFrame(
    {"stamp": T_NS, **{f"w{a}": GYRO[:, i] for i, a in enumerate("xyz")}, **{f"f{a}": ACC[:, i] for i, a in enumerate("xyz")}}
)


@pytest.fixture(scope="module")
def model() -> Model:
    """Scale and bias of each axis, misalignment, and a pull by gravity."""
    terms = [term for i, axis in enumerate("xyz") for term in (
        Term("scale", axis, {"scale": 0.004 * (i + 1)}), Term("bias", axis, {"bias_dps": 0.3 - 0.5 * i}),
        Term("g_sensitivity", axis, {"gx_dps_per_g": 0.02, "gy_dps_per_g": -0.01, "gz_dps_per_g": 0.03}),
    )]  # fmt: skip
    return Model("by hand", (*terms, Term("misalignment", "x", {"m_z": 0.003})))


def written(folder: Path, form: str, require_module: Callable[[str], None]) -> tuple[Path, list[str]]:
    """The recording in a format, and what maps its columns; nothing for those whose names and units say it."""
    if form in ("csv", "csv.gz", "tsv"):
        text = TEXT.write_csv(separator="\t" if form == "tsv" else ",").encode()
        (folder / f"a.{form}").write_bytes(gzip.compress(text) if form == "csv.gz" else text)
        return folder / f"a.{form}", MAPS
    if form == "parquet":
        TEXT.write_parquet(folder / "a.parquet")
        return folder / "a.parquet", MAPS
    if form in ("npz", "mat"):
        content = {"stamp": T_NS, **{name: TEXT[name].to_numpy() for name in TEXT.columns[1:]}}
        if form == "npz":
            np.savez(folder / "a.npz", **content)
        else:
            savemat(folder / "a.mat", content)
        return folder / f"a.{form}", MAPS
    if form == "ulg":
        require_module("pyulog")
        ulog(folder / "a.ulg")
        topic = "sensor_combined"
        return folder / "a.ulg", [
            f"t_s={topic}.timestamp:us", *(f"g{a}_dps={topic}.gyro_rad[{i}]:rad/s" for i, a in enumerate("xyz")),
            *(f"a{a}_g={topic}.accelerometer_m_s2[{i}]:m/s2" for i, a in enumerate("xyz")),
        ]  # fmt: skip
    require_module("rosbags")
    path = folder / ("a.bag" if form == "1" else "bag")
    write_bag(path, form)
    return next(path.glob("*.mcap")) if form == "mcap" else path, [
        "t_s=stamp_ns:ns", *(f"g{a}_dps=angular_velocity.{a}:rad/s" for a in "xyz"),
        *(f"a{a}_g=linear_acceleration.{a}:m/s2" for a in "xyz"),
    ]  # fmt: skip


def corrected(model: Model) -> pl.DataFrame:
    """The recording corrected as a table in memory."""
    rates = {f"g{a}_dps": np.degrees(GYRO[:, i]) for i, a in enumerate("xyz")}
    forces = {f"a{a}_g": ACC[:, i] / 9.80665 for i, a in enumerate("xyz")}
    frame = pl.DataFrame({"t_s": (T_NS - START_NS) / 1e9, **rates, **forces})
    done = model.correct(frame)
    assert isinstance(done, pl.DataFrame)
    return done


@pytest.mark.parametrize("form", ["csv", "csv.gz", "tsv", "parquet", "npz", "mat", "ulg", "1", "2", "mcap"])
@pytest.mark.parametrize("out", ["out.csv", "out.parquet"])
def test_every_format_gives_the_same_corrected_table(
    form: str, out: str, model: Model, tmp_path: Path, require_module: Callable[[str], None],
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    path, maps = written(tmp_path, form, require_module)
    model.save(tmp_path / "m.toml")
    words = ["apply", str(path), "--model", str(tmp_path / "m.toml"), "--out", str(tmp_path / out)]
    assert main([*words, *(word for m in maps for word in ("--map", m)), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["rows"] == N
    assert told["applied"] == ["scale", "bias", "g_sensitivity", "misalignment"]
    read = pl.read_parquet(tmp_path / out) if out.endswith("parquet") else pl.read_csv(tmp_path / out)
    assert read.columns == ["t_s", "gx_dps", "gy_dps", "gz_dps", "ax_g", "ay_g", "az_g"]
    assert read.to_numpy() == pytest.approx(corrected(model).to_numpy(), abs=2e-5)


def test_a_guess_is_confirmed_and_not_taken_unasked(model: Model, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model.save(tmp_path / "m.toml")
    np.savez(tmp_path / "a.npz", time=T_NS, gyr=GYRO, acc=ACC)
    with pytest.raises(InputError, match=r"a guess: --map 't_s=time:ns' --map 'gx_dps=gyr.0:rad/s'"):
        apply(tmp_path / "a.npz", model, tmp_path / "out.csv")
    words = ["apply", str(tmp_path / "a.npz"), "--model", str(tmp_path / "m.toml"), "--out", str(tmp_path / "out.csv")]
    assert main(words) == 2
    assert "take it by --yes" in capsys.readouterr().err
    assert not (tmp_path / "out.csv").exists()
    assert main([*words, "--yes"]) == 0
    told = capsys.readouterr().out
    assert "gx_dps=gyr.0:rad/s" in told
    assert f"{N} rows; removed: scale, bias, g_sensitivity, misalignment" in told


def test_one_measured_axis_is_enough(model: Model, tmp_path: Path) -> None:
    TEXT.select("stamp", "wz").write_csv(tmp_path / "a.csv")
    done = apply(tmp_path / "a.csv", model, tmp_path / "out.csv", maps=[MAPS[0], MAPS[3]])
    read = pl.read_csv(tmp_path / "out.csv")
    assert read.columns == ["t_s", "gz_dps"]
    wanted = (np.degrees(GYRO[:, 2]) - model.bias_dps["z"]) / (1 + model.value("scale", "z", "scale"))
    assert read["gz_dps"].to_numpy() == pytest.approx(wanted, abs=1e-6)
    assert done.left == {"g_sensitivity": "the recording has no ax_g and no ay_g and no az_g"}


def test_the_bias_of_the_first_seconds_at_rest(model: Model, tmp_path: Path) -> None:
    rest = TEXT.with_columns(
        wx=np.full(N, np.radians(0.3)), wy=np.full(N, np.radians(-0.2)), wz=np.full(N, np.radians(0.9))
    )
    rest.write_csv(tmp_path / "a.csv")
    apply(tmp_path / "a.csv", model, tmp_path / "out.csv", "rest:1", MAPS)
    assert np.abs(pl.read_csv(tmp_path / "out.csv")["gz_dps"].to_numpy()).max() < 0.01


def test_what_was_wrong_in_a_log_is_told(model: Model, tmp_path: Path, require_module: Callable[[str], None]) -> None:
    lines = TEXT.write_csv().splitlines()
    lines[100] = lines[100].replace(",", ",x", 1)
    (tmp_path / "a.csv").write_text("\n".join(lines))
    done = apply(tmp_path / "a.csv", model, tmp_path / "out.csv", maps=MAPS)
    assert done.rows == N - 1
    assert [w.code for w in done.warnings] == ["line_damaged"]


def test_rates_that_were_corrected_otherwise_than_those_of_the_model_are_told(
    model: Model, tmp_path: Path, require_module: Callable[[str], None]
) -> None:
    path, maps = written(tmp_path, "ulg", require_module)
    assert [w.code for w in apply(path, model, tmp_path / "a.csv", maps=maps).warnings] == ["corrected_already"]
    of_px4 = replace(model, fitted_on=FittedOn({}, "PX4 sensor_combined"))
    assert apply(path, of_px4, tmp_path / "b.csv", maps=maps).warnings == []


@pytest.mark.parametrize(
    ("source", "out", "reason"),
    [("a.csv", "out", "end in .csv, .csv.gz or .parquet"), ("no.ulg", "out.csv", "No such file"),
     ("folder", "o.csv", "session.toml")],
)  # fmt: skip
def test_what_cannot_be_corrected_is_one_line(model: Model, tmp_path: Path, source: str, out: str, reason: str) -> None:
    TEXT.write_csv(tmp_path / "a.csv")
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match=reason):
        apply(tmp_path / source, model, tmp_path / out)
    assert not (tmp_path / out).exists()


def test_several_recordings_are_corrected_one_at_a_time(model: Model, tmp_path: Path) -> None:
    for name in ("one", "two"):
        TEXT.write_csv(tmp_path / f"{name}.csv")
    with pytest.raises(InputError, match="2 recordings; correct one at a time"):
        apply(tmp_path, model, tmp_path / "out.csv", maps=MAPS)


def phone(folder: Path) -> Path:
    """The recording as a phone writes it: a file for each sensor."""
    folder.mkdir()
    for name, columns in (("Gyroscope", "w"), ("Accelerometer", "f")):
        TEXT.select(pl.col("stamp").alias("time"), *(pl.col(f"{columns}{a}").alias(a) for a in "xyz")).write_csv(
            folder / f"{name}.csv"
        )
    return folder


def test_a_folder_with_a_file_for_each_sensor_is_one_log(model: Model, tmp_path: Path) -> None:
    TEXT.write_csv(tmp_path / "one.csv")
    apply(tmp_path / "one.csv", model, tmp_path / "a.csv", maps=MAPS)
    done = apply(phone(tmp_path / "phone"), model, tmp_path / "b.csv", confirm=lambda _: None)
    whole, joined = pl.read_csv(tmp_path / "a.csv"), pl.read_csv(tmp_path / "b.csv")
    assert (done.rows, joined.columns) == (N, whole.columns)
    np.testing.assert_allclose(joined.to_numpy(), whole.to_numpy(), atol=1e-6)


def test_a_corrected_table_is_compressed_where_its_name_says_so(model: Model, tmp_path: Path) -> None:
    TEXT.write_csv(tmp_path / "one.csv")
    for name in ("a.csv", "a.csv.gz"):
        apply(tmp_path / "one.csv", model, tmp_path / name, maps=MAPS)
    assert gzip.decompress((tmp_path / "a.csv.gz").read_bytes()) == (tmp_path / "a.csv").read_bytes()
