"""What the importer mends, counts and tells in files that are not as they should be; every verb reads what it wrote."""

import json
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray

from gyrocal.cli import main
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.inference.fit import fit
from gyrocal.plausibility import check
from gyrocal.recording.column_map import Scaling
from gyrocal.recording.cut import Cut
from gyrocal.recording.file_labels import labels_of
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import Imported, import_recording, read_recording
from gyrocal.recording.register import registered
from gyrocal.recording.resample import resampled
from gyrocal.recording.second_file import SecondFile
from gyrocal.recording.session import Session
from gyrocal.warning import Warning

MAPS = ["t_s=t", "gx_dps=x", "gy_dps=y", "gz_dps=z"]
AT_78 = {"table_rate_dps": 78.0}
N = 1200
RATE_HZ = 100.0


def recording(seed: int = 7, scale: float = 0.004, bias_dps: float = 0.3) -> pl.DataFrame:
    """78 deg/s about z."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(0, 0.05, (N, 3))
    return pl.DataFrame({
        "t": np.arange(N) / RATE_HZ, "x": noise[:, 0], "y": noise[:, 1], "z": (1 + scale) * 78 + bias_dps + noise[:, 2],
    })  # fmt: skip


def read(path: Path, maps: list[str] = MAPS, **options: Any) -> Imported:
    return read_recording(path, Options(**({"maps": maps, "defaults": AT_78} | options)))


def lines(tmp_path: Path, change: Any = lambda rows: rows, name: str = "log.csv") -> Path:
    """The recording as CSV, its lines changed."""
    path = tmp_path / name
    path.write_text("\n".join(change(recording().write_csv().splitlines())) + "\n")
    return path


def ragged(rows: list[str]) -> list[str]:
    rows[100] = "0.99,1.0"
    rows[200] += ",extra"
    rows[300] = rows[300].replace(",", ",oops", 1)
    return rows


def footer(rows: list[str]) -> list[str]:
    return [*rows, "", "Mean,,,", "end of recording"]


def trailing(rows: list[str]) -> list[str]:
    return [rows[0], *(row + "," for row in rows[1:])]


def restarted(rows: list[str]) -> list[str]:
    return [*rows[:500], "--- logger restarted", rows[0], *rows[500:]]


@pytest.mark.parametrize(
    ("change", "left_out"), [(ragged, 3), (footer, 2), (trailing, 0), (restarted, 2), (lambda rows: ["", *rows, "", ""], 0)]
)
def test_rows_without_a_sample_are_left_out_and_counted(tmp_path: Path, change: Any, left_out: int) -> None:
    found = read(lines(tmp_path, change))
    assert found.repaired == ({"rows": left_out} if left_out else {})
    assert [w.code for w in found.warnings] == ["line_damaged"] * bool(left_out)
    kept = found.session.runs[0]
    assert len(kept) == N - (left_out if change is ragged else 0)
    truth = dict(zip(np.rint(recording()["t"] * 1e6).to_list(), recording()["z"].to_list(), strict=True))
    assert kept.gyro_dps[:, 2].tolist() == [truth[t] for t in np.rint(kept.t_s * 1e6)], "a row has another row's values"


def test_a_table_that_is_damaged_throughout_is_refused_with_its_first_row(tmp_path: Path) -> None:
    path = lines(
        tmp_path, lambda rows: [rows[0], *(r.replace(",", ",oops", 1) if i % 10 == 3 else r for i, r in enumerate(rows[1:]))]
    )
    with pytest.raises(InputError, match=rf"{path}: row 5: x is 'oops.*; 120 of 1200 rows are so"):
        read(path)


def test_a_damaged_row_without_times_leaves_its_gap(tmp_path: Path) -> None:
    found = read(lines(tmp_path, ragged), MAPS[1:], scaling=Scaling(rate_hz=RATE_HZ))
    t_s = found.session.runs[0].t_s
    assert t_s[-1] == pytest.approx((N - 1) / RATE_HZ)
    assert np.count_nonzero(np.diff(t_s) > 1.5 / RATE_HZ) == 3


def test_a_cut_counts_the_rows_of_the_file_whether_damaged_or_not(tmp_path: Path) -> None:
    found = read(lines(tmp_path, ragged), cuts=[Cut.parse("a:150:250"), Cut.parse("b:199:202")])
    a, b = found.session.runs
    assert a.gyro_dps[0, 2] == recording()["z"][150]
    assert (len(a), len(b)) == (99, 2)


@pytest.mark.parametrize("kind", ["npz", "parquet"])
def test_whole_columns_are_not_copied(tmp_path: Path, kind: str) -> None:
    """NumPy's memory at its peak: the file's columns once, and no other array of their length."""
    columns = {"t": np.arange(300_000) / 200, **{a: np.random.default_rng(0).normal(size=300_000) for a in "xyz"}}
    path = tmp_path / f"log.{kind}"
    if kind == "npz":
        np.savez(path, **columns)  # type: ignore[arg-type]
    else:
        pl.DataFrame(columns).write_parquet(path)
    read(path)
    tracemalloc.start()
    try:
        read(path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    size = columns["t"].nbytes
    assert peak < (4.6 * size if kind == "npz" else 0.6 * size)


def test_quotes_semicolons_and_decimal_commas_at_once(tmp_path: Path) -> None:
    def german(rows: list[str]) -> list[str]:
        return [";".join(f'"{cell}"' for cell in row.replace(".", "|").split(",")).replace("|", ",") for row in rows]

    assert np.array_equal(read(lines(tmp_path, german)).session.runs[0].gyro_dps, recording()["x", "y", "z"].to_numpy())


def test_text_in_an_optional_column_is_missing_and_counted(tmp_path: Path) -> None:
    frame = recording().with_columns(c=pl.lit("21.5"))
    frame[5, "c"] = "ERR"
    frame.write_csv(tmp_path / "log.csv")
    found = read(tmp_path / "log.csv", [*MAPS, "temp_c=c"])
    assert found.repaired == {"cells": 1}
    assert found.session.runs[0].table["temp_c"].null_count() == 1


def oriented(tmp_path: Path, damaged: int) -> tuple[Path, list[str]]:
    """The recording with the table's orientation, ``damaged`` rows of which have another length; its file and options."""
    half = np.deg2rad(78 / 2) * np.arange(N) / RATE_HZ
    length = np.where(np.arange(N) % 20 == 5, 0.8, 1.0) if damaged > 1 else np.where(np.arange(N) == 5, 0.8, 1.0)
    length[20 * damaged :] = 1.0
    columns = {"qw": np.cos(half) * length, "qx": 0 * half, "qy": 0 * half, "qz": np.sin(half) * length}
    recording(scale=0.0).with_columns(**columns).write_csv(tmp_path / "log.csv")
    return tmp_path / "log.csv", [*MAPS, *(f"ref_q{part}=q{part}" for part in "wxyz")]


def test_damaged_orientations_are_missing_and_counted(tmp_path: Path) -> None:
    file, maps = oriented(tmp_path, damaged=3)
    found = read(file, maps, defaults={})
    assert found.repaired == {"orientations": 3}
    assert found.session.runs[0].table["ref_qw"].null_count() == 3
    (told,) = [w for w in found.warnings if w.code == "line_damaged"]
    assert "3 damaged orientations are left out (row 7: the quaternion has the length 0.8, not 1)" in told.text
    assert found.session.runs[0].rate_dps == pytest.approx(78.0)


def test_an_import_that_ends_with_an_error_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, maps = oriented(tmp_path, damaged=1)
    bad = pl.read_csv(file).with_columns(qw=pl.col("qw") * 0.97 + 0.05)
    bad.write_csv(file)
    options = [text for each in maps for text in ("--map", each)]
    assert main(["import", str(file), str(tmp_path / "out"), *options]) == 2
    assert "the quaternion has the length" in capsys.readouterr().err
    with pytest.raises(InputError, match="the quaternion has the length"):
        import_recording(file, tmp_path / "out", maps)
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


def test_the_shown_mapping_is_the_stated_one(tmp_path: Path) -> None:
    """With its factor and its zero: it is what is done, and what is typed again."""
    maps = ["t_s=t", "gx_dps=x:rad/s*-1", "gy_dps=(y - 3)*0.5", "gz_dps=z"]
    assert [row.map for row in read(lines(tmp_path), maps).first_rows] == maps


def test_repeated_times_are_repaired_and_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    frame = recording().with_columns(t=(pl.col("t") / 0.05).floor() * 0.05)
    frame.write_csv(tmp_path / "log.csv")
    maps = [word for m in MAPS for word in ("--map", m)]
    assert main(["import", str(tmp_path / "log.csv"), str(tmp_path / "out"), *maps, "--rate", "78", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["repaired"] == {"times": N}
    assert [w["code"] for w in told["warnings"]] == ["sample_rate"]
    assert abs(told["sample_rate_hz"] / RATE_HZ - 1) < 1e-3


def test_one_gyro_axis_alone_is_compared_and_calibrated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    up, down, out = tmp_path / "run_up_78dps.csv", tmp_path / "run_down_78dps.csv", str(tmp_path / "out")
    recording().select("t", "z").write_csv(up)
    recording(8).select("t", z=pl.col("z") - 2 * 1.004 * 78).write_csv(down)
    for path in (up, down):  # face and rate are in the names
        assert main(["import", str(path), out, "--map", "t_s=t", "--map", "gz_dps=z", "--append"]) == 0
    capsys.readouterr()
    assert main(["calibrate", out, "--method", "model", "--json"]) == 0
    (estimate,) = [e for e in json.loads(capsys.readouterr().out)["estimates"] if e["seconds"] == 6]
    assert estimate["scale"] == pytest.approx(0.004, abs=1e-3)
    assert estimate["bias_dps"] == pytest.approx(0.3, abs=0.05)
    for verb in ("compare", "diagnose"):
        assert main([verb, out, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["verdict"] == "adequate"


def test_the_only_axis_is_the_sessions(tmp_path: Path) -> None:
    recording().write_csv(tmp_path / "log.csv")
    assert read(tmp_path / "log.csv", ["t_s=t", "gx_dps=z"]).session.axis == "x"
    with pytest.raises(InputError, match="its axis is y, and nothing is mapped to gy_dps"):
        read(tmp_path / "log.csv", ["t_s=t", "gx_dps=z"], axis="y")


def test_unsigned_counts_have_a_zero_and_a_scale(tmp_path: Path) -> None:
    frame = recording()
    counts = frame.with_columns((pl.col("x", "y", "z") * 131 + 32768).round().cast(pl.UInt16))
    counts.write_csv(tmp_path / "log.csv")
    found = read(tmp_path / "log.csv", ["t_s=t", *(f"g{a}_dps=({a}-32768)/131" for a in "xyz")])
    assert np.allclose(found.session.runs[0].gyro_dps, frame["x", "y", "z"].to_numpy(), atol=0.5 / 131 + 1e-9)
    rad = read(tmp_path / "log.csv", ["t_s=t", "gz_dps=(z - 32768):rad/s/131"])
    assert np.allclose(rad.session.runs[0].gyro_dps[:, 2], np.degrees(found.session.runs[0].gyro_dps[:, 2]))


def swing(tmp_path: Path) -> tuple[Path, np.ndarray]:
    """30 deg to either side every 4 s, an encoder folded into a turn of 1024 counts; the true rate, deg/s."""
    frame = recording()
    t_s = frame["t"].to_numpy()
    angle_deg, rate_dps = 30 * np.sin(np.pi / 2 * t_s), 15 * np.pi * np.cos(np.pi / 2 * t_s)
    frame = frame.with_columns(
        z=pl.Series(rate_dps) + pl.col("x"), enc=pl.Series(np.rint(angle_deg / 360 * 1024) % 1024 / 1024)
    )
    frame.write_csv(tmp_path / "swing.csv")
    return tmp_path / "swing.csv", rate_dps


def test_an_angle_gives_the_rate(tmp_path: Path) -> None:
    path, rate_dps = swing(tmp_path)
    run = read(path, [*MAPS, "rate_ref_dps=enc:turn"], defaults={}).session.runs[0]
    assert np.std(run.rate_dps - rate_dps) < 0.1 * np.std(rate_dps)
    session = Session(RATE_HZ, (run,))
    scale = fit(session, Model.builtin("paper"), axes="z").model.value("scale", "z", "scale")
    assert scale == pytest.approx(0, abs=0.005)


def test_an_angle_stays_an_angle_that_is_not_folded(tmp_path: Path) -> None:
    path, _ = swing(tmp_path)
    angle_deg = read(path, [*MAPS, "ref_angle_deg=enc:turn"], defaults={}).session.runs[0].table["ref_angle_deg"].to_numpy()
    assert np.ptp(angle_deg) == pytest.approx(60, abs=1)


def test_runs_of_different_rates_are_averaged_to_the_slowest(tmp_path: Path) -> None:
    recording().write_csv(tmp_path / "a_down.csv")
    fast = recording()
    fast = pl.concat([fast, fast]).with_columns(t=np.arange(2 * N) / (2.5 * RATE_HZ))
    fast.write_csv(tmp_path / "b_up.csv")
    found = read(tmp_path)
    assert found.repaired == {"resampled": 2 * N}
    assert [r.face for r in found.session.runs] == ["down", "up"]
    assert [r.sample_rate_hz for r in found.session.runs] == [RATE_HZ, RATE_HZ]
    run = found.session.runs[1]
    assert run.gyro_dps.mean(axis=0) == pytest.approx(fast["x", "y", "z"].to_numpy().mean(axis=0), abs=1e-4)
    assert run.gyro_dps[:, 0].std() == pytest.approx(0.05 / 2.5**0.5, rel=0.1)
    found.save(tmp_path / "out")
    recording().with_columns(t=np.arange(N) / 40).write_csv(tmp_path / "slow.csv")
    with pytest.raises(InputError, match=r"40 Hz is slower than 100 Hz.*--resample-hz 40"):
        import_recording(tmp_path / "slow.csv", tmp_path / "out", MAPS, defaults=AT_78, append=True)


@pytest.mark.parametrize("rate_hz", [25.0, 40.0, 62.5, 97.0])
def test_averages_keep_the_integral(rate_hz: float) -> None:
    t_s = np.delete(np.arange(1000) / RATE_HZ, slice(400, 450))
    out = resampled({"t_s": t_s, "gz_dps": 3 * t_s, "table_angle_deg": 1.5 * t_s**2}, rate_hz)
    inside = (out["t_s"] < 3.9) | ((out["t_s"] > 4.6) & (out["t_s"] < 9.9))
    middle_s = out["t_s"] + 0.5 / rate_hz - 0.5 / RATE_HZ
    assert np.allclose(out["gz_dps"][inside], 3 * middle_s[inside], atol=0.02)
    assert np.allclose(out["table_angle_deg"][inside], 1.5 * middle_s[inside] ** 2, atol=0.01)
    assert not np.any((middle_s > 4.0 + 1 / rate_hz) & (middle_s < 4.5 - 1 / rate_hz)), "nothing was recorded there"


def test_runs_are_cut_by_time(tmp_path: Path) -> None:
    cuts = [Cut.parse("up:2s:5s:face=up"), Cut.parse("down:6s::face=down,rate=-78")]
    found = read(lines(tmp_path), cuts=cuts)
    assert [len(r) for r in found.session.runs] == [300, 600]
    assert [r.table_rate_dps for r in found.session.runs] == [78.0, -78.0]


@pytest.mark.parametrize(
    ("stem", "labels"),
    [
        ("s003_z_down_-78.5dps", {"scenario": "s003", "axis": "z", "face": "down", "table_rate_dps": "-78.5"}),
        ("face-up rate_30 day2", {"face": "up", "table_rate_dps": "30", "day": "2"}),
        ("imu_static_test", {"table_rate_dps": "0"}),
        ("x_p_y_p", {}),
        ("upside_resting_place", {}),
        ("log", {}),
    ],
)
def test_labels_from_a_files_name(stem: str, labels: dict[str, str]) -> None:
    assert labels_of(stem) == labels


def test_an_option_overrides_the_name(tmp_path: Path) -> None:
    path = lines(tmp_path, name="s002_down_30dps.csv")
    run = read(path, defaults={"face": "up", "turn_deg": 360.0}).session.runs[0]
    assert (run.face, run.table_rate_dps, run.turn_deg, run.scenario) == ("up", None, 360.0, "s002")


@pytest.mark.parametrize(("clock", "start"), [("same", 3.0), ("own", 5000.0)])
def test_a_reference_in_a_second_file(tmp_path: Path, clock: str, start: float) -> None:
    frame = recording().with_columns(t=pl.col("t") + 3.0)
    frame.write_csv(tmp_path / "imu.csv")
    u = np.arange(0, 11, 0.025)
    half = np.radians(40 * u) / 2
    reference = {
        "ms": 1e3 * (u + start),
        "w": np.cos(half),
        "x": 0 * u,
        "y": 0 * u,
        "z": np.sin(half),
        "rad": np.radians(40 * u) % 6.2832,
    }
    pl.DataFrame(reference).write_csv(tmp_path / "ref.csv")
    maps = ["t_s=ms:ms", *(f"ref_q{a}={a}" for a in "wxyz"), "ref_angle_deg=rad:rad"]
    found = read(tmp_path / "imu.csv", second=SecondFile(tmp_path / "ref.csv", maps, clock), defaults={})
    table = found.session.runs[0].table
    t_s = table["t_s"].to_numpy()
    inside = t_s < 10.97
    assert np.allclose(table["ref_angle_deg"].to_numpy()[inside], 40 * t_s[inside], atol=0.05)
    assert np.allclose(table["ref_qz"].to_numpy()[inside], np.sin(np.radians(20 * t_s[inside])), atol=1e-4)
    assert table["ref_qw"].is_null().to_numpy()[t_s > 11].all()
    header = found.save(tmp_path / "out").reference.model_dump(exclude_defaults=True)
    assert header == ({"clock": "own"} if clock == "own" else {})


@pytest.mark.parametrize(
    ("columns", "taken"),
    [
        (["Time", "transform.rotation.w", "transform.rotation.x", "transform.rotation.y", "transform.rotation.z"], "ref_qw"),
        (["timestamp [s]", "qw", "qx", "qy", "qz"], "ref_qw"),
        (["t", "w", "x", "y", "z"], "ref_qw"),
        (["t_ms", "w_x [rad/s]", "w_y [rad/s]", "w_z [rad/s]"], "ref_x_dps"),
        (["time", "encoder_deg"], "ref_angle_deg"),
        (["seconds", "table_rate_dps"], "rate_ref_dps"),
    ],
)
def test_the_columns_of_a_second_file_are_guessed(tmp_path: Path, columns: list[str], taken: str) -> None:
    recording().rename({a: f"g{a}" for a in "xyz"}).write_csv(tmp_path / "imu.csv")
    u = np.arange(0, 11, 0.02)
    half = np.radians(40 * u) / 2
    parts = {5: [np.cos(half), 0 * u, 0 * u, np.sin(half)], 4: [0 * u, 0 * u, np.full(u.size, np.radians(40))]}
    values = parts.get(len(columns), [40 * u if "deg" in columns[1] else 0 * u + 40])
    table = dict(zip(columns, [u * (1e3 if "ms" in columns[0] else 1), *values], strict=True))
    pl.DataFrame(table).write_csv(tmp_path / "ref.csv")
    found = read_recording(tmp_path / "imu.csv", Options(second=SecondFile(tmp_path / "ref.csv", ())))
    assert {g.map.partition("=")[0] for g in found.guessed if g.option == "--ref-map"} >= {"t_s", taken}
    assert np.nanmedian(np.abs(found.session.runs[0].about("z").rate_dps)) == pytest.approx(40, rel=0.02)


@pytest.mark.parametrize("own_start_s", [0.0, 7e8])
@pytest.mark.parametrize("early_s", [-8.25, 5.5, 0.4])
def test_a_reference_that_began_seconds_before_or_later_is_shifted(
    tmp_path: Path, early_s: float, own_start_s: float
) -> None:
    """Its clock is its own. Shifted by the user as the error advised, it was said to be as far off as before."""
    rng = np.random.default_rng(4)
    u = np.arange(0, 90, 0.02)
    f, p, a = rng.uniform(0.1, 1.0, (6, 3)), rng.uniform(0, 7, (6, 3)), rng.normal(0, 20, (6, 3))

    def rates(t_s: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        found = np.sum(a * np.sin(2 * np.pi * f * t_s[:, None, None] + p), axis=1)
        return {name: found[:, i] for i, name in enumerate(("wx", "wy", "wz"))}

    pl.DataFrame({"t_s": u} | rates(u)).write_csv(tmp_path / "imu.csv")
    pl.DataFrame({"t_s": u + own_start_s} | rates(u - early_s)).write_csv(tmp_path / "ref.csv")
    maps = ["t_s=t_s", *(f"ref_{a}_dps=w{a}" for a in "xyz")]
    second = SecondFile(tmp_path / "ref.csv", maps, "own")
    found = read_recording(tmp_path / "imu.csv", Options(["t_s=t_s", *(f"g{a}_dps=w{a}" for a in "xyz")], second=second))
    told = [float(w.text.split(": ")[1].split()[0]) for w in found.warnings if w.code == "reference_shifted"]
    assert told == pytest.approx([-early_s] * (abs(early_s) > 2), abs=0.03)
    left = registered(found.session).registration_fit
    assert left is not None
    assert abs(left.registration.offset_s + early_s + sum(told)) < 0.02


def test_clocks_that_do_not_overlap_are_told(tmp_path: Path) -> None:
    path = lines(tmp_path)
    recording().with_columns(t=pl.col("t") + 500).write_csv(tmp_path / "ref.csv")
    with pytest.raises(InputError, match=r"begins \+500 s from them.*--ref-clock own"):
        read(path, second=SecondFile(tmp_path / "ref.csv", ["t_s=t", "rate_ref_dps=z"]), defaults={})


@pytest.mark.parametrize(("per_s", "rate_hz", "told"), [(1.0, 100, 0), (1e3, 100, 0), (1e6, 100, 0), (1.0, 50, 1)])
def test_a_stated_rate_with_times_makes_a_session_that_calibrate_takes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], per_s: float, rate_hz: float, told: int
) -> None:
    """The stated rate tells the unit of the times; a rate that they contradict is told and not written."""
    out = str(tmp_path / "out")
    maps = [word for m in MAPS for word in ("--map", m)]
    for face, sign in (("up", 1), ("down", -1)):
        frame = recording().with_columns(t=pl.col("t") * per_s, z=pl.col("z") - (1 - sign) * 1.004 * 78)
        frame.write_csv(tmp_path / f"{face}.csv")
        options = ["--rate-hz", str(rate_hz), "--rate", "78", "--append", "--json"]
        assert main(["import", str(tmp_path / f"{face}.csv"), out, *maps, *options]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["sample_rate_hz"] == RATE_HZ
        assert [w["code"] for w in found["warnings"]] == ["sample_rate"] * told
    assert main(["calibrate", out, "--method", "baseline,model", "--json"]) == 0
    assert all(abs(e["scale"] - 0.004) < 1e-3 for e in json.loads(capsys.readouterr().out)["estimates"])


def test_a_reference_in_the_same_file_may_have_its_own_clock(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,z,w\n" + "".join(f"{k / 100},{k % 7},{k % 5}\n" for k in range(50)))
    for clock in ("same", "own"):
        words = ["--map", "t_s=t", "--map", "gz_dps=z", "--map", "rate_ref_dps=w", "--ref-clock", clock]
        assert main(["import", str(tmp_path / "a.csv"), str(tmp_path / clock), *words]) == 0
        assert Session.open(tmp_path / clock).reference.clock == clock


def test_import_writes_nothing_that_the_next_verb_complains_about(tmp_path: Path) -> None:
    """A log with dropouts has the rate between them, and a rest face down is known by its accelerometer.

    What is missing from the log itself is counted, once.
    """
    rng = np.random.default_rng(3)
    kept = np.ones(6000, dtype=bool)
    for start in range(200, 5800, 400):
        kept[start : start + rng.integers(30, 80)] = False
    t_s = (np.arange(6000) / 250.0)[kept] + rng.normal(0, 2e-5, int(kept.sum()))
    gyro, noise_g = rng.normal([0.3, -0.2, 0.1], 0.05, (t_s.size, 3)), rng.normal(0, 0.003, (t_s.size, 3))
    columns = {f"g{a}_dps": gyro[:, i] for i, a in enumerate("xyz")}
    columns |= {f"a{a}_g": noise_g[:, i] - (a == "z") for i, a in enumerate("xyz")}
    pl.DataFrame({"t_s": t_s, **columns}).write_csv(tmp_path / "log.csv")
    told: list[Warning] = []
    found = import_recording(tmp_path / "log.csv", tmp_path / "out", defaults={"table_rate_dps": 0.0}, warn=told.append)
    assert kept.mean() < 0.9
    assert found.sample_rate_hz == pytest.approx(250, rel=1e-3)
    assert [(r.file, r.face) for r in found.runs] == [("000_down.csv", "down")]
    (lost,) = [*told, *check(found)]
    assert lost.code == "samples_lost"
    assert f"{6000 - kept.sum()} of 6000" in lost.text


def test_a_stated_face_is_not_guessed(tmp_path: Path) -> None:
    """The accelerometer may be mounted the other way; the check tells the contradiction."""
    t_s = np.arange(1000) / 100.0
    noise = np.random.default_rng(4).normal(0, 0.01, (1000, 6))
    columns = {f"g{a}_dps": noise[:, i] for i, a in enumerate("xyz")}
    columns |= {f"a{a}_g": noise[:, 3 + i] - (a == "z") for i, a in enumerate("xyz")}
    pl.DataFrame({"t_s": t_s, **columns}).write_csv(tmp_path / "log.csv")
    defaults = {"table_rate_dps": 0.0, "face": "up"}
    found = import_recording(tmp_path / "log.csv", tmp_path / "out", defaults=defaults)
    assert [w.code for w in check(found)] == ["face_wrong"]


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("off_s", [-9.0, 90.0])
def test_damaged_times_are_put_onto_the_course_that_goes_on_after_them(count: int, off_s: float, tmp_path: Path) -> None:
    """A digit was lost on the way, and the rest was refused as another recording."""
    table = recording()
    t_s = table["t"].to_numpy() + np.random.default_rng(1).uniform(0, 0.003, N)
    written = t_s.copy()
    written[1000 : 1000 + count] += off_s
    table.with_columns(t=written).write_csv(tmp_path / "log.csv")
    found = read(tmp_path / "log.csv")
    assert found.repaired == {"stamps": count}
    assert [w.code for w in found.warnings] == ["line_damaged"]
    assert f"row 1002: the time is {off_s:+.0f}" in found.warnings[0].text
    np.testing.assert_allclose(found.session.runs[0].t_s, t_s - t_s[0], atol=0.004)
    np.testing.assert_allclose(np.delete(found.session.runs[0].t_s - t_s + t_s[0], np.s_[1000 : 1000 + count]), 0, atol=1e-6)


def test_a_time_that_stays_back_is_of_another_recording(tmp_path: Path) -> None:
    table = recording()
    written = table["t"].to_numpy().copy()
    written[1000:] -= 9.0
    table.with_columns(t=written).write_csv(tmp_path / "log.csv")
    with pytest.raises(InputError, match=r"row 1002: time goes back by 8\.99 s, to another recording"):
        read(tmp_path / "log.csv")


def test_a_second_file_is_put_onto_the_repaired_times_of_the_samples(tmp_path: Path) -> None:
    """Stamps of whole seconds are replaced: at the stamps themselves the reference stood still within each second."""
    u = np.arange(0, 60, 0.05)
    angle_deg = 80 * np.sin(0.9 * u)
    rate_dps = 72 * np.cos(0.9 * u)
    noise = np.random.default_rng(5).normal(0, 0.1, (u.size, 2))
    sensor = {"t": np.floor(u + 0.01), "x": noise[:, 0], "y": noise[:, 1], "z": rate_dps}
    pl.DataFrame(sensor).write_csv(tmp_path / "imu.csv")
    pl.DataFrame({"t": u[::2], "deg": angle_deg[::2]}).write_csv(tmp_path / "ref.csv")
    second = SecondFile(tmp_path / "ref.csv", ["t_s=t", "ref_angle_deg=deg"])
    found = read_recording(tmp_path / "imu.csv", Options(MAPS, second=second))
    table = found.session.runs[0].table
    t_s, angle = table["t_s"].to_numpy(), table["ref_angle_deg"].to_numpy()
    known = np.isfinite(angle)
    assert "sample_rate" in {w.code for w in found.warnings}
    assert np.mean(known) > 0.9
    assert np.allclose(angle[known], 80 * np.sin(0.9 * t_s[known]), atol=0.5)


@pytest.mark.parametrize("stated", ["above", "option"])
def test_a_second_file_without_a_time_has_the_rate_that_is_stated(stated: str, tmp_path: Path) -> None:
    """Its own lines say it, or the option; a file of the sensor with as little was taken."""
    u = np.arange(0, 60, 0.05)
    ref_hz = 10.0 if stated == "above" else 20.0
    angle_deg = 80 * np.sin(0.9 * np.arange(0, 60, 1 / ref_hz))
    noise = np.random.default_rng(5).normal(0, 0.1, (u.size, 2))
    pl.DataFrame({"x": noise[:, 0], "y": noise[:, 1], "z": 72 * np.cos(0.9 * u)}).write_csv(tmp_path / "imu.csv")
    above = "# sampling rate: 10 Hz\n" if stated == "above" else ""
    (tmp_path / "ref.csv").write_text(above + pl.DataFrame({"angle_deg": angle_deg, "load": 0.0 * angle_deg}).write_csv())
    rates = [m for m in MAPS if not m.startswith("t_s")]
    for maps in ((), ["ref_angle_deg=angle_deg"]):
        options = Options.of(rates, {"rate_hz": 20.0, "second": SecondFile(tmp_path / "ref.csv", maps)})
        table = read_recording(tmp_path / "imu.csv", options).session.runs[0].table
        t_s, angle = table["t_s"].to_numpy(), table["ref_angle_deg"].to_numpy()
        known = np.isfinite(angle)
        assert np.mean(known) > 0.9
        assert np.allclose(angle[known], 80 * np.sin(0.9 * t_s[known]), atol=0.5)
