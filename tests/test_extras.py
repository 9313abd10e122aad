"""An installation without extras: what it does, and what it says where a package is missing."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from gyrocal import api
from gyrocal.cli import main
from gyrocal.errors import InputError
from gyrocal.extras import EXTRAS, needed, want

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OF_EXTRAS = ("onnxruntime", "nicegui", "matplotlib", "jinja2", "distributed", "pyulog", "rosbags")


def packages(lines: list[str]) -> set[str]:
    return {re.split(r"[><=\[]", line)[0] for line in lines}


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("extras") / "s"
    words = ["--scenarios", "3", "--seconds", "6", "--effect", "table_ripple:amplitude_1=0.003"]
    assert main(["simulate", str(path), *words]) == 0
    return str(path)


def said(words: str, session: str) -> list[str]:
    data, examples = ROOT / "host" / "gyrocal" / "data", ROOT / "docs" / "examples"
    given = {"SESSION": session, "LOG": str(examples / "swing.csv.gz"), "MODEL": str(data / "table2" / "model.toml")}
    return [given.get(word, word) for word in words.split()]


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """An environment that holds none of the extras."""
    for name in OF_EXTRAS:
        for loaded in [m for m in sys.modules if m == name or m.startswith(f"{name}.")]:
            monkeypatch.delitem(sys.modules, loaded)
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.chdir(tmp_path)


def test_the_extras_are_those_of_the_project() -> None:
    optional = PROJECT["optional-dependencies"]
    for extra, modules in EXTRAS.items():
        assert set(modules) <= packages(optional[extra]), extra
    assert packages(PROJECT["dependencies"]).isdisjoint(OF_EXTRAS)


def test_developers_get_what_the_tests_need() -> None:
    optional = PROJECT["optional-dependencies"]
    # `make test` names train, which has constraints of its own; rivals is for one benchmark
    for extra in set(optional) - {"dev", "train", "rivals"}:
        assert packages(optional[extra]) <= packages(optional["dev"]), extra


@pytest.mark.parametrize(
    "words",
    [
        "compare SESSION --json", "diagnose SESSION --json", "explain SESSION --model m.toml --json",
        "calibrate SESSION --method baseline --seconds 4 --json", "export --model MODEL --format json --out out",
        "import LOG lab --yes", "simulate new --scenarios 1 --seconds 4",
    ],
)  # fmt: skip
@pytest.mark.usefixtures("bare", "known_answers")
def test_the_core_works_without_extras(words: str, session: str) -> None:
    assert main(said(words, session)) == 0


@pytest.mark.parametrize(
    ("words", "extra"),
    [
        ("calibrate SESSION --method cnn", "net"), ("calibrate SESSION --method baseline,cnn", "net"), ("verify", "net"),
        ("compare SESSION --html page.html", "plot"), ("compare SESSION --pictures p", "plot"), ("demo", "net,plot"),
        ("explain SESSION --model m.toml --html page.html", "plot"), ("workbench --no-browser", "page"),
        ("import LOG lab --yes --preview lab.png", "plot"), ("fleet fit SESSION", "fleet,plot"),
        ("fleet fit SESSION --workers 0", "plot"),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("bare")
def test_a_verb_that_lacks_its_extra_says_so_in_one_line(
    words: str, extra: str, session: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(said(words, session)) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert f"pip install 'gyrocal[{extra}]'" in told
    assert list(Path().iterdir()) == [], "nothing is written before"


@pytest.mark.usefixtures("bare")
def test_calibrate_leaves_the_network_out_and_says_so(session: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", session, "--seconds", "4", "--json"]) == 0
    told = capsys.readouterr()
    assert {e["method"] for e in json.loads(told.out)["estimates"]} == {"baseline"}
    assert told.err == "cnn is left out, because it needs onnxruntime: pip install 'gyrocal[net]'\n"
    assert main(["calibrate", session, "--seconds", "4", "--method", "baseline", "--json"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.usefixtures("bare")
def test_a_network_that_does_not_suit_is_not_missed(capsys: pytest.CaptureFixture[str]) -> None:
    """At another table rate the network has no answer, with onnxruntime or without."""
    assert main(["simulate", "slow", "--campaign", "full", "--scenarios", "1", "--seconds", "5", "-q"]) == 0
    table = Path("slow/session.toml")
    table.write_text(re.sub(r'scenario = "\w+"', 'scenario = "one"', table.read_text()))
    assert main(["calibrate", "slow", "--seconds", "4", "--json"]) == 0
    told = capsys.readouterr()
    assert "baseline" in {e["method"] for e in json.loads(told.out)["estimates"]}
    assert told.err == ""


@pytest.mark.usefixtures("bare")
def test_a_picture_in_python_names_what_draws_it(session: str) -> None:
    with pytest.raises(InputError, match=r"pip install 'gyrocal\[plot\]'"):
        api.Session.open(session).plot()


def test_several_extras_are_one_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    monkeypatch.setitem(sys.modules, "jinja2", None)
    with pytest.raises(InputError, match=r"it needs onnxruntime, jinja2, .* pip install 'gyrocal\[net,plot\]'"):
        want("it", "net", "plot")
    want("it", "fleet")
    assert needed("json", "net", "it") is json


def test_the_import_of_the_interface_imports_nothing_heavy() -> None:
    code = "import sys, gyrocal.api; print({'numpy', 'scipy', 'polars', 'pydantic', 'matplotlib'} & set(sys.modules))"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "set()\n"


def test_the_whole_interface_imports_no_statistics_and_no_pictures() -> None:
    every = "import sys, gyrocal.api as api; [getattr(api, name) for name in api.__all__]"
    code = f"{every}; print({{'scipy.stats', 'scipy.special', 'matplotlib', 'onnxruntime', 'jinja2'}} & set(sys.modules))"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "set()\n"


def test_every_name_of_the_interface_is_found() -> None:
    assert {*api.MODULE_OF, "notebook"} == set(api.__all__)
    assert set(api.__all__) <= set(dir(api))
    with pytest.raises(AttributeError, match="no attribute 'comparee'"):
        _ = api.comparee
