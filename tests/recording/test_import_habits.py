"""How other programs write a table: each is read as what it means, or refused in one line that says what to do."""

import datetime
import gzip
import json
import re
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from gyrocal.cli import main
from gyrocal.errors import InputError
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import read_recording

N = 300
RNG = np.random.default_rng(0)
T_S = np.arange(N) / 100
GYRO_DPS = np.round(RNG.normal([0, 0, 78], 0.1, (N, 3)), 5)
HEAD = ["time", "gyro_x", "gyro_y", "gyro_z"]
ROWS = [[f"{t:.3f}", *(f"{v:.5f}" for v in w)] for t, w in zip(T_S, GYRO_DPS, strict=True)]
START = datetime.datetime(2026, 5, 3, 23, 59, 59, tzinfo=datetime.timezone(datetime.timedelta(hours=2)))


def text(rows: list[list[str]] = ROWS, head: list[str] = HEAD, separator: str = ",", end: str = "\n") -> str:
    return end.join(separator.join(row) for row in [head, *rows]) + end


def timed(form: str) -> str:
    """The table with dates or times of day, which pass midnight."""
    moments = [START + datetime.timedelta(seconds=float(t)) for t in T_S]
    return text([[m.strftime(form), *row[1:]] for m, row in zip(moments, ROWS, strict=True)])


def over_the_end_of_summer_time() -> str:
    """The table with offsets from UTC, whose clock is put back by an hour."""
    moments = [START + datetime.timedelta(seconds=float(t)) for t in T_S]
    winter = datetime.timezone(datetime.timedelta(hours=1))
    stamps = [(m if i < N // 2 else m.astimezone(winter)).isoformat() for i, m in enumerate(moments)]
    return text([[stamp, *row[1:]] for stamp, row in zip(stamps, ROWS, strict=True)])


def counted(first: int, step: int) -> str:
    """The table with the times of a 32-bit counter."""
    return text([[str((first + i * step) % 2**32), *row[1:]] for i, row in enumerate(ROWS)], ["micros", *HEAD[1:]])


def with_commas(rows: list[list[str]], quote: str = "") -> list[list[str]]:
    return [[quote + cell.replace(".", ",") + quote for cell in row] for row in rows]


HABITS: dict[str, str | bytes] = {
    "byte order mark": "\ufeff" + text(),
    "UTF-16": text().encode("utf-16"),
    "UTF-16 without its mark": text().encode("utf-16-le"),
    "UTF-16 of the other order": text(separator="\t").encode("utf-16-be"),
    "blank lines between": text(end="\r\r\n"),
    "columns of slower sensors": text(
        [[*row, *(["7.5"] * 5 if i % 25 == 24 else [""] * 5)] for i, row in enumerate(ROWS)],
        [*HEAD, *(f"gps {k}" for k in "abcde")],
    ),
    "gzip": gzip.compress(text().encode()),
    "Latin-1": text(head=["Time [s]", "Gyro X [°/s]", "Gyro Y [°/s]", "Gyro Z [°/s]"]).encode("latin-1"),
    "lines of Windows": text(end="\r\n"),
    "lines of an old Mac": text(end="\r"),
    "sep= of Excel": "sep=;\r\n" + text(with_commas(ROWS), separator=";", end="\r\n"),
    "quoted decimal commas": text(with_commas(ROWS, '"')),
    "thousands": text([[f'"{1e3 * t:,.1f}"', *row[1:]] for t, row in zip(T_S, ROWS, strict=True)]),
    "thousands by points": text(
        [[f"{1e3 * t:,.1f}".translate({44: ".", 46: ","}), *row[1:]] for t, row in zip(T_S, with_commas(ROWS), strict=True)],
        separator=";",
    ),
    "bars": text(separator="|"),
    "tabs": text(separator="\t"),
    "fixed width": "".join("".join(f"{cell:>12}" for cell in row) + "\n" for row in [HEAD, *ROWS]),
    "a row of units": text([["s", "deg/s", "deg/s", "deg/s"], *ROWS]),
    "comments": "# logger 2\n# 100 Hz\n" + text(),
    "header in a comment": "# " + text(),
    "minus signs of a word processor": text().replace("-", "\u2212"),
    "separator at the end of rows alone": text([[*row, ""] for row in ROWS]),
    "a number of rows": text([[str(i), *row] for i, row in enumerate(ROWS)], ["", *HEAD]),
    "words for nothing": text([[*row, ("NA", "-", "#N/A", "24.5")[i % 4]] for i, row in enumerate(ROWS)], [*HEAD, "temp"]),
    "typing error in a unit": text(head=["time", *(f"gyro_{a} (g/s)" for a in "xyz")]),
    "dates with a zone": timed("%Y-%m-%dT%H:%M:%S.%f%z"),
    "dates with zones that change": over_the_end_of_summer_time(),
    "dates with a zone's name": timed("%Y-%m-%d %H:%M:%S.%f CEST"),
    "dates by points": timed("%d.%m.%Y %H:%M:%S.%f"),
    "dates with underscores": timed("%Y_%m_%d_%H_%M_%S.%f"),
    "dates as in names of files": timed("%Y-%m-%dT%H-%M-%S.%fZ"),
    "dates with AM and PM": timed("%m/%d/%Y %I:%M:%S.%f %p"),
    "times of day across midnight": timed("%H:%M:%S.%f"),
    "minutes and seconds": text([[f"{59 + t // 60:02.0f}:{t % 60:06.3f}", *r[1:]] for t, r in zip(T_S, ROWS, strict=True)]),
    "abbreviated names": text(head=["time", "AngVelX", "AngVelY", "AngVelZ"]),
    "rates of roll, pitch and yaw": text(head=["time", "roll_rate", "pitch_rate", "yaw_rate"]),
    "a serial monitor's stamps": "".join(
        f"12:00:59.9{i % 10} -> {line}\n" if i < 2 else f"12:01:{T_S[i - 2]:06.3f} -> {line}\n"
        for i, line in enumerate(["Booting...", "gyro_x,gyro_y,gyro_z", *(",".join(row[1:]) for row in ROWS)])
    ),
    "units behind blanks, above tabs": (
        "time [s] gyro_x [dps] gyro_y [dps] gyro_z [dps] \n" + text(separator="\t").partition("\n")[2]
    ),
    "nanoseconds since 1970": text([[str(1_770_000_000_123_456_789 + i * 10**7), *r[1:]] for i, r in enumerate(ROWS)]),
    "a counter that begins again": counted(2**32 - 1_000_000, 10_000),
    "a counter that nearly begins again": counted(2**32 - 4_000_000, 10_000),
}  # fmt: skip


@pytest.mark.parametrize("habit", HABITS)
def test_a_habit_is_read_as_what_it_means(habit: str, tmp_path: Path) -> None:
    written = HABITS[habit]
    (tmp_path / "log.csv").write_bytes(written if isinstance(written, bytes) else written.encode())
    run = read_recording(tmp_path / "log.csv", Options(defaults={"table_rate_dps": 78.0})).session.runs[0]
    assert np.array_equal(run.gyro_dps, GYRO_DPS)
    assert run.t_s == pytest.approx(T_S, abs=1e-6)


COUNTS = np.rint(GYRO_DPS * 131).astype(int)
UNSIGNED = COUNTS % 65536
MONITORED = "".join(f"12:01:{t:06.3f} > {','.join(row[1:])}\n" for t, row in zip(T_S, ROWS, strict=True))
REFUSED: dict[str, tuple[str, str]] = {
    "16 bits without a sign": (text([[r[0], *map(str, c)] for r, c in zip(ROWS, UNSIGNED, strict=True)]), "131 counts per dps"),
    "counts about a zero": (text([[r[0], *map(str, c + 32768)] for r, c in zip(ROWS, COUNTS, strict=True)]), "-32768)/131"),
    "hexadecimal": (text([[r[0], *map(hex, c)] for r, c in zip(ROWS, UNSIGNED, strict=True)]), "write decimal ones"),
    "a serial monitor's stamps without a header": (MONITORED, "name all columns, as by --columns time,gx,gy,gz"),
    "a sentence above rows without a header": (
        "# Created at Mon Aug 12 13:16:15 in Burnaby \n" + text(separator=" ").partition("\n")[2],
        "no header: name all columns, as by --columns time,gx,gy,gz",
    ),
    "hexadecimal without a mark": (
        text([[r[0], *(f"{c % 2**32:04X}" for c in row)] for r, row in zip(ROWS, COUNTS, strict=True)]),
        "words of 4 or 8 digits are whole numbers with a sign",
    ),
    "hexadecimal where negative": (
        text([[*r[:3], f"{-3 - i % 5 & 0xFFFFFFFF:08X}" if i % 3 == 0 else f"{i % 5:04X}"] for i, r in enumerate(ROWS)]),
        "gyro_z holds hexadecimal numbers, as FFFFFFF",
    ),
    "the bits of floats": (
        "\n".join(",".join(struct.pack(">f", float(cell)).hex() for cell in r) for r in ROWS), "the bits of a float",
    ),
    "dictionaries of Python": ("\n".join(f"{{'t': {r[0]}, 'gyro': {{'z': {r[3]}}}}}" for r in ROWS), "dictionaries of Python"),
    "JSON that is one object": (
        json.dumps({"Meas": {"IMU6": [{"t": r[0], "gz": r[3]} for r in ROWS]}}), "(FILE))['Meas']['IMU6'] is a list in it",
    ),
    "JSON": ("\n".join(f'{{"t":{r[0]},"gz":{r[3]}}}' for r in ROWS), "this is JSON"),
    "a header alone": (text([]), "no rows below the header; a recording has two samples at least"),
    "one row": (text(ROWS[:1]), "1 row below the header"),
    "commas between decimal commas": (text(with_commas(ROWS)), "save it with semicolons or tabs between the cells"),
    "sensors in turn": (
        text([[*r, n] for r in ROWS for n in "ab"], [*HEAD, "sensor_id"]), "of several sensors (a, b); keep those",
    ),
    "rows of several kinds": (
        "\n".join(f"{r[0]},imu,{','.join(r[1:])}\n{r[0]},baro,487.5\n{r[0]},gps,55.1,37.2" for r in ROWS),
        "several kinds, named in cell 2: imu, baro, gps. Keep the rows of one kind in a file of their own, as imu",
    ),
    "kinds of equal width": (
        "\n".join(f"l,{','.join(r[1:4])},,{r[0]}\ng,{','.join(r[1:4])},,{r[0]}\nr,1,0,0,0,{r[0]}" for r in ROWS),
        "several kinds, named in cell 1: l, g, r. Keep the rows of one kind in a file of their own, as g",
    ),
    "rows of one kind, whose letters are digits of hexadecimal numbers": (
        "\n".join(f"ACCE;{';'.join(r)}" for r in ROWS), "no header: name all columns, as by --columns time,gx,gy,gz",
    ),
    "kinds one after the other": (
        "\n".join(["Kind,F,A,B,C", *["Depth,1,9,8,7"] * 300, *[f"Gyro,0,7,{','.join(ROWS[0])},9"] * 300]),
        "several kinds, named in cell 1: Depth, Gyro. Keep the rows of one kind in a file of their own, as Gyro",
    ),
    "labels with brackets and an address": (
        "\n".join(f"RAW 0x68: accel=(9252, -5612, -12084) gyro=({', '.join(r[1:])})" for r in ROWS), "write the names once",
    ),
    "a pointer": ("version https://git-lfs.example/spec/v1\noid sha256:0b8d\nsize 311115\n", "git lfs pull"),
    "HTML": ("<table>\n<tr><td>1</td></tr>\n", "XML or HTML"),
    "a plotter's labels": (text([[f"{h}:{c}" for h, c in zip(HEAD, r, strict=True)] for r in ROWS]), "write the names once"),
}


LABELS = "\n".join(f"Linear X = 0, Y = -13, gx = {r[1]}, gy = {r[2]}, gz = {r[3]}\nstatus: sys 3, gyro 3" for r in ROWS)


@pytest.mark.parametrize("head", ["", "# capture_start baud=115200 seconds=60.0\nBooting at 0x42\n"])
@pytest.mark.parametrize("columns", [None, ["time", "gx", "gy", "gz"]])
def test_names_in_the_cells_are_told_of_their_own_row(head: str, columns: list[str] | None, tmp_path: Path) -> None:
    """With blanks about the sign, and with stated names as well, which the refusal had advised."""
    (tmp_path / "log.txt").write_text(head + LABELS)
    with pytest.raises(InputError, match=r"its cells hold names, as 'X = 0'; write the names once") as told:
        read_recording(tmp_path / "log.txt", Options(columns=columns, defaults={"table_rate_dps": 0.0}))
    assert re.search(r"row \d+ is 'Linear X = 0", str(told.value))


@pytest.mark.parametrize("habit", REFUSED)
def test_what_cannot_be_read_says_what_to_do(habit: str, tmp_path: Path) -> None:
    written, says = REFUSED[habit]
    (tmp_path / "log.csv").write_text(written)
    with pytest.raises(InputError) as told:
        read_recording(tmp_path / "log.csv", Options(defaults={"table_rate_dps": 78.0}))
    assert says in str(told.value)
    assert "\n" not in str(told.value)


def test_a_serial_monitor_s_stamps_are_a_column_that_can_be_named(tmp_path: Path) -> None:
    (tmp_path / "log.txt").write_text(MONITORED)
    options = Options(columns=["time", "gx", "gy", "gz"], defaults={"table_rate_dps": 78.0})
    run = read_recording(tmp_path / "log.txt", options).session.runs[0]
    assert np.array_equal(run.gyro_dps, GYRO_DPS)
    assert run.t_s == pytest.approx(T_S, abs=1e-6)


@pytest.mark.parametrize(
    ("member", "says"),
    [("xl/workbook.xml", "save its sheet as CSV"), ("content.xml", "save its sheet"), ("log.csv", "unpack it")],
)
def test_archives_say_what_they_are(member: str, says: str, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "log.zip", "w") as archive:
        archive.writestr(member, text())
    with pytest.raises(InputError, match=says):
        read_recording(tmp_path / "log.zip", Options())


def test_a_compressed_file_that_is_cut_off_says_so(tmp_path: Path) -> None:
    (tmp_path / "log.csv.gz").write_bytes(gzip.compress(text().encode())[:-100])
    with pytest.raises(InputError, match="is cut off or damaged; copy it again"):
        read_recording(tmp_path / "log.csv.gz", Options(defaults={"table_rate_dps": 78.0}))


def test_another_gyroscope_is_told(tmp_path: Path) -> None:
    head = ["time", *(f"imu{k}_gyro_{a}" for k in "12" for a in "xyz")]
    (tmp_path / "log.csv").write_text(text([[*r, *r[1:]] for r in ROWS], head))
    guessed = read_recording(tmp_path / "log.csv", Options(defaults={"table_rate_dps": 78.0})).guessed
    assert {g.map.partition(":")[0]: g.why for g in guessed}["gy_dps=imu1_gyro_y"].endswith("; not imu2_gyro_y")


def test_orientations_that_are_too_few_for_a_rate_say_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    parts = [f"ref_q{part}" for part in "wxyz"]
    (tmp_path / "log.csv").write_text(text([[*r, "1", "0", "0", "0"] for r in ROWS[:10]], [*HEAD, *parts]))
    maps = ["t_s=time", *(f"g{a}_dps=gyro_{a}" for a in "xyz"), *(f"{part}={part}" for part in parts)]
    options = [word for each in maps for word in ("--map", each)]
    assert main(["import", str(tmp_path / "log.csv"), str(tmp_path / "out"), *options]) == 2
    assert "no rate follows from the reference: it needs 16 samples in a row" in capsys.readouterr().err
