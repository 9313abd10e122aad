"""The documentation: its tutorials do what they say, its links lead somewhere, and its pages are made from the code."""

import contextlib
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from types import ModuleType

import pytest

from gyrocal.cli import main
from gyrocal.present import effect_pages

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[1]
PYTHON = os.environ.get("GYROCAL_PYTHON") or sys.executable
"""The Python of another environment, in which tutorials and notebook then run: ``make wheel`` names it."""
TUTORIALS = [
    pytest.param(page, marks=[pytest.mark.wide] * (page.stem in ("log", "table")))
    for page in sorted((ROOT / "docs" / "tutorials").glob("*.md"))
]
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def test_every_page_begins_with_what_its_reader_can_do_then() -> None:
    pages = [p for p in sorted((ROOT / "docs").rglob("*.md")) if not p.relative_to(ROOT / "docs").parts[0].startswith("_")]
    begins = {p.name: p.read_text(encoding="utf-8").split("\n\n", 2)[1] for p in pages}
    assert [name for name, first in begins.items() if not first.startswith("After this page you")] == []


@pytest.mark.usefixtures("known_answers", "tests_alone")
@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_a_tutorial_does_what_it_says(page: Path, tmp_path: Path) -> None:
    for example in (ROOT / "docs" / "examples").glob("*.gz"):
        shutil.copy(example, tmp_path)
    started: list[subprocess.Popen[bytes]] = []
    said = ""
    try:
        for language, block in BLOCK.findall(page.read_text(encoding="utf-8")):
            if language == "python":
                said += _done([PYTHON, "-c", block], tmp_path)
                continue
            for line in block.splitlines():
                words = [PYTHON, "-m", "gyrocal", *line.rstrip("& ").split()[1:]]
                if line.endswith("&"):
                    started.append(subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.DEVNULL))
                    _wait_for(tmp_path / "PORT")
                else:
                    said += _done(words, tmp_path)
    finally:
        for process in started:
            process.terminate()
            process.wait(timeout=60)
    assert "adequate" in said


def _done(words: list[str], folder: Path) -> str:
    if words[:3] == [sys.executable, "-m", "gyrocal"]:  # in this process, whose imports are done
        with contextlib.chdir(folder), redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
            code = main(words[3:])
        assert code == 0, f"{' '.join(words[3:])}: {err.getvalue()}"
        assert err.getvalue() == "" or err.getvalue().startswith("warning:"), err.getvalue()
        return out.getvalue()
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, f"{' '.join(words[2:])}: {done.stderr}"
    assert done.stderr == "" or done.stderr.startswith("warning:"), done.stderr
    return done.stdout


def _wait_for(path: Path) -> None:
    for _ in range(600):
        if path.exists():
            return
        time.sleep(0.1)
    pytest.fail(f"{path.name} did not appear")


@pytest.mark.wide
@pytest.mark.usefixtures("known_answers", "tests_alone")
def test_the_notebook_runs_and_its_error_falls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "Agg")
    shutil.copytree(ROOT / "docs" / "examples", tmp_path / "examples")
    realdata = Path(os.environ.get("GYROCAL_REALDATA") or ROOT.parent / "shared" / "realdata")
    chamber = realdata / "thermal_chamber_imu" / "imu_raw_data.tsv"
    if chamber.exists():
        rows = chamber.read_text(encoding="utf-8").splitlines(keepends=True)[:3000]  # the first third of it
        (tmp_path / chamber.name).write_text("".join(rows), encoding="utf-8")
    cells = json.loads((ROOT / "docs" / "notebooks" / "story.ipynb").read_text(encoding="utf-8"))["cells"]
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    if sys.executable == PYTHON:
        with contextlib.chdir(tmp_path), redirect_stdout(StringIO()) as out:
            exec(code, {"__name__": "__main__"})
        said = out.getvalue()
    else:
        said = _done([PYTHON, "-c", code], tmp_path)
    excess = re.search(r"scale_asymmetry: excess (\S+) mdps before, (\S+) after", said)
    assert excess is not None, said
    assert float(excess[2]) < 0.2 * float(excess[1])
    assert not chamber.exists() or re.search(r"bias_temperature|temperature", said)


@pytest.fixture(scope="module")
def site() -> ModuleType:
    folder = ROOT / "docs" / "_site"
    sys.path.insert(0, str(folder))
    try:
        spec = importlib.util.spec_from_file_location("site_of_docs", folder / "site.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module
    finally:
        sys.path.remove(str(folder))


def test_the_site_has_no_broken_link_and_every_page_is_in_its_menu(site: ModuleType) -> None:
    done = subprocess.run([sys.executable, site.__file__], capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    pages = {p.relative_to(site.PAGES).as_posix() for p in site.PAGES.rglob("*.md")}
    menu = set(re.findall(r"(\S+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE))
    assert menu <= pages
    assert {p for p in pages - menu if not p.startswith("effects/")} == set()
    built = site.PAGES.parent / "site"
    outside = {a for p in built.rglob("*.html") for a in re.findall(r'(?:src|<link[^>]*href)="(https?:[^"]*)"', p.read_text())}
    assert outside == set()
    assert "google" not in (built / "index.html").read_text(), "fonts are those of the system"
    gallery = (built / "effects" / "index.html").read_text()
    assert all(f'src="{kind.id}.svg"' in gallery for kind in effect_pages.kinds())
    home = (built / "index.html").read_text()
    assert '"content.code.copy"' in home
    assert re.search(r'<span class="c1"># the whole story', home), "commands are coloured"


def test_commands_are_marked_and_long_sentences_of_transcripts_wrapped(site: ModuleType) -> None:
    long = "word " * 40
    commands = "Type:\n\n    gyrocal compare s\n    gyrocal add s\n\nIt says:\n\n"
    text = f"{commands}    {long}\n    │ {long} │\n\n- a\n\n    make b\n\nEnd\n"
    marked = site._with_commands_marked(text)
    assert "Type:\n\n```bash\ngyrocal compare s\ngyrocal add s\n```\n\nIt says:" in marked
    sentence, row = marked.split("It says:\n\n")[1].split("\n    │")
    assert all(line.startswith("    ") and len(line) <= site.WIDTH for line in sentence.split("\n"))
    assert " ".join(sentence.split()) == long.strip()
    assert row.startswith(f" {long}"), "a row of a table is as wide as it is"
    assert "- a\n\n    make b\n" in marked, "a block of a list's item is its own"


def test_a_link_to_nowhere_is_refused(site: ModuleType) -> None:
    places = {"docs/a.md": "a.md", "README.md": "index.md"}
    text = "[b](../README.md#start) ![c](images/d.png) [e](#here) [f](https://f.org)"
    turned = site._turned(text, "docs/a.md", "a.md", places)
    assert turned == "[b](index.md#start) ![c](images/d.png) [e](#here) [f](https://f.org)"
    with pytest.raises(SystemExit, match=r"docs/a.md: the link b.md leads to no page"):
        site._turned("[b](b.md)", "docs/a.md", "a.md", places)
