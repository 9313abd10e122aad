"""Files that a session, an import or a model must not follow, wait for or hold: one line, exit 2, in little time and memory."""

from __future__ import annotations

import os
import resource
import time
from pathlib import Path

import pytest

from gyrocal.cli import main

HEADER = 'format = "gyrocal-session/1"\nsample_rate_hz = 100.0\naxis = "z"\n'
RUN = '[[run]]\nface = "up"\ntable_rate_dps = 78.0\nfile = "{}"\n'
ROWS = "t_s,gx_dps,gy_dps,gz_dps\n" + "".join(f"{k / 100},{k % 3},{k % 5 - 2},{78 + k % 4}\n" for k in range(20))
MAPS = [w for m in ("t_s=t_s", "gx_dps=gx_dps", "gy_dps=gy_dps", "gz_dps=gz_dps") for w in ("--map", m)]
LONG = 100_000_000
SECONDS, MEMORY_BYTES = 2.0, 1 << 30
"""Limits of processor time, first imports included, and of memory beyond what the program holds."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A session in a folder, beside a table that is not its own."""
    path = tmp_path / "s"
    path.mkdir()
    (path / "session.toml").write_text(HEADER + RUN.format("a.csv"))
    (path / "a.csv").write_text(ROWS)
    (tmp_path / "other.csv").write_text(ROWS)
    return path


def refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line that a command says at exit 2, within the limits."""
    held = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    began_s = time.process_time()
    resource.setrlimit(resource.RLIMIT_AS, (held + MEMORY_BYTES, hard))
    try:
        assert main(words) == 2
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    assert time.process_time() - began_s < SECONDS
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert len(told) < 600
    return told


@pytest.mark.parametrize("kind", ["absolute", "above", "link", "link to a folder"])
@pytest.mark.parametrize("verb", ["compare", "calibrate"])
def test_a_run_file_outside_the_folder_is_not_followed(
    kind: str, verb: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = {"absolute": str(folder.parent / "other.csv"), "above": "../other.csv", "link": "b.csv"}.get(kind, "b/other.csv")
    if kind == "link":
        (folder / "b.csv").symlink_to(folder.parent / "other.csv")
    if kind == "link to a folder":
        (folder / "b").symlink_to(folder.parent)
    (folder / "session.toml").write_text(HEADER + RUN.format(name))
    assert (folder / name).is_file(), "it could be read"
    assert "lies outside the session's folder" in refused([verb, str(folder)], capsys)


def test_a_run_file_below_the_folder_and_a_link_within_it_are_read(folder: Path) -> None:
    (folder / "tables").mkdir()
    (folder / "a.csv").rename(folder / "tables" / "a.csv")
    (folder / "b.csv").symlink_to("tables/a.csv")
    linked = folder.parent / "linked"
    linked.symlink_to(folder)
    (folder / "session.toml").write_text(HEADER + RUN.format("tables/a.csv") + RUN.format("b.csv"))
    for path in (folder, linked):
        assert main(["compare", str(path), "--json"]) == 0


@pytest.mark.parametrize("what", ["session.toml", "a.csv", "import", "model", "plan", "sections", "bias"])
def test_a_pipe_is_not_waited_for(what: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    inside = what in ("session.toml", "a.csv")
    pipe = folder / what if inside else folder.parent / "pipe.toml"
    pipe.unlink(missing_ok=True)
    os.mkfifo(pipe)
    session, out = str(folder), str(folder.parent / "out")
    words = {
        "import": ["import", str(pipe), out, *MAPS],
        "model": ["compare", session, "--model", str(pipe)],
        "plan": ["record", out, "--port", "none", "--plan", str(pipe)],
        "sections": ["import", str(folder / "a.csv"), out, *MAPS, "--sections", str(pipe)],
        "bias": ["apply", session, "--model", "default", "--out", out, "--bias", str(pipe)],
    }.get(what, ["compare", session])
    assert str(pipe) in refused(words, capsys)


@pytest.mark.parametrize("verb", ["compare", "import"])
def test_a_header_of_100_megabytes(verb: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = folder / "a.csv"
    table.write_text("t_s," + "x," * (LONG // 2) + "\n1,2\n")
    words = ["compare", str(folder)] if verb == "compare" else ["import", str(table), str(folder.parent / "out"), *MAPS]
    assert "in one line" in refused(words, capsys)


@pytest.mark.parametrize("verb", ["compare", "import"])
def test_a_row_of_100_megabytes(verb: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = folder / "a.csv"
    table.write_text(ROWS + "1," * (LONG // 2) + "\n" + ROWS.splitlines()[-1] + "\n")
    words = ["compare", str(folder)] if verb == "compare" else ["import", str(table), str(folder.parent / "out"), *MAPS]
    assert "row 22" in refused(words, capsys)


@pytest.mark.parametrize("name", ["session.toml", "model.toml"])
def test_a_text_that_is_too_large_is_not_parsed(name: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / name).write_text(f'sensor = "{"x" * LONG}"\n{HEADER}')
    words = ["compare", str(folder)] if name == "session.toml" else ["compare", str(folder), "--model", str(folder / name)]
    assert "bytes, and at most" in refused(words, capsys)


def test_a_sum_of_1500_terms_and_a_nested_header(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    formula = "own: " + "+".join(f"k{k}*t" for k in range(1500))
    assert "elements, at most" in refused(["add", formula, str(folder), "--model", str(folder / "m.toml")], capsys)
    (folder / "session.toml").write_text("x = " + "[" * 100_000)
    assert "nested too deeply" in refused(["compare", str(folder)], capsys)
