"""The guess at columns and units: what it takes for what, and that nobody's data are taken without consent."""

import json
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.cli import main
from gyrocal.errors import InputError
from gyrocal.recording.column_map import ColumnMap, Scaling
from gyrocal.recording.first_rows import first_rows
from gyrocal.recording.guess import guess
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import Imported, import_recording, read_recording
from gyrocal.recording.readers import read
from gyrocal.recording.second_file import SecondFile
from gyrocal.recording.session import Session
from gyrocal.recording.source import Source

N = 400


def columns(names: list[str], gyro: float, accel: float, per_s: float, temp: float = 25.0) -> pl.DataFrame:
    """A table of time, three rates up to ``gyro``, gravity of size ``accel`` on z, temperature."""
    rng = np.random.default_rng(3)
    rates = gyro * np.sin(np.linspace(0, 20, N))[:, None] * [0.1, 0.2, 1]
    acceleration = accel * (np.array([0, 0, 1]) + rng.normal(0, 0.01, (N, 3)))
    content = np.column_stack([1.7e9 + np.arange(N) / 100 * per_s, rates, acceleration, np.full(N, temp)])
    return pl.DataFrame(content[:, : len(names)], schema=names)


def xyz(stem: str) -> list[str]:
    return [stem + axis for axis in "xyz"]


@pytest.mark.parametrize(
    ("table", "units"),
    [
        (columns(["time", "gx", "gy", "gz", "ax", "ay", "az", "temp"], 300, 1.0, 1), ["s", "dps", "g", "degC"]),
        (columns(["timestamp_us", *xyz("gyro_"), *xyz("acc_")], 3, 9.8, 1e6), ["us", "rad/s", "m/s2"]),
        # no part turns at 50 rad/s and measures it, whatever the accelerometer's unit
        (columns(["timestamp_us", *xyz("gyro_"), *xyz("acc_")], 50, 9.8, 1e6), ["us", "dps", "m/s2"]),
        (columns(["ustime", *xyz("gyro_"), *xyz("acc_")], 50, 9.8, 1e6), ["us", "dps", "m/s2"]),
        (columns(["Time (ms)", "Gyro X (deg/s)", "Gyro Y (deg/s)", "Gyro Z (deg/s)"], 3, 1, 1e3), ["ms", "dps"]),
        (columns(["Time", "GyroX", "GyroY", "GyroZ", "GForceX", "GForceY", "GForceZ"], 80, 1.0, 1), ["s", "dps", "g"]),
        (columns(["t", "w_x [rad/s]", "w_y [rad/s]", "w_z [rad/s]"], 3, 1, 1), ["s", "rad/s"]),
        (columns(["stamp_ns", *xyz("imu.angular_velocity.")], 300, 1, 1e9), ["ns", "dps"]),
        (columns(["t", "gyr.0", "gyr.1", "gyr.2", *xyz("acc"), "temp"], 300, 1000, 1, 298), ["s", "dps", "mg", "K"]),
        (columns(["timestamp", "gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]"], 3, 1, 1e6), ["us", "rad/s"]),
    ],
)  # fmt: skip
def test_columns_and_units(table: pl.DataFrame, units: list[str]) -> None:
    names = table.columns
    targets = ["t_s", "gx_dps", "gy_dps", "gz_dps", "ax_g", "ay_g", "az_g", "temp_c"][: len(names)]
    of_target = [units[0], *[units[1]] * 3, *[units[2] if len(units) > 2 else ""] * 3, *units[3:]]
    expected = {f"{target}={name}:{unit}" for target, name, unit in zip(targets, names, of_target, strict=False)}
    assert {g.map for g in guess(Source("a.csv", table), Scaling())} == expected


@pytest.mark.parametrize(
    ("names", "taken"),
    [
        (["Temperatur [°C]"], "temp_c=Temperatur [°C]:degC"), (["Tdie"], "temp_c=Tdie:degC"), (["die_t"], "temp_c=die_t:degC"),
        (["Oven [°C]", "temp"], "temp_c=temp:degC"), (["Kp [C]"], None), (["mag [uT]"], None),
    ],
)  # fmt: skip
def test_a_temperature_by_its_name_or_by_its_unit(names: list[str], taken: str | None) -> None:
    table = columns(["t_s", "gx_dps", "gy_dps", "gz_dps"], 300, 1, 1).with_columns(pl.lit(24.5).alias(name) for name in names)
    found = [g.map for g in guess(Source("a.csv", table), Scaling()) if g.map.startswith("temp_c")]
    assert found == ([] if taken is None else [taken])



@pytest.mark.parametrize(
    ("start", "step", "moved_degc", "unit"),
    [
        (2.565e14, 505_403, 60.0, "us"),  # a chamber read twice a second; in ns the temperature would move in 0.2 s
        (2.565e14, 505_403, 0.5, "ns"),
        (1.7e12, 500, 0.0, "ms"),  # milliseconds since 1970
        (0, 10_000, 60.0, "us"),  # 4 s: a temperature too fast for any unit that makes a usual rate
        (0, 6_900, 3.0, "us"),
    ],
)  # fmt: skip
def test_unit_of_integer_time_stamps(start: float, step: int, moved_degc: float, unit: str) -> None:
    """The steps alone took a chamber's microseconds for nanoseconds: 71 min became 4 s."""
    rng = np.random.default_rng(4)
    table = pl.DataFrame({
        "timestamp": (start + step * np.arange(N)).astype(np.int64), **{f"gyro_{axis}": rng.normal(size=N) for axis in "xyz"},
        "temperature": 20 + np.linspace(0, moved_degc, N),
    })  # fmt: skip
    found = next(g for g in guess(Source("a.csv", table), Scaling()) if g.map.startswith("t_s"))
    assert found.map == f"t_s=timestamp:{unit}"
    assert ("is possible too" in found.why) == (unit == "ns")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("stage_rad_s", "rate_ref_dps=stage_rad_s:rad/s"),
        ("Table rate (deg/s)", "rate_ref_dps=Table rate (deg/s):dps"),
        ("encoder_speed", "rate_ref_dps=encoder_speed:rad/s"),
        ("encoder_angle_deg", "ref_angle_deg=encoder_angle_deg:deg"),
        ("stage.position (rad)", "ref_angle_deg=stage.position (rad):rad"),
        ("encoder", None),
        ("table", None),
        ("truth", None),
        ("position", None),
        ("turntable_temp", None),
    ],
)
def test_the_true_rate_is_recognized_by_name_and_unit(name: str, expected: str | None) -> None:
    table = columns(["t", "w_x [rad/s]", "w_y [rad/s]", "w_z [rad/s]"], 3, 1, 1).with_columns(pl.lit(0.5).alias(name))
    maps = [g.map for g in guess(Source("a.csv", table), Scaling()) if g.map.startswith(("rate_ref", "ref_"))]
    assert maps == ([] if expected is None else [expected])
    assert all(not g.map.startswith(("rate_ref", "ref_")) for g in guess(Source("a.csv", table), Scaling(), reference=False))


def test_columns_beside_those_that_are_mapped_are_guessed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A line for the encoder alone does not turn off the guess at the gyroscope."""
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{10 * i},0.1,0.2,{9 + i % 3},{i / 10}\n" for i in range(300))
    Path("log.csv").write_text(f"time_ms,gx,gy,gz,enc\n{rows}")
    assert main(["import", "log.csv", "lab", "--map", "ref_angle_deg=enc", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["guessed"] == ["t_s=time_ms:ms", "gx_dps=gx:dps", "gy_dps=gy:dps", "gz_dps=gz:dps"]
    assert "ref_angle_deg" in Session.open("lab").runs[0].table.columns


def test_raw_counts_are_not_guessed() -> None:
    table = columns(["t", "gx", "gy", "gz"], 9000, 1, 1).with_columns(pl.col("gx", "gy", "gz").round())
    with pytest.raises(InputError, match=r"raw counts up to 9000.*--lsb-dps 0.00763359.*'gx_dps=\(gx-32768\)/131'"):
        guess(Source("a.csv", table), Scaling())
    assert "gz_dps=gz:counts" in {g.map for g in guess(Source("a.csv", table), Scaling(lsb_dps=0.00763359))}


def test_a_stated_size_of_a_count_holds_for_few_counts_too() -> None:
    """At rest whole numbers up to 49 were taken for dps, and 8192 counts for 1 g, whatever --lsb-dps and --lsb-g said."""
    names = ["t", *xyz("g"), *xyz("a")]
    table = columns(names, 49, 8192, 1).with_columns(pl.col(names[1:]).round())
    found = {g.map for g in guess(Source("a.csv", table), Scaling(lsb_dps=0.00763, lsb_g=0.000061))}
    assert {"gx_dps=gx:counts", "az_g=az:counts"} <= found
    assert "gx_dps=gx:dps" in {g.map for g in guess(Source("a.csv", table), Scaling())}


COUNTS = ("t_s=t:s", *(f"g{a}_dps=g{a}:counts" for a in "xyz"))


def counts_of(tmp_path: Path, codes: np.ndarray, maps: tuple[str, ...] = (), lsb_dps: float | None = 0.01) -> Imported:
    """The import of six columns of codes of 16 bits, at rest."""
    time = np.arange(len(codes)) / 100
    table = {"t": time, **{name: codes[:, i] for i, name in enumerate([*xyz("g"), *xyz("a")][: codes.shape[1]])}}
    pl.DataFrame(table).write_csv(tmp_path / "a.csv")
    scaling = Scaling(lsb_dps=lsb_dps)
    return read_recording(tmp_path / "a.csv", Options(maps=maps, scaling=scaling, defaults={"table_rate_dps": 0.0}))


@pytest.mark.parametrize("maps", [(), COUNTS, ("t_s=t:s", *(f"g{a}_dps=g{a}*0.01" for a in "xyz"))])
def test_counts_that_lost_their_sign_get_it_back(tmp_path: Path, maps: tuple[str, ...]) -> None:
    rng = np.random.default_rng(4)
    counts = np.column_stack([rng.integers(-300, 300, (500, 3)), rng.integers(-20, 20, (500, 2)), np.full(500, -16384)])
    found = counts_of(tmp_path, counts % 65536, maps)
    np.testing.assert_allclose(found.session.runs[0].gyro_dps, 0.01 * counts[:, :3], atol=1e-9)
    assert found.repaired == {"signs": np.sum(counts[:, : 3 if maps else 6] < 0)}
    if not maps:
        np.testing.assert_allclose(found.session.runs[0].table["az_g"].to_numpy(), -1.0, atol=0.01)


def test_counts_that_lost_their_sign_get_it_back_beside_a_damaged_cell(tmp_path: Path) -> None:
    counts = np.random.default_rng(4).integers(-300, 300, (500, 3))
    counts_of(tmp_path, counts % 65536)
    lines = (tmp_path / "a.csv").read_text().splitlines()
    lines[8] = "0.07,1,?!,3"
    (tmp_path / "b.csv").write_text("\n".join(lines) + "\n")
    options = Options(scaling=Scaling(lsb_dps=0.01), defaults={"table_rate_dps": 0.0})
    found = read_recording(tmp_path / "b.csv", options)
    assert found.repaired["rows"] == 1
    assert found.session.runs[0].gyro_dps.min() == pytest.approx(-3.0, abs=0.05)


@pytest.mark.parametrize("maps", [(), COUNTS])
def test_counts_whose_sign_is_not_sure_are_refused_with_both_possibilities(tmp_path: Path, maps: tuple[str, ...]) -> None:
    """All are negative, or far above the middle: nothing steps across an end of the range."""
    codes = np.random.default_rng(4).integers(64000, 65000, (500, 3))
    with pytest.raises(InputError, match=r"without their sign.*subtract 65536.*or 32768 is zero"):
        counts_of(tmp_path, codes, maps)


@pytest.mark.parametrize("reach", [300, 32767])
def test_counts_about_the_middle_of_the_range_stay(tmp_path: Path, reach: int) -> None:
    codes = 32768 + np.rint(reach * np.sin(np.linspace(0, 60, 500)))[:, None].astype(int) * [1, 1, 1]
    with pytest.raises(InputError, match=r"gx holds raw counts up to .*subtract 65536.*or 32768 is zero"):
        counts_of(tmp_path, codes, lsb_dps=None)
    found = counts_of(tmp_path, codes, ("t_s=t:s", *(f"g{a}_dps=(g{a}-32768)/100" for a in "xyz")))
    np.testing.assert_allclose(found.session.runs[0].gyro_dps, (codes - 32768) / 100, atol=1e-9)
    assert not found.repaired


def test_a_part_number_in_a_name_and_the_acceleration_that_shows_gravity() -> None:
    """HyperIMU writes gyroscope_lsm6ds3_c.x, and linear_Acceleration.x, which came first and has no gravity."""
    table = columns(["timestamp", *xyz("gyroscope_lsm6ds3_c."), *xyz("accelerometer_lsm6ds3_c.")], 3, 9.8, 1e3)
    rng = np.random.default_rng(5)
    linear = [pl.Series(f"linear_Acceleration.{a}", rng.normal(0, 1, N)) for a in "xyz"]
    found = {g.map for g in guess(Source("a.csv", pl.concat([pl.DataFrame(linear), table], how="horizontal")), Scaling())}
    assert "az_g=accelerometer_lsm6ds3_c.z:m/s2" in found
    assert any(text.startswith("gz_dps=gyroscope_lsm6ds3_c.z:") for text in found)


def test_rows_written_twice_are_found_beside_rows_that_share_a_stamp(tmp_path: Path) -> None:
    """A log that is flushed in parts stamps several rows alike, and writes some of them again."""
    rng = np.random.default_rng(6)
    t_ms = np.repeat(np.arange(800) * 20, 2)
    rows = np.column_stack([t_ms, rng.normal(0, 0.5, (1600, 3)).round(3)])
    again = np.sort(np.concatenate([np.arange(1600), rng.choice(1600, 500, replace=False)]))
    pl.DataFrame(rows[again], schema=["t_ms", "gx", "gy", "gz"]).write_csv(tmp_path / "a.csv")
    maps = ("t_s=t_ms:ms", *(f"g{a}_dps=g{a}:dps" for a in "xyz"))
    found = read_recording(tmp_path / "a.csv", Options(maps=maps, defaults={"table_rate_dps": 0.0}))
    assert len(found.session.runs[0]) == 1600


def test_no_gyroscope_is_told() -> None:
    with pytest.raises(InputError, match="no gyroscope is recognized among t, ax, ay"):
        guess(Source("a.csv", columns(["t", "ax", "ay"], 1, 1, 1)), Scaling())


@pytest.fixture
def log(tmp_path: Path) -> Path:
    table = columns(["time", "gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z"], 3, 9.8, 1)
    (tmp_path / "log.csv").write_text("Logger 3000\nserial;7\n" + table.write_csv())
    return tmp_path / "log.csv"


def test_a_guess_needs_consent(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = log.with_name("out")
    assert main(["import", str(log), str(out), "--rate", "78"]) == 2
    said = capsys.readouterr()
    assert "--map 'gz_dps=gyro_z:rad/s'" in said.err
    assert "accelerometer is in m/s2" in said.out
    assert not out.exists()
    with pytest.raises(InputError, match=r"a guess: t_s=time:s gx_dps=gyro_x:rad/s"):
        import_recording(log, out, defaults={"table_rate_dps": 78.0})


@pytest.mark.parametrize("consent", ["--yes", "--json"])
def test_a_guess_is_taken_by_yes_or_json_and_told(log: Path, consent: str, capsys: pytest.CaptureFixture[str]) -> None:
    out = log.with_name("out")
    assert main(["import", str(log), str(out), "--rate", "170", consent]) == 2  # 3 may be deg/s or rad/s
    error = capsys.readouterr().err
    assert "the unit of gyro_x is not known" in error
    advice = shlex.split(error[error.index("--map") : error.index(", or")].replace(":rad/s", ":dps"))
    assert main(["import", str(log), str(out), "--rate", "170", consent, *advice]) == 0  # the advice alone is enough
    shutil.rmtree(out)
    capsys.readouterr()
    log.write_text(log.read_text().replace("gyro_x,gyro_y,gyro_z", "gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s"))
    assert main(["import", str(log), str(out), "--rate", "170", consent]) == 0
    said = capsys.readouterr().out
    assert "gz_dps=gyro_z_rad_s:rad/s" in (json.loads(said)["guessed"] if consent == "--json" else said)
    assert np.abs(Session.open(out).runs[0].gyro_dps).max() == pytest.approx(np.degrees(3), rel=0.01)


def test_a_preview_is_drawn_before_anything_is_taken(log: Path) -> None:
    picture = log.with_name("preview.png")
    assert main(["import", str(log), str(log.with_name("out")), "--rate", "78", "--preview", str(picture)]) == 2
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert {p.name for p in log.parent.iterdir()} == {"log.csv", "preview.png"}


GROUPS = ("Time (s);Vicon Orientation;;;;IMU Acceleration;;;IMU Gyroscope;;", ";W;X;Y;Z;X;Y;Z;X;Y;Z")
UNITS = ("Time,Gyro X,Gyro Y,Gyro Z,Acc X,Acc Y,Acc Z", "ms,deg/s,deg/s,deg/s,m/s2,m/s2,m/s2")


@pytest.mark.parametrize(
    ("header", "tail", "expected"),
    [
        (GROUPS, "", "t_s=Time (s):s gx_dps=IMU Gyroscope X:rad/s ax_g=IMU Acceleration X:m/s2 ref_qw=Vicon Orientation W"),
        (GROUPS, ";", "t_s=Time (s):s gz_dps=IMU Gyroscope Z:rad/s az_g=IMU Acceleration Z:m/s2 ref_qz=Vicon Orientation Z"),
        (UNITS, "", "t_s=Time (ms):ms gx_dps=Gyro X (deg/s):dps ax_g=Acc X (m/s2):m/s2"),
    ],
)
def test_a_header_of_two_lines(tmp_path: Path, header: tuple[str, str], tail: str, expected: str) -> None:
    semicolons = ";" in header[0]
    t_s, rate = np.arange(N) / 100, 3 * np.sin(np.arange(N) / 30)
    gravity, rates = np.tile([0.1, 0.2, 9.8], (N, 1)), np.column_stack([rate, -rate, rate / 2])
    turned = np.column_stack([np.ones(N), np.zeros((N, 3))])
    content = np.column_stack([t_s, turned, gravity, rates] if semicolons else [1e3 * t_s, 30 * rates, gravity])
    separator = ";" if semicolons else ","
    body = "\n".join(separator.join(f"{v:.9g}" for v in row) for row in content)
    path = tmp_path / "a.csv"
    path.write_text("\n".join([header[0], header[1] + tail, body]))
    guessed = {g.map for g in guess(read(path), Scaling())}
    for words in re.split(r" (?=[a-z]+_[a-z]+=)", expected):
        assert words in guessed, guessed


def test_an_orientation_that_no_tracker_measured_is_no_reference() -> None:
    table = columns(["t", *xyz("gyr_"), *xyz("acc_")], 300, 1.0, 1)
    own = table.with_columns(pl.lit(float(i == 0)).alias(f"orientation.{part}") for i, part in enumerate("wxyz"))
    assert not any(g.map.startswith("ref_") for g in guess(Source("a.csv", own), Scaling()))


SECONDS = [f"2024-05-01 10:00:{i / 100:09.6f}" for i in range(N)]


@pytest.mark.parametrize(
    ("name", "head", "time", "factor", "expected"),
    [
        ("phone/Gyroscope.csv", "time,z,y,x", [10**18 + 10**7 * i for i in range(N)], 0.01745, "t_s=time:ns gx_dps=x:rad/s"),
        ("dates.csv", "Timestamp,Gyro_Z,Gyro_Y,Gyro_X", SECONDS, 1, "t_s=Timestamp gx_dps=Gyro_X:dps"),
        ("times.csv", "time,gz,gy,gx", [s[11:] for s in SECONDS], 1, "t_s=time gx_dps=gx:dps"),
        ("zoned.csv", "time,gz,gy,gx", [s.replace(" ", "T") + "+02:00" for s in SECONDS], 1, "t_s=time gx_dps=gx:dps"),
        ("dot.csv", "SampleTimeFine,Gyr_Z,Gyr_Y,Gyr_X", range(0, 10000 * N, 10000), 1, "t_s=SampleTimeFine:us"),
        ("mtw.csv", "SampleTimeFine,Gyr_Z,Gyr_Y,Gyr_X", range(0, 100 * N, 100), 1, "t_s=SampleTimeFine*0.0001"),
        ("log.csv", "time (us),gyroADC[2],gyroADC[1],gyroADC[0]", range(0, 10000 * N, 10000), 1, "gx_dps=gyroADC[0]:dps"),
        ("shimmer.csv", "S_Timestamp_Unix_CAL,S_Gyro_Z_CAL,S_Gyro_Y_CAL,S_Gyro_X_CAL", range(0, 10 * N, 10), 1,
         "t_s=S_Timestamp_Unix_CAL:ms gx_dps=S_Gyro_X_CAL:dps"),
        ("rocket.csv", "timestamp_seconds,angular_rate_z_deg_per_s,angular_rate_y_deg_per_s,angular_rate_x_deg_per_s",
         [i / 100 for i in range(N)], 1, "t_s=timestamp_seconds:s gx_dps=angular_rate_x_deg_per_s:dps"),
        ("words.csv", "time,gyro_z_radians_per_second,gyro_y_radians_per_second,gyro_x_radians_per_second",
         [i / 100 for i in range(N)], 0.0174533, "gx_dps=gyro_x_radians_per_second:rad/s"),
        ("deutsch.csv", "Zeit [s],Drehrate Z [°/s],Drehrate Y [°/s],Drehrate X [°/s]", [i / 100 for i in range(N)], 1,
         "gx_dps=Drehrate X [°/s]:dps"),
    ],
)  # fmt: skip
def test_the_habits_of_loggers(
    tmp_path: Path, name: str, head: str, time: list[object], factor: float, expected: str
) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    rates = factor * (np.array([78.0, 0.2, 0.1]) + np.random.default_rng(1).normal(0, 0.1, (N, 3)))
    rows = (f"{t},{','.join(f'{v:.6f}' for v in row)}" for t, row in zip(time, rates, strict=True))
    path.write_text("\n".join([head, *rows]))
    source = read(path)
    guessed = guess(source, Scaling())
    assert {g.map for g in guessed} >= set(re.split(r" (?=[a-z]+_[a-z]+=)", expected))
    import_recording(path, tmp_path / "out", [g.map for g in guessed], defaults={"table_rate_dps": 78.0})
    run = Session.open(tmp_path / "out").runs[0]
    assert len(run) == N
    assert run.duration_s == pytest.approx(N / 100, rel=1e-3)
    assert float(np.mean(run.gyro_dps[:, 2])) == pytest.approx(78, rel=0.01)


def test_a_time_whose_last_rows_hold_no_sample_is_still_the_time() -> None:
    """A buffer that was not filled to its end holds zeros there, and a counter of 32 bits begins again."""
    table = columns(["time", *xyz("gyro_")], 300, 1.0, 1)
    table = table.with_columns(pl.when(pl.int_range(pl.len()) < N - 50).then(pl.all()).otherwise(0.0))
    assert guess(Source("log.csv", table), Scaling())[0].map == "t_s=time:s"
    ticks = (np.arange(N) * 10_000 + 2**32 - 1_000_000) % 2**32
    table = table.with_columns(pl.Series("time", ticks.astype(float)))
    assert guess(Source("log.csv", table), Scaling())[0].map == "t_s=time:us"


def test_a_column_named_as_a_time_that_goes_to_and_fro_is_none() -> None:
    table = columns(["t", *xyz("gyro_")], 300, 1.0, 1)
    warm = np.random.default_rng(1).normal(25.0, 0.05, N)
    assert not [g for g in guess(Source("log.csv", table.with_columns(pl.Series("t", warm))), Scaling()) if "t_s=" in g.map]


@pytest.mark.parametrize(
    ("names", "stem"),
    [(["wx", "wy", "wz"], "w"), (["omega_x", "omega_y", "omega_z"], "omega_"), (["rot_x", "rot_y", "rot_z"], "rot_"),
     (["rotX", "rotY", "rotZ"], "rot"), (["gyroADC_x", "gyroADC_y", "gyroADC_z"], "gyroADC_")],
)  # fmt: skip
def test_names_of_rates(names: list[str], stem: str) -> None:
    maps = {g.map for g in guess(Source("a.csv", columns(["t", *names], 300, 1, 1)), Scaling())}
    assert f"gx_dps={names[0]}:dps" in maps, stem
    assert f"gz_dps={names[2]}:dps" in maps


@pytest.mark.parametrize(
    ("names", "taken"),
    [
        (["p", "q", "r", "phi", "theta", "psi"], True),
        (["p", "q", "r", "ax", "ay", "az"], True),
        (["p [rad/s]", "q [rad/s]", "r [rad/s]"], True),
        (["p", "q", "r"], False),
        (["p", "q", "phi"], False),
        (["p", "q", "r", "pressure"], False),
        (["rot_x", "rot_y", "rot_z", "rot_w"], False),
        (["rot_x (deg)", "rot_y (deg)", "rot_z (deg)"], False),
        (["bias_gyro_x", "bias_gyro_y", "bias_gyro_z"], False),
    ],
)
def test_letters_and_rotations_are_rates_only_beside_other_evidence(names: list[str], taken: bool) -> None:
    source = Source("a.csv", columns(["t", *names], 3, 9.81, 1))
    if taken:
        maps = {g.map for g in guess(source, Scaling())}
        unit = ":rad/s" if "[" in names[0] or "ax" in names else ":dps"
        assert {f"gx_dps={names[0]}{unit}", f"gy_dps={names[1]}{unit}", f"gz_dps={names[2]}{unit}"} <= maps
    else:
        with pytest.raises(InputError, match="no gyroscope is recognized"):
            guess(source, Scaling())


@pytest.mark.parametrize("turns", [False, True])
def test_a_reference_that_is_stated_decides_the_unit_with_a_time_that_is_guessed(turns: bool, tmp_path: Path) -> None:
    """A joint's angle beside a yaw rate: nothing else in the file tells rad/s from deg/s. An encoder begins anew each turn."""
    t_s = np.arange(2000) / 100
    angle_deg = 90 * t_s % 360 if turns else 40 * np.sin(2 * t_s)
    rate_dps = np.full(t_s.size, 90.0) if turns else 80 * np.cos(2 * t_s)
    noise = np.random.default_rng(5).normal(0, 0.001, t_s.size)
    pl.DataFrame({"time": t_s, "yaw_rate": np.deg2rad(rate_dps) + noise, "joint": angle_deg}).write_csv(tmp_path / "arm.csv")
    found = read_recording(tmp_path / "arm.csv", Options.of(["ref_angle_deg=joint"], {}))
    (rate,) = [g for g in found.guessed if g.map.startswith("gz_dps")]
    assert rate.map == "gz_dps=yaw_rate:rad/s"
    assert not rate.asks


def test_cells_that_are_missing_are_shown_empty() -> None:
    table = pl.DataFrame({"t_s": [0.0, 0.1], "gz_dps": [1.5, 1.6], "az_g": [float("nan"), 1.0]})
    source = Source("a.csv", table)
    shown = {row.target: row.values for row in first_rows(source, [ColumnMap(name, name) for name in table.columns])}
    assert shown["az_g"] == ("", "1")


def test_first_cells_have_all_their_digits_and_an_unfinished_last_row_is_told_as_such(tmp_path: Path) -> None:
    """Three stamps since 1970 were shown as 1268594645, and half a row as a line of text."""
    rows = [f"{1268594644.75791 + k / 10:.6f},0.{k % 7},0.1,-0.2" for k in range(200)]
    (tmp_path / "a.csv").write_text("\n".join(["tstamp,x,y,z", *rows, "126859"]))
    maps = ("t_s=tstamp:s", *(f"g{a}_dps={a}:dps" for a in "xyz"))
    found = read_recording(tmp_path / "a.csv", Options(maps=maps, defaults={"table_rate_dps": 0.0}))
    assert found.first_rows[0].values == ("1268594644.757910", "1268594644.857910", "1268594644.957910")
    (told,) = [w.text for w in found.warnings if w.code == "line_damaged"]
    assert "the last row, which is unfinished, is left out (row 202)" in told
    whole = Source("a.csv", pl.DataFrame({"t_s": [1268594644.75791, 5.0893847806400e13], "gz_dps": [0.1, 2.0]}))
    shown = first_rows(whole, [ColumnMap(name, name) for name in whole.frame.columns])
    assert shown[0].values == ("1268594644.75791", "50893847806400")


def test_a_receivers_time_of_day_is_no_count_of_milliseconds() -> None:
    """123859900 is followed by 123900000: as milliseconds the recording would be 40 s longer for each minute."""
    tenths = 583_553 + np.arange(N * 5) // 5  # a clock of 0.1 s, five samples each
    digits = tenths // 600 % 60 * 100_000 + tenths % 600 * 100 + 120_000_000
    rates = {f"gyro_{axis}": 90 * np.sin(np.arange(N * 5) / 50) for axis in "xyz"}
    of_day = pl.DataFrame({"time": digits, "millis": 1.4e12 + 20.0 * np.arange(N * 5), **rates})
    found = next(g for g in guess(Source("a.csv", of_day), Scaling()) if g.map.startswith("t_s"))
    assert found.map == "t_s=millis:ms"
    assert not [g for g in guess(Source("a.csv", of_day.drop("millis")), Scaling()) if g.map.startswith("t_s")]


def test_of_two_clocks_the_finer_is_taken() -> None:
    rates = {f"gyro_{axis}": 90 * np.sin(np.arange(N) / 50) for axis in "xyz"}
    coarse, fine = 100.0 * (np.arange(N) // 5), 7e9 + 2e7 * np.arange(N)
    both = pl.DataFrame({"time": coarse, "sensor_timestamp": fine, **rates})
    assert next(g.map for g in guess(Source("a.csv", both), Scaling())) == "t_s=sensor_timestamp:ns"
    even = both.with_columns(time=20.0 * pl.int_range(N))
    assert next(g.map for g in guess(Source("a.csv", even), Scaling())) == "t_s=time:ms"


def test_a_stamp_that_goes_on_by_one_counts_the_samples_of_a_stated_rate() -> None:
    """It was taken for milliseconds, and the recording for a quarter as long."""
    rates = {f"gyro_{axis}": 90 * np.sin(np.arange(N) / 50) for axis in "xyz"}
    table = pl.DataFrame({"timestamp": np.arange(N), **rates})
    taken = [guess(Source("a.csv", table), Scaling(rate_hz=hz))[0].map for hz in (256.0, 1000.0, None)]
    assert taken == ["t_s=timestamp*0.00390625", "t_s=timestamp:ms", "t_s=timestamp:ms"]


@pytest.mark.parametrize("parts", [["R", "P", "Y"], ["Roll", "Pitch", "Yaw"]])
def test_rates_by_roll_pitch_and_yaw_are_x_y_and_z(tmp_path: Path, parts: list[str]) -> None:
    """``GyroY`` alone was taken, for y, though it is the yaw."""
    table = columns(["time", *[f"Gyro{part}" for part in parts], "AccX", "AccY", "AccZ"], 300, 1.0, 1)
    table.write_csv(tmp_path / "log.csv")
    found = {g.map.partition("=")[0]: g.map.partition("=")[2] for g in guess(read(tmp_path / "log.csv"), Scaling())}
    assert [found[f"g{axis}_dps"] for axis in "xyz"] == [f"Gyro{part}:dps" for part in parts]


def test_a_magnetic_field_is_no_temperature() -> None:
    table = columns(["time", *xyz("gyro_")], 300, 1.0, 1).with_columns(pl.lit(31.3).alias("Magnetic Field/X uT"))
    assert not [g for g in guess(Source("a.csv", table), Scaling()) if g.map.startswith("temp_c")]
    warm = table.with_columns(pl.lit(25.0).alias("Static/Temperature/Scalar deg C"))
    assert guess(Source("a.csv", warm), Scaling())[-1].map == "temp_c=Static/Temperature/Scalar deg C:degC"


@pytest.mark.parametrize("name", ["t_imu", "MATLABtime"])
def test_a_time_with_an_unusual_name_is_taken_or_named(tmp_path: Path, name: str) -> None:
    """A column that increases by even steps is a time; one of uneven steps is named in the error."""
    rng = np.random.default_rng(3)
    even_s = np.arange(800) / 100.0
    gyro = {f"gyro_{a}_dps": rng.normal(0, 0.1, 800) for a in "xyz"}
    more = {"cycle_time": np.full(800, 0.01), "exposure_time": rng.normal(5, 1, 800)}
    pl.DataFrame({**gyro, **more, name: even_s}).write_csv(tmp_path / "even.csv")
    found = read_recording(tmp_path / "even.csv", Options(defaults={"table_rate_dps": 0.0}))
    assert found.session.sample_rate_hz == pytest.approx(100.0)
    uneven_s = np.cumsum(np.where(np.arange(800) < 300, 0.002, 0.012) * (1 + 0.8 * rng.uniform(-1, 1, 800)))
    pl.DataFrame({**gyro, **more, name: uneven_s}).write_csv(tmp_path / "uneven.csv")
    with pytest.raises(InputError, match=f"no time: .*perhaps --map 't_s={name}:UNIT'"):
        read_recording(tmp_path / "uneven.csv", Options(defaults={"table_rate_dps": 0.0}))


@pytest.mark.parametrize(
    ("header", "taken"),
    [
        ("time_s,angle_deg", "ref_angle_deg=angle_deg:deg"), ("time_s,theta (rad)", "ref_angle_deg=theta (rad):rad"),
        ("t,speed_dps", "rate_ref_dps=speed_dps:dps"), ("time_s,phi_deg,theta_deg", None), ("time_s,position", None),
    ],
)  # fmt: skip
def test_the_only_angle_or_rate_of_a_reference_s_own_file_is_taken(tmp_path: Path, header: str, taken: str | None) -> None:
    count = header.count(",")
    rows = [",".join([f"{k / 50:.2f}", *[f"{0.5 * k:.2f}"] * count]) for k in range(300)]
    (tmp_path / "ref.csv").write_text("\n".join([header, *rows]) + "\n")
    second = SecondFile(tmp_path / "ref.csv", ())
    if taken is None:
        with pytest.raises(InputError, match="no time and reference are recognized"):
            second.guessed()
    else:
        assert taken in [g.map for g in second.guessed()[1]]


@pytest.mark.parametrize(
    ("largest", "taken", "asks"),
    [(360.0, "deg", False), (2 * np.pi, "rad", False), (1.0, "rad", True)], ids=["deg", "rad", "?"],
)  # fmt: skip
def test_a_yaw_in_a_reference_s_own_file_is_its_angle(tmp_path: Path, largest: float, taken: str, asks: bool) -> None:
    """As robots write it, beside roll and pitch; a yaw that stays within a turn in rad says nothing of its unit."""
    turned = 0.01 * np.arange(900.0) if largest > 1 else 0.001 * np.arange(900.0)
    yaw = (turned / (2 * np.pi) * largest + largest / 2) % largest - largest / 2 if largest > 1 else turned
    table = {"unix_timestamp": 1.7e9 + np.arange(900) / 20, "yaw": yaw, "pitch": 0 * yaw + 0.01, "roll": 0 * yaw}
    pl.DataFrame(table).write_csv(tmp_path / "ref.csv")
    (found,) = [g for g in SecondFile(tmp_path / "ref.csv", ()).guessed()[1] if g.map.startswith("ref")]
    assert (found.map, found.asks) == (f"ref_angle_deg=yaw:{taken}", asks)


@pytest.mark.parametrize(("low", "high", "told"), [(0.94, 0.98, "are divided by it"), (0.5, 1.5, None)])
def test_quaternions_of_about_one_length_are_divided_by_it(tmp_path: Path, low: float, high: float, told: str | None) -> None:
    """A filter's quaternions may have a length of .94 to .98: they were refused, and nobody said what to do."""
    t_s, length = np.arange(600) / 100.0, np.random.default_rng(0).uniform(low, high, 600)
    half = 0.4 * np.sin(t_s)
    parts = {"ref_qw": np.cos(half), "ref_qx": 0 * half, "ref_qy": 0 * half, "ref_qz": np.sin(half)}
    gyro = {"gx_dps": 0 * t_s, "gy_dps": 0 * t_s, "gz_dps": np.rad2deg(0.8 * np.cos(t_s))}
    pl.DataFrame({"t_s": t_s, **gyro, **{n: length * v for n, v in parts.items()}}).write_csv(tmp_path / "log.csv")
    if told is None:
        with pytest.raises(InputError, match=r"not 1 .*divided by it at the import"):
            _ = read_recording(tmp_path / "log.csv", Options()).session.runs[0].rate_dps
        return
    found = read_recording(tmp_path / "log.csv", Options())
    assert [told in w.text for w in found.warnings if w.code == "line_damaged"] == [True]
    assert found.session.runs[0].column("ref_qz") == pytest.approx(np.sin(half), abs=1e-6)


@pytest.mark.parametrize(("moves", "name"), [(False, "Temp_c"), (True, "Temp_c"), (False, "temp")])
def test_a_temperature_that_is_equal_in_every_row_is_told(tmp_path: Path, moves: bool, name: str) -> None:
    """It was taken without a word, though a thermocouple beside it moved by 8 degrees."""
    rng = np.random.default_rng(3)
    gyro = {f"gyro_{a}_dps": rng.normal(0, 0.1, 1200) for a in "xyz"}
    temp_c = np.full(1200, 25.0) + moves * np.linspace(0, 1, 1200)
    pl.DataFrame({"time_s": np.arange(1200) / 100.0, **gyro, name: temp_c}).write_csv(tmp_path / "log.csv")
    found = read_recording(tmp_path / "log.csv", Options(defaults={"table_rate_dps": 0.0}))
    (told,) = [g for g in found.guessed if g.map.startswith("temp_c=")]
    assert ("25 in every row" in told.why) == (not moves)
    stated = ["t_s=time_s", *[f"g{a}_dps=gyro_{a}_dps" for a in "xyz"], f"temp_c={name}"]
    mapped = read_recording(tmp_path / "log.csv", Options(stated, defaults={"table_rate_dps": 0.0}))
    assert ("temp_unit" in {w.code for w in mapped.warnings}) == (not moves)
    assert "temp_unit" not in {w.code for w in found.warnings}


def test_columns_that_name_a_gyroscope_and_are_not_taken_are_named(tmp_path: Path) -> None:
    """Of three columns one was taken, and of the others no word was said."""
    columns(["time", "GyroA", "GyroB", "GyroZ"], 300, 1.0, 1).write_csv(tmp_path / "log.csv")
    (rate,) = [g for g in guess(read(tmp_path / "log.csv"), Scaling()) if g.map.startswith("gz_dps")]
    assert rate.why.endswith("; not GyroA, GyroB")
    wide = pl.DataFrame({f"c{i}": np.arange(50.0) for i in range(60)} | {"gz": np.arange(50.0), "TimeLog": np.arange(50.0)})
    wide.write_csv(tmp_path / "wide.csv")
    with pytest.raises(InputError, match="columns not taken: TimeLog, c0"):
        read_recording(tmp_path / "wide.csv", Options.of(["gz_dps=gz:dps"], {"table_rate_dps": 0.0}))


def test_a_time_is_no_temperature_too_and_an_acceleration_in_g_no_rate(tmp_path: Path) -> None:
    """``t_imu`` was taken for both, and ``acc_bno_g`` for the gyroscope beside ``giro_bno_dps``."""
    table = columns(["t_imu", *[f"acc_bno_g_{a}" for a in "xyz"], *[f"giro_bno_dps_{a}" for a in "xyz"]], 1.0, 300.0, 1)
    table = table.with_columns(pl.Series("t_imu", np.arange(N) / 10.0))
    table.write_csv(tmp_path / "log.csv")
    found = {g.map.partition("=")[0]: g.map.partition("=")[2] for g in guess(read(tmp_path / "log.csv"), Scaling())}
    assert found["t_s"].startswith("t_imu")
    assert "temp_c" not in found
    assert found["gx_dps"].startswith("giro_bno_dps_x")
