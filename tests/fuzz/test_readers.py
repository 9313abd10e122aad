"""Each reader of the host takes its valid files and a second of hostile ones; each finding of a longer run stays mended."""

from pathlib import Path

import pytest
import readers

from gyrocal.cli import main

SECONDS = 1.0
HEADER, PLAN = readers.HEADER.encode(), readers.PLAN.encode()
FOUND = [
    ("header", HEADER.replace(b"32.8", b"{a=" * 900)),
    ("header", HEADER.replace(b"32.8", b"[" * 2000)),
    ("header", HEADER.replace(b"a.csv", b"a" * 2000)),
    ("header", HEADER.replace(b"78.0", b"9" * 5000)),
    ("plan", PLAN.replace(b"78.0", b"[" * 2000)),
    ("model", b"a = " + b"[" * 2000),
    ("estimates", b'{"estimates": [{"scenario": "s", "bias_dps": 0.1, "trusted": true}]}'),
    ("estimates", b'{"estimates": [1]}'),
    ("estimates", b'{"estimates": [{"scenario": "s", "axis": "z", "trusted": true, "bias_dps": ' + b"9" * 400 + b"}]}"),
    ("estimates", b"[" * 100_000),
    ("listing", b"[" * 100_000),
    ("import", b"# a log\nt;x;y;z\n-1e300;1;2;3\n0.01;1;2;3\n0.02;2;1;0\n"),
    ("formula", b"k*" + b"9" * 400),
    ("formula", b"k*1e999"),
    ("formula", b"+".join(b"k%d*t" % k for k in range(1500))),
    ("formula", b"k*" + b"-" * 900 + b"t"),
    ("formula", b"k*9**9**9**9*t"),
    ("formula", b"k*t/0"),
]


@pytest.mark.parametrize("name", readers.READERS)
def test_hostile_files_are_read_or_refused_in_one_line(name: str) -> None:
    executions, data, why = readers.fuzz(name, SECONDS, seed=1)
    assert data is None, (why, data)
    assert executions > len(readers.READERS[name][1])


@pytest.mark.parametrize("name", readers.READERS)
def test_the_valid_files_are_read(name: str, tmp_path: Path) -> None:
    read, valid = readers.READERS[name]
    for k, data in enumerate(valid):
        folder = tmp_path / str(k)
        folder.mkdir()
        if name == "recorder":
            with pytest.raises(readers.DeviceError, match="gone"):
                read(data, folder)
        else:
            read(data, folder)


@pytest.mark.parametrize(("name", "data"), FOUND)
def test_what_was_found_is_refused_in_one_line(name: str, data: bytes) -> None:
    readers.check(name, data)


def test_a_finding_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """A reader with a defect of each kind."""

    def never_ends(data: bytes, folder: Path) -> None:
        while True:
            pass

    def holds_much(data: bytes, folder: Path) -> object:
        return bytearray(2 << 30)

    def two_lines(data: bytes, folder: Path) -> None:
        raise readers.InputError("one\ntwo")

    for read, why in ((never_ends, "more than 1 s"), (holds_much, "MemoryError"), (two_lines, "one line")):
        monkeypatch.setitem(readers.READERS, "bad", (read, [b""]))
        with pytest.raises(readers.Finding, match=why):
            readers.check("bad", b"")


def test_a_nested_header_is_one_line_and_exit_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "session.toml").write_bytes(HEADER.replace(b"32.8", b"[" * 2000))
    assert main(["compare", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
