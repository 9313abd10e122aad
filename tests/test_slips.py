"""The slips of a new user: each ends with its exit code and one line that says what to do next, and leaves no file behind."""

import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

from gyrocal.cli import main

HINTS = {
    # verbs, options and their values
    "help": "did you mean --help?",
    "diagnosis s": "did you mean diagnose?",
    "calibrate": "Missing argument 'SESSION'. See: gyrocal calibrate --help",
    "compare s --zebra": "No such option: --zebra See: gyrocal compare --help",
    "diagnose s --model": "requires an argument",
    "calibrate s --seconds 2;4": "several with commas",
    "calibrate s --seconds 60": "ask for less, or for --seconds all",
    "calibrate s --method neural": "there are baseline, cnn, model",
    "benchmark nothing": "there are paper",
    "fleet": "Choose from: fit",
    "plan s --minutes -5": "a positive number",
    "workbench s --http-port 80000": "less than or equal to 65535",
    # sessions
    "compare .": ".: a folder of sessions (rest, s); name one of them, such as rest",
    "compare session": "as `gyrocal import`, `record` and `simulate` make",
    "compare log.csv": "`gyrocal import` makes one of a recording",
    "compare empty": "a session is a folder with session.toml",
    "compare broken/time": "the header lacks t_s; it has time",
    "compare broken/face": '[[run]] 1: face = "top"; write "up" or "down"',
    "compare broken/rate": "give table_rate_dps or turn_deg in session.toml",
    "compare broken/file": "no such file (named by",
    "compare broken/toml": "not a session",
    "fleet fit empty": "a fleet is a folder of session folders",
    "compare s --html none/x.html": "no such folder to write into",
    "compare s --residuals s": "give the name of a file",
    "simulate s": "choose another name or remove it",
    "device --session session": "as `gyrocal import`, `record` and `simulate` make",
    # models and effects
    "compare s --model m.toml": "not a model, as `gyrocal add` writes it",
    "compare s --model mine.toml": "`gyrocal explain` and `gyrocal add` make one",
    "compare s --model tuned": "`gyrocal explain` makes a file",
    "add ripple s --model out.toml": "did you mean table_ripple?",
    "add s tabel_ripple --model out.toml": "did you mean table_ripple?",
    "add table_ripple s --model default": "give the name of a file to write",
    "simulate new --effect drift:k=1": "it has k_dps_per_s",
    "simulate new --effect drift:k_dps_per_s": "is not name=value",
    "simulate new --campaign table": "did you mean table2?",
    "plan s --between drift,warm": "did you mean warmup?",
    "keep s --model default": "give the name of a file to write",
    # import
    "import log.csv": "Missing argument 'OUT'",
    "import none.csv new --rate 78": "No such file",
    "import log.csv new": "say which columns to take: --map gz_dps=COLUMN:UNIT",
    "import log.csv s --rate 78": "--append to add runs to it",
    "import nothing.csv new --rate 78": "the file is empty",
    "import photo.jpg new --rate 78": "save it as one of these",
    "import notes.txt new --rate 78": "else name the columns by --map",
    "import empty new --rate 78": "no tables in this folder (.csv",
    "import log.csv new --map t_s=time": "among time, x, y, z; say which columns to take: --map gz_dps=COLUMN:UNIT",
    "import raw.csv new --rate 78": "say what one count is, for example --lsb-dps 0.00763359",
    "import enc.csv new --yes": "or --gravity (turned by hand), or map rate_ref_dps or ref_angle_deg; columns not taken: enc",
    "import enc.csv new --rate 78 --map gz_dps=gz": "no time: map t_s, or give --rate-hz where samples are evenly spaced",
    "import enc.csv new --rate 0 --map gz_dps=gz": "perhaps --map 't_s=time:UNIT'",
    "calibrate rest": "The bias can: `gyrocal explain SESSION --model M.toml` writes it into a model",
    "import log.csv new --rate 78 --map t_s=time --map gz=z": "did you mean gz_dps?",
    "import log.csv new --rate 78 --map t_s=time --map gz_dps=w": "row 1 is 'time,x,y,z'",
    "import log.csv new --rate 78 --map t_s=time --map gz_dps=z:rpm": "gz_dps takes dps, deg/s, mdps, rad/s, mrad/s, counts",
    "import log.csv new --rate 78 --map t_s=time --map gz_dps=z:counts": "needs --lsb-dps",
    "import log.csv new --rate 78 --map gz_dps=z": "map t_s, or give --rate-hz",
    "import log.csv new --map t_s=time --map gz_dps=z": "or --gravity (turned by hand), or map rate_ref_dps or ref_angle_deg",
    "import log.csv new --face top --map t_s=time --map gz_dps=z": '--face: face=top; write "up" or "down"',
    "import log.csv new --rate 78 --axis x --map t_s=time --map gz_dps=z": "nothing is mapped to gx_dps; see --axis",
    "import log.csv new --rate 78 --run up:0:5000 --map t_s=time --map gz_dps=z": "the table has 400 rows",
    "import log.csv new --gravity --map t_s=time --map gz_dps=z": "map ax_g, ay_g and az_g",
    "import log.csv new --ref-map t_s=time --map t_s=time --map gz_dps=z": "give it by --reference FILE",
    # apply, export, device
    "apply good.csv --out c.csv": "Missing option '--model'",
    "apply good.csv --model default --out c.csv": "make one with `gyrocal explain` or `gyrocal add`",
    "apply good.csv --model default --out good.csv": "choose another name for --out",
    "apply good.csv --model default --out c.txt": "tables that end in .csv, .csv.gz or .parquet",
    "export --format kalibr --out e": "give it with --model",
    "export --model default --format betaflight --out e": "there are header",
    "firmware s": "give a new folder",
    "verify --header none.h": "write one with `gyrocal export`",
    "device --fault explosion": "no fault of this name; `gyrocal device --fault list` lists them",
    "device --tcp nowhere": "write HOST:PORT",
    "monitor": "Missing option '--port'",
    "monitor --port /dev/ttyNONE": "plug the device in",
    "monitor --port log.csv": "give a serial device such as",
    "record new --port socket://localhost:1 --face up --rate 78 --seconds 3": "is `gyrocal device --tcp localhost:1` running",
    "record new --port PORT --follow": "wait until `gyrocal device` has printed its name",
    "record new --face up --rate 78 --seconds 3": "Missing option '--port'",
}
"""What a user types, and words of the line that says what to do."""
LONGEST = 200
"""Characters of a line that is read at a glance, two lines of a terminal."""
PORT = ("monitor --port", "record new --port")
"""Slips whose exit code is 3."""


def broken(session: Path, name: str, file: str, old: str, new: str) -> None:
    shutil.copytree(session, session.parent / "broken" / name)
    path = session.parent / "broken" / name / file
    path.write_text(path.read_text().replace(old, new))


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what a new user has: a session, logs, and files that are something else."""
    folder = tmp_path_factory.mktemp("desk")
    session = folder / "s"
    assert main(["simulate", str(session), "--scenarios", "3", "--seconds", "6"]) == 0
    rows = np.column_stack([np.arange(400) / 100, np.random.default_rng(0).normal([0, 0, 78], 0.1, (400, 3))])
    for name, header in {"log": "time,x,y,z", "good": "t_s,gx_dps,gy_dps,gz_dps"}.items():
        np.savetxt(folder / f"{name}.csv", rows, "%.6f", ",", header=header, comments="")
    np.savetxt(folder / "still.csv", rows - [0, 0, 0, 78], "%.6f", ",", header="t_s,gx_dps,gy_dps,gz_dps", comments="")
    assert main(["import", str(folder / "still.csv"), str(folder / "rest"), "--rate", "0"]) == 0
    counts = np.column_stack([rows[:, 0], np.rint(131 * rows[:, 1:])])
    np.savetxt(folder / "raw.csv", counts, "%.6g", ",", header="time,gx,gy,gz", comments="")
    np.savetxt(folder / "enc.csv", rows[:, [0, 1, 2, 3, 0]], "%.6f", ",", header="time,gx,gy,gz,encoder", comments="")
    (folder / "nothing.csv").touch()
    (folder / "photo.jpg").write_bytes(b"\xff\xd8\xff\xe0\x00\x10JFIF" + bytes(range(256)))
    (folder / "notes.txt").write_text("hello\nworld\n")
    (folder / "m.toml").write_text("nonsense")
    (folder / "empty").mkdir()
    broken(session, "time", "000_up.csv", "t_s,", "time,")
    broken(session, "face", "session.toml", '"up"', '"top"')
    broken(session, "rate", "session.toml", "table_rate_dps", "# table_rate_dps")
    broken(session, "file", "session.toml", ".csv", ".CSV")
    broken(session, "toml", "session.toml", "=", ":")
    return folder


def files(folder: Path) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*")}


@pytest.mark.parametrize("words", HINTS)
def test_a_slip_gets_one_helpful_line(
    words: str, desk: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(desk)
    before = files(desk)
    assert main(shlex.split(words.replace(";", "\\;"))) == (3 if words.startswith(PORT) else 2)
    out, told = capsys.readouterr()
    assert (out, told.count("\n")) == ("", 1)
    assert told.startswith("gyrocal: ")
    assert len(told) <= LONGEST
    assert HINTS[words] in told
    assert "Traceback" not in told
    assert files(desk) == before


def test_there_are_enough_of_them() -> None:
    assert len(HINTS) >= 50


def test_what_a_person_reads_has_no_long_line(
    desk: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Answers on a table and by hand: sentences and lists are of lines that a terminal shows."""
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "held", "--campaign", "hands", "--scenarios", "16"]) == 0
    for verb, folder, of in (
        ("diagnose", desk, "s"), ("calibrate", desk, "s"), ("compare", tmp_path, "held"), ("calibrate", tmp_path, "held"),
    ):  # fmt: skip
        monkeypatch.chdir(folder)
        assert main([verb, of]) == 0
        assert [line for line in capsys.readouterr().out.splitlines() if len(line) > LONGEST] == [], verb
