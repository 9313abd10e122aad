"""Sessions: what is written is read back; what is wrong is named in one line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gyrocal.errors import InputError
from gyrocal.recording.session import Run, Session
from gyrocal.recording.table import read_table, write_table
from gyrocal.simulation.simulate import simulate
from make_runs import make_run


def small_run(t_s: np.ndarray | None = None, gx_dps: np.ndarray | float = 0.0, **columns: np.ndarray) -> Run:
    """Fifty samples at 100 Hz, or those at ``t_s``; day 1, power on for 3 s."""
    gyro_dps = np.column_stack(np.broadcast_arrays(gx_dps, 0.0, np.full(50, 78.25)))
    return make_run(np.arange(50) / 100 if t_s is None else t_s, gyro_dps, day=1, power_on_s=3.0, rate_hz=100.0, **columns)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    temp = np.array([np.nan, *[25.0 + 0.01 * i for i in range(49)]])
    return Session(100.0, (small_run(temp_c=temp),), sensor="LSM6DSO").save(tmp_path / "s").path  # type: ignore[return-value]


def edit(folder: Path, row: int, text: str) -> None:
    """Replace a row of the run's file; the header is row 1."""
    path = folder / "000_up.csv"
    lines = path.read_text().splitlines()
    lines[row - 1] = text
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize("parquet", [False, True])
def test_what_is_written_is_read_back(tmp_path: Path, parquet: bool) -> None:
    rng = np.random.default_rng(0)
    run = small_run(gx_dps=rng.normal(size=50), temp_c=np.array([np.nan, *rng.normal(25, 1, 49)]))
    saved = Session(100.0, (run,), "z", "part", 250.0, 0.00875, 32.8).save(tmp_path / "s", parquet=parquet)
    again = Session.open(saved.path or "")
    assert (again.sensor, again.full_scale_dps, again.lsb_dps, again.latitude_deg) == ("part", 250.0, 0.00875, 32.8)
    got, want = again.runs[0], run
    assert (got.scenario, got.face, got.axis, got.table_rate_dps, got.day, got.power_on_s) == (
        "s000",
        "up",
        "z",
        78.0,
        1,
        3.0,
    )
    np.testing.assert_allclose(got.gyro_dps, want.gyro_dps, atol=1e-9)
    assert np.isnan(got.temp_c[0])
    np.testing.assert_allclose(got.temp_c[1:], want.temp_c[1:], atol=1e-9)


def test_the_face_signs_the_rate(tmp_path: Path) -> None:
    run = small_run()
    down = replace(run, face="down")
    assert run.rate_dps[0] == 78.0
    assert down.rate_dps[0] == -78.0


@pytest.mark.parametrize(
    ("row", "text", "says"),
    [
        (7, "0.05,0,0", "row 7: 3 cells"),
        (7, "0.05,0,0,78,25,1", "row 7: 6 cells"),
        (7, "0.05,0,0,x,25", "row 7: 'x' is not a number"),
        (7, "0.05,0,0,nan,25", "row 7: gz_dps is nan"),
        (7, "0.05,0,0,,25", "row 7: gz_dps is empty"),
        (7, "0.05,0,0,78,inf", "row 7: temp_c is inf"),
        (7, "0.04,0,0,78,25", "row 7: t_s repeats"),
        (7, "0.03,0,0,78,25", "row 7: t_s goes back"),
        (7, "", "row 7: empty row"),
        (7, "0.05,0,0,78,\u0661", "row 7: '\u0661' is not a number"),
        (7, "0.05,0,0,78,1_0", "row 7: '1_0' is not a number"),
        (7, "0.05,0,0,78,25\x0b", "row 7: '25' is not a number"),
        (1, "t_s,gx_dps,gy_dps,gz_rad,temp_c", "row 1: the header lacks gz_dps"),
        (1, "t_s,gx_dps,gy_dps,gz_dps,temp_f", "row 1: temp_f would not be read; what is read is temp_c, in °C"),
        (1, "t_s,gx_dps,gy_dps,gz_dps,ax_mps2", "row 1: ax_mps2 would not be read; what is read is ax_g, in g"),
        (1, "t_s,gx_dps,gy_dps,gz_dps,rate_ref", "row 1: rate_ref would not be read; what is read is rate_ref_dps"),
        (1, "t_s,gx_dps,gy_dps,gz_dps,gz_dps", "row 1: column 'gz_dps' stands twice"),
    ],
)
def test_a_bad_row_is_named(folder: Path, row: int, text: str, says: str) -> None:
    edit(folder, row, text)
    with pytest.raises(InputError) as caught:
        Session.open(folder)
    assert "000_up.csv" in str(caught.value)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_empty_file_is_called_empty(folder: Path) -> None:
    for content in ("", "\n"):
        (folder / "000_up.csv").write_text(content)
        with pytest.raises(InputError, match=r"000_up\.csv: the file is empty"):
            Session.open(folder)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("gyrocal-session/1", "gyrocal-session/2", "format"),
        ('face = "up"', 'face = "left"', "face"),
        ("sample_rate_hz = 100.0", "sample_rate_hz = -1.0", "sample_rate_hz"),
        ("sample_rate_hz = 100.0", "sample_rate_hz = nan", "sample_rate_hz"),
        ("table_rate_dps = 78.0", 'table_rate_dps = "78.0"', "table_rate_dps = .* number"),
        ("table_rate_dps = 78.0", "table_rate_dps = true", "table_rate_dps = .* number"),
        ("day = 1", "day = 1.5", "day = .* whole number"),
        ("table_rate_dps = 78.0", "", "no true rate"),
        ('file = "000_up.csv"', 'file = "gone.csv"', "no such file"),
        ("[[run]]", "[[run", "session.toml"),
    ],
)
def test_a_bad_header_is_named(folder: Path, old: str, new: str, says: str) -> None:
    path = folder / "session.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=says) as caught:
        Session.open(folder)
    assert "\n" not in str(caught.value)


def test_a_whole_number_is_a_rate_too(folder: Path) -> None:
    path = folder / "session.toml"
    path.write_text(path.read_text().replace("table_rate_dps = 78.0", "table_rate_dps = 78"))
    assert Session.open(folder).runs[0].rate_dps[0] == 78.0


def test_a_table_that_is_not_utf_8_is_named_with_its_row(folder: Path) -> None:
    path = folder / "000_up.csv"
    lines = path.read_bytes().splitlines()
    for row, text, says in (
        (0, "t_s,gx_dps,gy_dps,gz_dps,\u00b0C".encode("latin-1"), "row 1: not text in UTF-8"),
        (6, b"0.05,0,0,78,\xff25", "row 7: .* is not a number"),
    ):
        path.write_bytes(b"\n".join([*lines[:row], text, *lines[row + 1 :]]))
        with pytest.raises(InputError, match=says):
            Session.open(folder)


def test_columns_of_other_names_may_be_there(folder: Path) -> None:
    edit(folder, 1, "t_s,gx_dps,gy_dps,gz_dps,humidity")
    assert Session.open(folder).runs[0].temp_c is None


def test_saving_over_a_folder_is_refused_and_leaves_nothing(folder: Path) -> None:
    session = Session.open(folder)
    with pytest.raises(InputError, match="exists already"):
        session.save(folder)
    assert sorted(p.name for p in folder.parent.iterdir()) == ["s"]


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=400))
def test_no_bytes_crash_the_reader(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.mktemp("r") / "run.csv"
    path.write_bytes(b"t_s,gx_dps,gy_dps,gz_dps\n0,1,2,3\n" + content)
    try:
        table = read_table(path)
    except InputError as error:
        table, message = None, str(error)
    if table is None:
        assert "\n" not in message
    else:
        assert np.all(np.diff(table["t_s"].to_numpy()) > 0)


def test_first_seconds_are_counted_in_whole_microseconds() -> None:
    run = small_run(t_s=np.round(np.arange(50) / 145, 6))
    assert len(run.first(0.2)) == 29  # 0.2 s at 145 Hz: samples 0..28, the 29th at exactly 0.2
    assert run.first(0.4) is None  # 50 samples last 0.345 s
    assert len(run.first(0.345)) == 50  # complete: the last sample and one and a half periods reach it


def test_a_slower_encoder_leaves_cells_empty(tmp_path: Path) -> None:
    """The rate between two that are known lies on their line; before the first and after the last it is theirs."""
    session, _ = simulate(tmp_path / "s", "swing", [], 1, scenarios=1, seconds=5)
    run = session.runs[0]
    frame = run.table
    rate = frame["rate_ref_dps"].to_numpy()
    seldom = pl.Series("rate_ref_dps", [float(r) if i % 4 == 2 else None for i, r in enumerate(rate)], dtype=pl.Float64)
    write_table(frame.with_columns(seldom), tmp_path / "s" / run.file)
    again = Session.open(tmp_path / "s").runs[0].rate_dps
    np.testing.assert_array_equal(again[2::4], rate[2::4])
    np.testing.assert_allclose(again[4:-4], rate[4:-4], atol=0.05)
    assert (again[:2] == rate[2]).all()


@given(st.lists(st.lists(st.floats(-1e5, 1e5), min_size=3, max_size=3), min_size=2, max_size=20))
@settings(max_examples=25, deadline=None)
def test_a_small_table_reads_as_a_large_one(tmp_path_factory: pytest.TempPathFactory, rates: list[list[float]]) -> None:
    path = tmp_path_factory.mktemp("table") / "run.csv"
    lines = [f"{0.01 * i:.6f},{','.join(map(repr, row))}," for i, row in enumerate(rates)]
    lines = [f"{line}{'' if i == 1 and len(rates) > 2 else 25 + i}" for i, line in enumerate(lines)]
    path.write_text("t_s,gx_dps,gy_dps,gz_dps,temp_c\n" + "\n".join(lines) + "\n", encoding="utf-8")
    small = read_table(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gyrocal.recording.table.SMALL_BYTES", 0)
        assert small.equals(read_table(path))


def test_each_run_knows_what_was_recorded_before_it_in_its_power_cycle(tmp_path: Path) -> None:
    made = simulate(None, "paper", [], 1, scenarios=2, seconds=4)[0]
    made.with_runs(replace(run, scenario=name) for run, name in zip(made.runs, "aaba", strict=True)).save(tmp_path / "s")
    opened = Session.open(tmp_path / "s").runs
    assert [round(run.earlier_s) for run in opened] == [0, 4, 0, 8]
    assert opened[1].part(145, 300).earlier_s == pytest.approx(opened[1].earlier_s + opened[1].t_s[145] - opened[1].t_s[0])
