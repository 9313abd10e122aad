"""The command line to a person: near names, whole help, a fast start, one line for whatever goes wrong, and a clean Ctrl-C."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from gyrocal.cli import about, command_modules, main
from gyrocal.files import replacing

HEAVY = ("polars", "numpy", "scipy", "matplotlib", "onnxruntime", "nicegui", "pydantic", "torch")


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("manners") / "s"
    assert main(["simulate", str(path), "--scenarios", "3", "--seconds", "6"]) == 0
    return str(path)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["compar"], "did you mean compare?"),
        (["compare", "--modle", "x"], "--model"),
        (["compare", "SESSION", "--model", "defualt"], "did you mean default?"),
        (["add", "tabel_ripple", "SESSION", "--model", "m.toml"], "did you mean table_ripple?"),
        (["simulate", "new", "--campaign", "papr"], "did you mean paper?"),
        (["simulate", "new", "--effect", "table_ripple:amplitud_1=0.1"], "did you mean amplitude_1?"),
        (["calibrate", "SESSION", "--method", "basline"], "did you mean baseline?"),
        (["add", "own: a*temperatur", "SESSION", "--model", "m.toml"], "did you mean"),
        (["benchmark", "papr"], "did you mean paper?"),
        (["device", "--fault", "stuk_bus"], "did you mean stuck_bus?"),
        (["import", "log.csv", "new", "--map", "gz_dsp=z"], "did you mean gz_dps?"),
    ],
)
def test_near_names(
    words: list[str],
    says: str,
    session: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([session if w == "SESSION" else w for w in words]) == 2
    told = capsys.readouterr()
    assert says in told.err
    assert told.err.count("\n") == 1


def test_every_command_has_the_short_help_option(capsys: pytest.CaptureFixture[str]) -> None:
    for verb in ([], ["compare"]):
        assert main([*verb, "-h"]) == 0
        short = capsys.readouterr().out
        assert main([*verb, "--help"]) == 0
        assert capsys.readouterr().out == short


def test_the_list_of_commands_is_whole(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for verb, module in command_modules().items():
        assert about(module), verb
        assert f"{verb} {about(module)}" in shown


def test_help_imports_nothing_heavy() -> None:
    code = f"import sys; from gyrocal.cli import main; main(['--help']); sys.exit(any(m in sys.modules for m in {HEAVY}))"
    assert subprocess.run([sys.executable, "-c", code], stdout=subprocess.DEVNULL).returncode == 0


def test_a_verb_imports_only_what_it_uses(session: str) -> None:
    heavy = ("matplotlib", "onnxruntime", "nicegui", "torch")
    asked = f"any(m in sys.modules for m in {heavy})"
    code = f"import sys; from gyrocal.cli import main; main(['compare', {session!r}]); sys.exit({asked})"
    assert subprocess.run([sys.executable, "-c", code], stdout=subprocess.DEVNULL).returncode == 0


def test_training_never_brings_gpu_libraries_unasked() -> None:
    """PyPI's PyTorch does on Linux, so whatever names the extra asks for PyTorch's own index for the CPU too."""
    root = Path(__file__).parents[1]
    texts = [*(root / "docs").rglob("*.md"), *(root / "host").rglob("*.py"), *(root / "model_export").rglob("*.py")]
    for path in texts:
        for line in path.read_text(encoding="utf-8").splitlines():
            assert "gyrocal[train]" not in line or "--extra-index-url INDEX" in line, path


def test_help_starts_fast() -> None:
    """No more processor time above that of Python than twice that of importing numpy, the best of five, taken in turn."""

    def seconds(*words: str) -> float:
        before = os.times()
        subprocess.run([sys.executable, *words], stdout=subprocess.DEVNULL, check=True)
        after = os.times()
        return after.children_user + after.children_system - before.children_user - before.children_system

    started = ("-c", "pass"), ("-c", "import numpy"), ("-m", "gyrocal", "--help")
    python, numpy, told = np.min([[seconds(*words) for words in started] for _ in range(5)], axis=0)
    assert told - python < 2 * (numpy - python)


def test_completion_is_there(capfd: pytest.CaptureFixture[str]) -> None:
    words = {**os.environ, "_GYROCAL_COMPLETE": "complete_bash", "COMP_WORDS": "gyrocal comp", "COMP_CWORD": "1"}
    done = subprocess.run([sys.executable, "-m", "gyrocal"], env=words, capture_output=True, text=True)
    assert "compare" in done.stdout.split()


@pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="needs /dev/full")
@pytest.mark.parametrize("options", [[], ["--json"]])
def test_output_that_cannot_be_written_is_told(session: str, options: list[str]) -> None:
    with open("/dev/full", "w") as full:
        words = [sys.executable, "-m", "gyrocal", "calibrate", session, "--seconds", "4", *options]
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (1, "gyrocal: No space left on device\n")


def test_a_device_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with replacing(tmp_path / "pipe") as path:
        assert path == tmp_path / "pipe"
    assert path.is_fifo()


def test_a_cache_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("a file where a folder should be")
    words = [sys.executable, "-m", "gyrocal", "verify"]
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "cache")}
    done = subprocess.run(words, env=environment, capture_output=True, text=True)
    assert done.returncode == 1
    assert "cannot keep compiled files there" in done.stderr
    assert "weights.h" not in done.stderr


def test_a_session_with_semicolons_says_what_reads_it(session: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in Path(session).iterdir():
        text = path.read_text()
        (tmp_path / path.name).write_text(text.replace(",", ";") if path.suffix == ".csv" else text)
    assert main(["compare", str(tmp_path)]) == 2
    assert "cells are separated by commas here: `gyrocal import` reads other tables" in capsys.readouterr().err


def test_an_interrupt_inside_a_compiled_module_is_one_line(
    session: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise ImportError("initialization failed") from KeyboardInterrupt()

    monkeypatch.setattr("gyrocal.recording.session.Session.open", interrupted)
    assert main(["compare", session]) == 130
    assert capsys.readouterr().err == "gyrocal: stopped\n"


@pytest.mark.parametrize("after_s", [0.0, 0.1, 0.4, 1.2])
def test_an_interrupt_at_any_time_is_one_line(session: str, after_s: float) -> None:
    """Counted from the first line of our own code: before it, the interpreter itself is starting."""
    start = "signal.signal(signal.SIGINT, m._stop); print('up', flush=True); exit(m.main())"
    code = f"import gyrocal.__main__ as m, signal; {start}"
    process = subprocess.Popen(
        [sys.executable, "-c", code, "compare", session], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "up\n"
    time.sleep(after_s)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert (process.returncode, told) in ((130, "gyrocal: stopped\n"), (0, ""))
