"""Columns, units, cuts and refusals of the importer, against closed forms."""

import gzip
import json
import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from gyrocal.cli import main
from gyrocal.errors import InputError
from gyrocal.recording.column_map import ColumnMap, Scaling
from gyrocal.recording.cut import Cut
from gyrocal.recording.importer import import_recording
from gyrocal.recording.session import Session
from gyrocal.warning import Warning

PLAIN = ["gx_dps=x", "gy_dps=y", "gz_dps=z"]
REST = {"table_rate_dps": 0.0}


def write(path: Path, header: str, rows: np.ndarray, separator: str = ",", above: str = "") -> Path:
    lines = [separator.join(repr(float(v)) for v in row) for row in rows]
    path.write_text(above + (header.replace(",", separator) + "\n" if header else "") + "\n".join(lines) + "\n")
    return path


@pytest.fixture
def rows() -> np.ndarray:
    """t in s, x, y, z."""
    rng = np.random.default_rng(4)
    return np.column_stack([np.arange(50) / 128.0, rng.normal(0, 3, (50, 3))])


@pytest.mark.parametrize(
    ("mapping", "value", "expected"),
    [
        ("gx_dps=c:dps", 2.0, 2.0),
        ("gx_dps=c:rad/s", np.pi, 180.0),
        ("gx_dps=c:mdps", 1500.0, 1.5),
        ("gx_dps=c:counts", 100, 0.875),
        ("gx_dps=c*-2", 3.0, -6.0),
        ("gx_dps=c/131", 131.0, 1.0),
        ("gx_dps=c:rad/s*-1", np.pi, -180.0),
        ("gx_dps=c:mdps/2", 1000.0, 0.5),
        ("ax_g=c:m/s2", 9.80665, 1.0),
        ("ax_g=c:m/s^2", -9.80665, -1.0),
        ("ax_g=c:mg", 500.0, 0.5),
        ("ax_g=c:counts", 16384, 16384 * 6.1e-5),
        ("temp_c=c:K", 298.15, 25.0),
        ("temp_c=c:degF", 212.0, 100.0),
        ("temp_c=c", 21.5, 21.5),
        ("table_angle_deg=c:turn", 0.5, 180.0),
        ("table_angle_deg=c:rad", np.pi, 180.0),
        ("rate_ref_dps=c:deg/s", 78.0, 78.0),
    ],
)
def test_units(mapping: str, value: float, expected: float) -> None:
    m = ColumnMap.parse(mapping, Scaling(lsb_dps=0.00875, lsb_g=6.1e-5))
    assert m.column == "c"
    assert m.factor * value + m.offset == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("unit", "per_s"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9), ("samples", 128.0)])
def test_time_starts_at_zero_in_seconds(rows: np.ndarray, tmp_path: Path, unit: str, per_s: float) -> None:
    content = rows * [per_s, 1, 1, 1] + [17 * per_s, 0, 0, 0]
    source = write(tmp_path / "a.csv", "t,x,y,z", content)
    session = import_recording(
        source, tmp_path / "out", [f"t_s=t:{unit}", *PLAIN], scaling=Scaling(rate_hz=128.0), defaults=REST
    )
    assert np.allclose(session.runs[0].t_s, rows[:, 0], atol=1e-6)
    assert np.allclose(session.runs[0].gyro_dps, rows[:, 1:], atol=1e-8)
    assert session.sample_rate_hz == 128.0


@pytest.mark.parametrize(("separator", "suffix"), [(",", "csv"), ("\t", "tsv"), (";", "csv"), (" ", "txt")])
@pytest.mark.parametrize("above", ["", "Fs,100\nLogging Type,1\n", "# made by hand\n\n"])
def test_separators_and_lines_above_are_found(
    rows: np.ndarray, tmp_path: Path, separator: str, suffix: str, above: str
) -> None:
    source = write(tmp_path / f"a.{suffix}", "t,x,y,z", rows, separator, above)
    session = import_recording(source, tmp_path / "out", ["t_s=t", *PLAIN], defaults=REST)
    assert np.allclose(session.runs[0].gyro_dps, rows[:, 1:], atol=1e-8)


def test_other_dresses_of_the_same_table(rows: np.ndarray, tmp_path: Path) -> None:
    plain = write(tmp_path / "plain.csv", "t,x,y,z", rows)
    text = plain.read_text()
    (tmp_path / "crlf.csv").write_text("\ufeff" + text.replace("\n", "\r\n"), newline="")
    (tmp_path / "quoted.csv").write_text(text.replace("t,x,y,z", '"t", "x", "y", "z"'))
    (tmp_path / "packed.csv.gz").write_bytes(gzip.compress(text.encode()))
    (tmp_path / "comma.csv").write_text(text.replace(",", ";").replace(".", ","))
    pl.DataFrame(rows, schema=["t", "x", "y", "z"]).write_parquet(tmp_path / "table.parquet")
    expected = import_recording(plain, tmp_path / "expected", ["t_s=t", *PLAIN], defaults=REST).runs[0].table
    for i, name in enumerate(("crlf.csv", "quoted.csv", "packed.csv.gz", "comma.csv", "table.parquet")):
        session = import_recording(tmp_path / name, tmp_path / f"out{i}", ["t_s=t", *PLAIN], defaults=REST)
        assert session.runs[0].table.equals(expected), name


def test_a_table_without_header_or_time(rows: np.ndarray, tmp_path: Path) -> None:
    source = write(tmp_path / "a.csv", "", rows, above="measured in the cellar\n")
    for i, options in enumerate(({}, {"skip": 1})):
        session = import_recording(
            source, tmp_path / f"out{i}", PLAIN, columns=["t", "x", "y", "z"], scaling=Scaling(rate_hz=50.0),
            defaults=REST, **options,
        )  # fmt: skip
        assert np.allclose(session.runs[0].t_s, np.arange(50) * 0.02)
        assert np.allclose(session.runs[0].gyro_dps, rows[:, 1:], atol=1e-8)


def test_a_sessions_own_names_need_no_map(rows: np.ndarray, tmp_path: Path) -> None:
    source = write(tmp_path / "a.csv", "t_s,gx_dps,gy_dps,gz_dps,temp_c", np.column_stack([rows, rows[:, 1]]))
    run = import_recording(source, tmp_path / "out", defaults=REST).runs[0]
    assert run.temp_c is not None
    assert np.allclose(run.temp_c, rows[:, 1], atol=1e-8)


def test_nanoseconds_since_1970_lose_nothing(tmp_path: Path) -> None:
    ns = 1_403_636_579_758_555_392 + 5_000_000 * np.arange(20)
    header = "#timestamp [ns]," + ",".join(f"w_RS_S_{a} [rad s^-1]" for a in "xyz")
    header += "," + ",".join(f"a_RS_S_{a} [m s^-2]" for a in "xyz")
    lines = [f"{t},{0.1 * i},0,{-np.pi},9.80665,0,0" for i, t in enumerate(ns)]
    folder = tmp_path / "mav0" / "imu0"
    folder.mkdir(parents=True)
    (folder / "data.csv").write_text("\n".join([header, *lines]) + "\n")
    for i, source in enumerate((folder, folder / "data.csv", tmp_path / "mav0")):
        run = import_recording(source, tmp_path / f"out{i}", form="euroc", defaults=REST).runs[0]
        assert np.array_equal(run.t_us, 5000 * np.arange(20))
        assert np.allclose(run.gyro_dps[:, 2], -180.0)
        assert np.allclose(run.gyro_dps[:, 0], np.degrees(0.1) * np.arange(20), atol=1e-8)
        assert run.acc_g is not None
        assert np.allclose(run.acc_g, [1, 0, 0])


def test_the_rows_that_an_error_advises_to_take_are_those_before_the_times_go_back(tmp_path: Path) -> None:
    """Repeated stamps, which are repaired, come before the row at which another recording begins."""
    t_s = np.concatenate([np.repeat(np.arange(100), 2) / 50, np.arange(40) / 100 - 8.0])
    rows = [f"{t:.2f},1,2,{i % 7}" for i, t in enumerate(t_s)]
    source = tmp_path / "a.csv"
    source.write_text("t,x,y,z\n" + "\n".join(rows) + "\n")
    with pytest.raises(InputError, match=r"row 202: time goes back by 9\.98 s") as error:
        import_recording(source, tmp_path / "out", ["t_s=t", *PLAIN], defaults=REST)
    cuts = [Cut.parse(cut) for cut in re.findall(r"--run ([^\s)]+)", str(error.value))]
    runs = import_recording(source, tmp_path / "out", ["t_s=t", *PLAIN], defaults=REST, cuts=cuts).runs
    assert [len(run) for run in runs] == [200, 40]


@pytest.mark.parametrize("header", [False, True])
@pytest.mark.parametrize(("rows", "start_s"), [(200, 0.003), (400, 0.0), (150, 2.1)])
def test_a_recording_that_began_again_is_cut_there(rows: int, start_s: float, header: bool, tmp_path: Path) -> None:
    """Three recordings of less than 5 s behind each other, as a logger that was switched off and on appends them."""
    source = tmp_path / "a.csv"
    sizes = [rows, rows + 37, rows + 5]
    parts = ["\n".join(f"{start_s + i / 100:.3f},1,2,{i % 7}" for i in range(size)) for size in sizes]
    source.write_text("t,x,y,z\n" + ("\nt,x,y,z\n" if header else "\n").join(parts) + "\n")
    row = rows + 2 + header
    with pytest.raises(InputError, match=rf"row {row}: time goes back by .* s, to another recording") as error:
        import_recording(source, tmp_path / "out", ["t_s=t:s", *PLAIN], defaults=REST)
    cuts = [Cut.parse(cut) for cut in re.findall(r"--run ([^\s)]+)", str(error.value))]
    told: list[Warning] = []
    found = import_recording(source, tmp_path / "out", ["t_s=t:s", *PLAIN], defaults=REST, cuts=cuts, warn=told.append)
    assert [len(run) for run in found.runs] == sizes
    assert [run.t_s[-1] for run in found.runs] == pytest.approx([(size - 1) / 100 for size in sizes], abs=1e-4)
    assert [w.code for w in told] == (["line_damaged"] if header else [])


@pytest.mark.parametrize("header", [False, True])
def test_a_clock_of_few_digits_and_a_header_in_passing_are_no_restart(header: bool, tmp_path: Path) -> None:
    """Milliseconds of a second begin again at each second; a header stands within times that go on."""
    source = tmp_path / "a.csv"
    parts = [[f"{(10 * i) % (10**9 if header else 1000)},1,2,{i % 7}" for i in part] for part in (range(250), range(250, 500))]
    source.write_text("t,x,y,z\n" + ("\nt,x,y,z\n" if header else "\n").join("\n".join(part) for part in parts) + "\n")
    run = import_recording(source, tmp_path / "out", ["t_s=t:ms", *PLAIN], defaults=REST).runs[0]
    assert run.t_s[-1] == pytest.approx(4.99, abs=1e-3)


def test_a_folder_of_euroc_is_named_where_its_format_is_not_stated(tmp_path: Path) -> None:
    (tmp_path / "mav0" / "imu0").mkdir(parents=True)
    (tmp_path / "mav0" / "imu0" / "data.csv").write_text("#timestamp [ns],w_RS_S_x [rad s^-1]\n1,2\n")
    with pytest.raises(InputError, match="give --format euroc"):
        import_recording(tmp_path / "mav0", tmp_path / "out", defaults=REST)


def test_dates_in_parquet_are_nanoseconds(rows: np.ndarray, tmp_path: Path) -> None:
    frame = pl.DataFrame(rows, schema=["t", "x", "y", "z"])
    times = pl.from_epoch((frame["t"] * 1e6).cast(pl.Int64), time_unit="us").alias("t")
    frame.with_columns(times).write_parquet(tmp_path / "a.parquet")
    run = import_recording(tmp_path / "a.parquet", tmp_path / "out", ["t_s=t:ns", *PLAIN], defaults=REST).runs[0]
    assert np.allclose(run.t_s, rows[:, 0], atol=1e-6)


def test_runs_are_cut_by_rows_and_by_seconds(rows: np.ndarray, tmp_path: Path) -> None:
    source = write(tmp_path / "a.csv", "t,x,y,z", rows)
    cuts = [Cut.parse("first::10"), Cut.parse("later:0.15625s:0.3125s:face=down,rate=-30"), Cut.parse("last:45:")]
    session = import_recording(source, tmp_path / "out", ["t_s=t", *PLAIN], cuts=cuts, defaults=REST)
    assert [r.file for r in session.runs] == ["first.csv", "later.csv", "last.csv"]
    for run, part in zip(session.runs, (slice(0, 10), slice(20, 40), slice(45, 50)), strict=True):
        assert np.allclose(run.gyro_dps, rows[part, 1:], atol=1e-8)
        assert run.t_s[0] == 0.0
    assert [(r.face, r.table_rate_dps) for r in session.runs] == [("up", 0.0), ("down", -30.0), ("up", 0.0)]


def test_facts_come_by_pattern_and_an_angle_takes_the_place_of_a_rate(rows: np.ndarray, tmp_path: Path) -> None:
    source = write(tmp_path / "a.csv", "t,x,y,z", rows)
    cuts = [Cut.parse(f"{name}::") for name in ("x_p", "x_a", "x_rot", "y_rot")]
    rules = ["x_*:axis=x", "*_a:face=down", "*_rot:turn=360", "y_rot:rate=5,scenario=s001,day=3,power_on_s=2.5"]
    session = import_recording(source, tmp_path / "out", ["t_s=t", *PLAIN], cuts=cuts, run_meta=rules, defaults=REST)
    facts = [(r.axis, r.face, r.table_rate_dps, r.turn_deg, r.scenario, r.day, r.power_on_s) for r in session.runs]
    assert facts == [
        ("x", "up", 0.0, None, "s000", None, None),
        ("x", "down", 0.0, None, "s000", None, None),
        ("x", "up", None, 360.0, "s000", None, None),
        ("y", "up", 5.0, None, "s001", 3, 2.5),
    ]


def test_a_pattern_means_runs_of_all_files_of_a_folder(
    rows: np.ndarray, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each pattern fits some of the files; files of which nothing says otherwise are of one power cycle, which is told."""
    folder = tmp_path / "logs"
    folder.mkdir()
    for name in ("a_up", "a_down", "b_up", "b_down"):
        write(folder / f"{name}.csv", "t_s,gx_dps,gy_dps,gz_dps", rows)
    rules = ["--run-meta", "a_*:scenario=first,day=1", "--run-meta", "b_*:scenario=second,day=2"]
    assert main(["import", str(folder), str(tmp_path / "two"), "--rate", "0", *rules]) == 0
    assert "4 runs, 200 samples at 128 Hz, 2 power cycles" in capsys.readouterr().out
    runs = {run.file: run for run in Session.open(tmp_path / "two").runs}
    assert {name: (run.scenario, run.day, run.face) for name, run in runs.items()} == {
        "a_up.csv": ("first", 1, "up"), "a_down.csv": ("first", 1, "down"),
        "b_up.csv": ("second", 2, "up"), "b_down.csv": ("second", 2, "down"),
    }  # fmt: skip
    assert main(["import", str(folder), str(tmp_path / "one"), "--rate", "0"]) == 0
    assert "The 4 files are taken for one power cycle." in capsys.readouterr().out
    assert main(["import", str(folder), str(tmp_path / "no"), "--rate", "0", "--run-meta", "c_*:day=1"]) == 2
    assert "no run is named so; there are a_down, a_up, b_down, b_up" in capsys.readouterr().err


def test_files_are_added_to_a_session(rows: np.ndarray, tmp_path: Path) -> None:
    source, out = write(tmp_path / "a.csv", "t,x,y,z", rows), tmp_path / "out"
    for face in ("up", "down"):
        import_recording(source, out, ["t_s=t", *PLAIN], defaults={"face": face, "table_rate_dps": 78.0}, append=True)
    assert [(r.file, r.face) for r in Session.open(out).runs] == [("000_up.csv", "up"), ("001_down.csv", "down")]
    before = {p.name: p.read_bytes() for p in out.iterdir()}
    slower = write(tmp_path / "b.csv", "t,x,y,z", rows * [2, 1, 1, 1])
    with pytest.raises(InputError, match="one session holds one rate"):
        import_recording(slower, out, ["t_s=t", *PLAIN], defaults=REST, append=True)
    with pytest.raises(InputError, match="exists already"):
        import_recording(source, out, ["t_s=t", *PLAIN], defaults=REST)
    assert {p.name: p.read_bytes() for p in out.iterdir()} == before


def test_an_empty_cell_is_missing_where_a_session_allows_it(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,x,y,z,c\n0,1,2,3,20\n1,1,2,3,\n2,1,2,3,NaN\n")
    maps = ["t_s=t", *PLAIN, "temp_c=c"]
    run = import_recording(tmp_path / "a.csv", tmp_path / "out", maps, defaults=REST).runs[0]
    assert run.table["temp_c"].to_list() == [20.0, None, None]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("t,x,y,z\n0,1,2,3\n1,1,2\n", "row 3: 3 cells, and the table has 4 in a row; 1 of 2 rows are so. Correct"),
        ("t,x,y,z\n0,1,2,3\n1,1,2,3,4\n2,1,2,3\n", "row 3: 5 cells, and the table has 4 in a row; 1 of 3 rows are so"),
        ("t,x,y,z\n0,1,2,3\n1,1,oops,3\n", "row 3: y is 'oops'"),
        ("t,x,y,z\n0,1,2,3\n1,1,nan,3\n", "row 3: y is 'nan'"),
        ("k,v\nt,x,y,z\n0,1,2,3\n1,1,,3\n", "row 4: y is empty"),
        ("t,x,y,z\n0,1,2,3\n0,1,2,3\n", "row 3: time repeats"),
        ("t,x,y,z\n1,1,2,3\n0.5,1,2,3\n", "row 3: time repeats or goes back"),
        ("t,x,y,z\n0,1,2,3\n", "must hold two samples at least"),
        ("t,x,y,z\n", "row 2: no samples"),
        ("", "the file is empty"),
        ("a,b,c,d\n0,1,2,3\n", "row 1 is 'a,b,c,d'"),
        ("t,x,y,z,x\n0,1,2,3,4\n1,1,2,3,4\n", "'x' stands twice"),
    ],
)
def test_bad_tables_name_file_row_and_reason(content: str, says: str, tmp_path: Path) -> None:
    source = tmp_path / "a.csv"
    source.write_text(content)
    with pytest.raises(InputError) as error:
        import_recording(source, tmp_path / "out", ["t_s=t", *PLAIN], defaults=REST)
    assert str(source) in str(error.value)
    assert says in str(error.value)
    assert [p.name for p in tmp_path.iterdir()] == ["a.csv"]


@pytest.mark.parametrize(
    "options",
    [
        ["--map", "gx_dps"],
        ["--map", "speed=x"],
        ["--map", "gx_dps=x:furlong"],
        ["--map", "gx_dps=x:counts"],
        ["--map", "t_s=t:samples"],
        ["--map", "gx_dps=x/0"],
        ["--map", "gx_dps=x"],
        ["--columns", "a,b"],
        ["--skip", "3"],
        ["--format", "rosbag"],
        ["--rate-hz", "-1"],
        ["--run", "up"],
        ["--run", "../up:0:5"],
        ["--run", "up:x:5"],
        ["--run", "up:9:5"],
        ["--run", "up:0:5000"],
        ["--run", "up:0:5:face=left"],
        ["--run", "up:0:5:colour=red"],
        ["--run", "up:0:5", "--run", "up:5:9"],
        ["--run-meta", "none*:face=up"],
        ["--run-meta", "face=up"],
        ["--sections", "none.json"],
        ["--face", "left"],
        ["--axis", "w"],
        ["--power-on-s", "-1"],
    ],
)
def test_bad_options_are_told_in_one_line(
    options: list[str], rows: np.ndarray, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = write(tmp_path / "a.csv", "t_s,gx_dps,gy_dps,gz_dps", rows)
    assert main(["import", str(source), str(tmp_path / "out"), "--rate", "0", *options]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["a.csv"]


def test_a_run_needs_its_true_rate(rows: np.ndarray, tmp_path: Path) -> None:
    source = write(tmp_path / "a.csv", "t,x,y,z", rows)
    with pytest.raises(InputError, match="true rate is not known"):
        import_recording(source, tmp_path / "out", ["t_s=t", *PLAIN])
    reference = import_recording(source, tmp_path / "out", ["t_s=t", *PLAIN, "rate_ref_dps=z*-1"])
    assert np.allclose(reference.runs[0].rate_dps, -rows[:, 3], atol=1e-8)


def test_the_command_says_what_it_made(rows: np.ndarray, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write(tmp_path / "a.csv", "t,x,y,z", rows)
    sections = tmp_path / "sections.json"
    sections.write_text(json.dumps({"one": {"start": 0, "end": 20}, "two": {"start": 20, "end": 50}}))
    maps = [word for m in ("t_s=t", *PLAIN) for word in ("--map", m)]
    out = tmp_path / "out"
    assert main(["import", str(source), str(out), *maps, "--sections", str(sections), "--rate", "0"]) == 0
    assert "2 runs, 50 samples at 128 Hz" in capsys.readouterr().out
    assert [len(run) for run in Session.open(out).runs] == [20, 30]
