"""What a person is told of a fault in session.toml: the file, the table, the key, and what to write."""

from pathlib import Path

import pytest

from gyrocal.errors import InputError
from gyrocal.recording.header import read_header

GOOD = """\
format = "gyrocal-session/1"
sample_rate_hz = 100.0
axis = "z"

[reference]
clock = "own"

[[run]]
file = "a.csv"
face = "up"
table_rate_dps = 78.0

[[run]]
file = "b.csv"
face = "down"
day = 1
"""
RUNS = GOOD[GOOD.index("[[run]]") :]

FAULTS = {
    ('face = "up"\n', ""): '[[run]] 1: face is missing; write face = "up" or face = "down"',
    ('file = "b.csv"\n', ""): '[[run]] 2: file is missing; write file = "000_up.csv", the table of this run',
    ('face = "down"', 'face = "left"'): '[[run]] 2: face = "left"; write "up" or "down"',
    ("sample_rate_hz = 100.0\n", ""): "sample_rate_hz is missing; write sample_rate_hz = 100.0, the samples per second",
    ("= 100.0", '= "100"'): 'sample_rate_hz = "100"; write a number without quotes',
    ("= 100.0", "= 0"): "sample_rate_hz = 0; write a number above 0",
    ("= 100.0", "= inf"): "sample_rate_hz = inf; write a finite number",
    ('axis = "z"', 'axis = "w"'): 'axis = "w"; write "x", "y" or "z"',
    ('axis = "z"', "latitude_deg = 100"): "latitude_deg = 100; write a number of at most 90",
    ('axis = "z"', 'accept = "clipped"'): 'accept = "clipped"; write a list such as accept = ["clipped:z"]',
    ('axis = "z"', "accept = [3]"): "accept = 3; write text in quotes",
    ('axis = "z"', "made_on = 3"): "made_on = 3; write text in quotes",
    ('axis = "z"', "sensor = true"): "sensor = true; write text in quotes",
    ('"own"', '"mine"'): '[reference]: clock = "mine"; write "own" or "same"',
    ('clock = "own"', "ref_noise_dps = -1.0"): "[reference]: ref_noise_dps = -1.0; write a number of at least 0",
    ('[reference]\nclock = "own"', 'reference = "gravity"'): "write a table that begins with [reference]",
    ("= 78.0", '= "78"'): '[[run]] 1: table_rate_dps = "78"; write a number without quotes',
    ("day = 1", "day = 1.5"): "[[run]] 2: day = 1.5; write a whole number without quotes",
    ("day = 1", "power_on_s = -1"): "[[run]] 2: power_on_s = -1; write a number of at least 0",
    ("day = 1", "scenario = 7"): "[[run]] 2: scenario = 7; write text in quotes",
    (RUNS, ""): "run is missing; write [[run]] and below it the keys of a run, for each table",
    (RUNS, '[run]\nfile = "a.csv"'): "write a table that begins with [[run]], in two brackets, for each run",
    ('[[run]]\nfile = "b.csv"', '[[run]]\nfile = "a.csv"'): "run file 'a.csv' is listed twice",
}
"""What is replaced, and by what; and what a person reads."""


@pytest.mark.parametrize(("change", "words"), FAULTS.items())
def test_a_fault_is_told_by_table_key_and_what_to_write(change: tuple[str, str], words: str, tmp_path: Path) -> None:
    assert change[0] in GOOD
    path = tmp_path / "session.toml"
    path.write_text(GOOD.replace(*change, 1))
    with pytest.raises(InputError) as told:
        read_header(tmp_path)
    assert str(told.value).startswith(f"{path}: ")
    assert words in str(told.value)
    assert not {"Input", "Field", "valid"} & set(str(told.value).split())
    assert "\n" not in str(told.value)


def test_the_file_without_a_fault_is_read(tmp_path: Path) -> None:
    (tmp_path / "session.toml").write_text(GOOD)
    assert len(read_header(tmp_path).run) == 2
