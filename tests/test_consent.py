"""Only code that a user names is run. `keep --file` and `verify --header` want ``--trust`` besides."""

from collections.abc import Callable
from pathlib import Path

import pytest

from gyrocal.cli import main
from gyrocal.effects import base
from gyrocal_firmware import INCLUDE

SPY = """
__attribute__((constructor)) static void spy(void)
{{
    FILE *file = fopen("{trace}", "w");
    if (file != NULL) (void)fclose(file);
}}
"""
EFFECT = "from pathlib import Path\nPath({trace!r}).touch()\n"


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path


def left_in(place: Path) -> set[str]:
    return {str(path.relative_to(place)) for path in place.rglob("*")}


def test_code_in_a_session_or_beside_it_is_not_run(place: Path) -> None:
    assert main(["simulate", "s", "--campaign", "paper", "--scenarios", "2", "--seconds", "4"]) == 0
    for folder in (place, place / "s"):
        (folder / "mine.py").write_text(EFFECT.format(trace=str(place / "trace")))
    assert main(["compare", "s"]) == 0
    assert not (place / "trace").exists()
    assert main(["compare", "s", "--effects", "s"]) == 2  # the file is run, and has no effect in it
    assert (place / "trace").exists(), "the file is one that leaves a trace"


def test_a_kept_file_wants_trust(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (place / "spy.py").write_text(EFFECT.format(trace=str(place / "trace")))
    before = left_in(place)
    assert main(["keep", "s", "--model", "m.toml", "--file", "mine.py"]) == 2
    told = capsys.readouterr().err
    assert "--file mine.py: this Python file is written, and then run" in told
    assert "add --trust" in told
    assert len(told.splitlines()) == 1
    assert left_in(place) == before


def test_a_header_is_neither_compiled_nor_run_without_trust(
    place: Path, capsys: pytest.CaptureFixture[str], require_tool: Callable[[str], str]
) -> None:
    require_tool("cc")
    header, trace = place / "weights.h", place / "trace"
    spy = "#include <stdio.h>\n" + SPY.format(trace=trace)
    header.write_text((INCLUDE / "weights.h").read_text() + spy)
    assert main(["verify", "--header", "weights.h"]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err == (
        "gyrocal: --header weights.h: this C code is compiled, and then run on this machine. "
        "Nothing was run; if you trust this code, add --trust\n"
    )
    assert left_in(place) == {"weights.h"}, "no cache: the compiler was not called"
    assert main(["verify", "--header", "weights.h", "--windows", "12", "--trust"]) == 0
    assert trace.exists(), "the spy is real"


def test_the_shipped_header_needs_no_consent(require_tool: Callable[[str], str]) -> None:
    require_tool("cc")
    assert main(["verify", "--windows", "12"]) == 0


def test_one_file_of_effects_runs_alone(place: Path) -> None:
    (place / "spy.py").write_text(EFFECT.format(trace=str(place / "trace")))
    (place / "mine.py").write_text(
        "from gyrocal.api import FormulaEffect\n\nclass Mine(FormulaEffect):\n    id = 'mine_alone'\n"
        "    def __init__(self):\n        super().__init__('k*t', self.id)\n"
    )
    try:
        assert base.load(place / "mine.py") == ["mine_alone"]
    finally:
        base.effects().pop("mine_alone", None)
    assert not (place / "trace").exists()
