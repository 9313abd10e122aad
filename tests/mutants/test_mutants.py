"""Edits are what a careless hand would do, each in one place; what the tests let pass is said."""

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from mutant_edits import Edit, c_edits, python_edits

import mutants

PYTHON = '''
def f(x: int = 3, *, k: float = 0.5) -> list[int]:
    """At least 4 words."""
    if x < 2 and not k:  # µ
        return max(x - 1, -x)
    return sorted([x * k], reverse=True)
'''
C = """
static int f(int x) { /* at least 4 */
    if (x < 2 && !g("a < b")) {
        d->n = fmin(x, 0.5);
        g(-x, y & 0x0F);
    }
    return x - 1;
}
"""


def replaced(text: str, edits: Iterator[Edit]) -> set[tuple[str, str, str]]:
    return {(e.kind, text[e.start : e.stop], e.new) for e in edits}


def test_python_edits() -> None:
    assert replaced(PYTHON, python_edits(PYTHON)) == {
        ("off by one", "3", "4"), ("constant scaled", "0.5", "1.0"), ("off by one", "2", "3"), ("off by one", "1", "2"),
        ("comparison", "x < 2", "x <= 2"), ("comparison", "x < 2", "x >= 2"), ("not", "not k", "(k)"),
        ("and, or", "x < 2 and not k", "(x < 2 or not k)"), ("arithmetic", "x - 1", "(x + 1)"), ("sign", "-x", "(x)"),
        ("min, max", "max(x - 1, -x)", "min(x - 1, -x)"), ("arithmetic", "x * k", "(x / k)"),
        ("argument dropped", "sorted([x * k], reverse=True)", "sorted([x * k])"),
    }  # fmt: skip


def test_the_border_of_a_comparison_counts_for_whole_numbers_alone() -> None:
    made = {edit.new for edit in python_edits("a < b, len(a) > b, a <= b.size, a >= 1.5")}
    assert made == {"a >= b", "len(a) >= b", "len(a) <= b", "a < b.size", "a > b.size", "a < 1.5", "3.0"}


def test_c_edits() -> None:
    assert replaced(C, c_edits(C)) == {
        ("operator", "<", "<="), ("operator", "<", ">="), ("operator", "&&", "||"), ("not", "!", ""), ("off by one", "2", "3"),
        ("off by one", "1", "2"), ("operator", "-", "+"), ("min, max", "fmin", "fmax"), ("constant scaled", "0.5", "1.0"),
        ("statement dropped", "d->n = fmin(x, 0.5);", ";"), ("arguments swapped", "x, 0.5", "0.5, x"), ("sign", "-", ""),
        ("operator", "&", "|"), ("off by one", "0x0F", "0x10"), ("statement dropped", "g(-x, y & 0x0F);", ";"),
        ("arguments swapped", "-x, y & 0x0F", "y & 0x0F, -x"), ("not", "", "!"),
    }  # fmt: skip


def test_an_edited_text_is_another_program() -> None:
    for edit in python_edits(PYTHON):
        assert ast.dump(ast.parse(edit.of(PYTHON))) != ast.dump(ast.parse(PYTHON)), edit


def test_a_draw_is_that_of_its_seed_and_compiles() -> None:
    every = [m for m in mutants.mutants(["noise", "core"]) if m.folder == "noise" or m.file.endswith("gc_rest.c")]
    drawn = [m.key for m in mutants.draw(every, 4, 7)]
    assert drawn == [m.key for m in mutants.draw(every, 4, 7)]
    assert drawn != [m.key for m in mutants.draw(every, 4, 8)]
    assert len(set(drawn)) == 4
    assert {m.file.rpartition(".")[2] for m in every} == {"py", "c"}
    broken = mutants.Mutant("host/gyrocal/units.py", "noise", mutants.Edit("none", 0, 0, "("))
    assert not broken.compiles()
    same = mutants.Mutant(str(mutants.CORE / "gc_span.c"), "core", mutants.Edit("none", 0, 0, "\n"))
    assert not same.compiles()


def test_files_that_call_the_edited_function_come_by_what_they_caught_and_by_name() -> None:
    edited = mutants.Mutant(str(mutants.CORE / "gc_span.c"), "core", mutants.Edit("none", 0, 0, ";"))
    files = {"quick": 1.0, "apart": 2.0, "often": 3.0, "same": 4.0, "test_span": 5.0, "uncounted": 6.0}
    called = {edited.line}
    reached = {"quick": called, "apart": {("gc_span.c", 1)}, "often": called, "same": called, "test_span": called}

    def caught(file: str, by: str) -> mutants.Judged:
        return mutants.Judged("", file, "core", "", "caught", 1.0, [], "", by)

    judged = [caught("gc_wire.c", "often"), caught("gc_run.c", "often"), caught(edited.file, "same")]
    assert mutants.by_promise(files, edited, judged, reached) == ["same", "test_span", "often", "quick", "uncounted"]
    assert set(mutants.by_promise(files, edited, judged, {"apart": {("gc_span.c", 1)}})) == files.keys() - {"apart"}


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A tree with one function, of which the tests know half."""
    root = tmp_path / "tree"
    package, tests = root / "host" / "gyrocal" / "noise", root / "tests" / "noise"
    package.mkdir(parents=True)
    tests.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package.parent / "__init__.py").write_text("")
    (package / "half.py").write_text("def half(x):\n    return x / 2 if x > 0 else 0\n")
    (tests / "test_half.py").write_text("from gyrocal.noise.half import half\n\ndef test_half():\n    assert half(4) == 2\n")
    monkeypatch.setattr(mutants, "ROOT", root)
    subprocess.run(["git", "init", "-q"], cwd=root, check=True)
    return root


@pytest.mark.wide
def test_survivors_are_shown_and_what_was_judged_is_not_judged_again(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "mutants.jsonl"
    command = ["mutants.py", "--folders", "noise", "-n", "100", "--out", str(out)]
    monkeypatch.setattr(sys, "argv", command)
    mutants.main()
    rows = [json.loads(line) for line in out.read_text().splitlines()]
    survived = {row["diff"].splitlines()[-1].strip() for row in rows if row["result"] == "survived"}
    assert survived == {f"+    return x / 2 if x {rest}" for rest in (">= 0 else 0", "> 1 else 0", "> 0 else 1")}
    assert {row["kind"] for row in rows if row["result"] == "caught"} == {"arithmetic", "off by one", "comparison"}
    assert "x >= 0" in capsys.readouterr().out
    mutants.main()
    assert out.read_text().count("\n") == len(rows)
    assert "0 judged now" in capsys.readouterr().out
    test = project / "tests" / "noise" / "test_half.py"
    test.write_text(test.read_text() + "    assert half(1) == 0.5\n    assert half(-1) == 0\n")
    monkeypatch.setattr(sys, "argv", [*command, "--again"])
    mutants.main()
    assert "3 judged now" in (said := capsys.readouterr().out)
    assert "1 survived" in said  # at 0 both branches are 0
