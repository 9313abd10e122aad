"""Code that a user names is run only with ``--trust``; without it one line says what would be run, and nothing is."""

import inspect
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest

from gyrocal.cli import command_modules, main
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
WITH_EFFECTS = {
    "add": ["add", "drift", "s", "--model", "m.toml"],
    "apply": ["apply", "s", "--model", "m.toml", "--out", "o"],
    "calibrate": ["calibrate", "s"],
    "compare": ["compare", "s"],
    "diagnose": ["diagnose", "s"],
    "explain": ["explain", "s", "--model", "m.toml"],
    "keep": ["keep", "s", "--model", "m.toml"],
    "plan": ["plan", "s"],
    "simulate": ["simulate", "o"],
}


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path


def left_in(place: Path) -> set[str]:
    return {str(path.relative_to(place)) for path in place.rglob("*")}


def test_the_commands_with_effects_of_ones_own_are_these() -> None:
    found = {verb for verb, module in command_modules().items() if "--effects" in inspect.getsource(import_module(module))
             or "OwnEffects" in inspect.getsource(import_module(module))}  # fmt: skip
    assert found == WITH_EFFECTS.keys()


@pytest.mark.parametrize("words", WITH_EFFECTS.values(), ids=WITH_EFFECTS)
def test_effects_are_not_run_without_trust(words: list[str], place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own = place / "own"
    own.mkdir()
    (own / "mine.py").write_text(EFFECT.format(trace=str(place / "trace")))
    before = left_in(place)
    assert main([*words, "--effects", "own"]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err == (
        "gyrocal: --effects own runs its Python code: mine.py. Nothing was run; if you trust this code, add --trust\n"
    )
    assert left_in(place) == before
    for order in (["--trust", "--effects", "own"], ["--effects", "own", "--trust"]):
        assert main([*words, *order]) == 2  # no effect in it
        assert "no effect in it" in capsys.readouterr().err
        (place / "trace").unlink()


def test_many_files_are_told_in_one_line(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (place / "own").mkdir()
    for k in range(30):
        (place / "own" / f"e{k:02}.py").write_text("raise SystemExit")
    assert main(["compare", "s", "--effects", "own"]) == 2
    assert "e00.py, e01.py, e02.py, e03.py and 26 more." in capsys.readouterr().err


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
