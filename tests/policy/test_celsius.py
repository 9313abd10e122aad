"""What people read says °C; files, JSON keys and the units of effects' parameters say degC."""

import ast
import json
from pathlib import Path

import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.present import report
from gyrocal.simulation.simulate import simulate
from gyrocal.units import CELSIUS, IN_FILES, to_read
from known import ON_Z

HOST = Path(__file__).resolve().parents[2] / "host/gyrocal"
SPELLED = {
    "units.py",
    "guess.py", "column_map.py", "column_names.py", "text.py",  # of mappings and of the headers of files
    "ardupilot.py", "px4.py",  # parameter files
}  # fmt: skip


def strings(source: str) -> list[str]:
    """The strings of a module but docstrings and the units of parameters, whose file and JSON names are pinned."""
    tree = ast.parse(source)
    other = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    calls = (n for n in ast.walk(tree) if isinstance(n, ast.Call) and getattr(n.func, "id", "") == "Parameter")
    other |= {id(call.args[1]) for call in calls}
    constants = (n for n in ast.walk(tree) if isinstance(n, ast.Constant) and id(n) not in other)
    return [n.value for n in constants if isinstance(n.value, str)]


def test_no_sentence_and_no_label_says_it_otherwise() -> None:
    files = [path for path in sorted(HOST.rglob("*.py")) if path.name not in SPELLED]
    assert len(files) > 300
    every = [(path.relative_to(HOST), text) for path in files for text in strings(path.read_text(encoding="utf-8"))]
    assert [(path, text) for path, text in every if IN_FILES in text] == []


def test_a_sentence_is_seen() -> None:
    assert strings('"""degC"""\nA = f"{1} degC"\nB = Parameter("k", "dps/degC", "per degC")') == [" degC", "k", "per degC"]


@pytest.mark.slow
@pytest.mark.usefixtures("tests_alone")
def test_sizes_are_read_in_one_unit_and_written_in_the_other() -> None:
    session, _ = simulate(None, "full", ["bias_temperature"], 3, scenarios=1, seconds=20.0)
    found = diagnose(session, ON_Z)
    thermal = next(c for c in found.candidates if c.effect.id == "bias_temperature" and c.axis == "z" and c.values)
    assert f"dps/{CELSIUS}" in report.sizes(thermal)
    assert IN_FILES not in report.sizes(thermal)
    assert '"unit": "dps/degC"' in json.dumps(thermal.to_json())


def test_compound_units() -> None:
    assert [to_read(u) for u in ("degC", "dps/degC^2", "dps·s/degC", "deg")] == ["°C", "dps/°C^2", "dps·s/°C", "deg"]
