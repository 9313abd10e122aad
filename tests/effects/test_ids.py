"""The id of an effect or a noise stands in its own file alone: nothing else knows one of them by name."""

import ast
from collections.abc import Iterator
from pathlib import Path

from gyrocal.effects.base import effects
from gyrocal.noise.axis import COMPONENTS

ROOT = Path(__file__).resolve().parents[2]
FILES = [*(ROOT / "host/gyrocal").rglob("*.py"), *(ROOT / "model_export").rglob("*.py")]
KINDS = {**effects(), **COMPONENTS}
FIELDS = set(KINDS) & {p.name for kind in KINDS.values() for p in kind.parameters}
"""Ids that are names of parameters too (scale): as keys of answers, sentences and options they name no effect."""
ALLOWED = {
    ("host/gyrocal/simulation/campaigns.py", "table_ripple"): "data: what each run of the campaign table2 has",
    ("host/gyrocal/simulation/campaigns.py", "spin_up"): "data: what each run of the campaign table2 has",
    ("host/gyrocal/noise/drift.py", "drift"): "the name of the model's field; the effect of this id is another thing",
    ("host/gyrocal/calibration/header.py", "scale"): "a comment's name of the last parameter",
    ("host/gyrocal/demo.py", "scale"): "a field of the sentence $CAL",
    ("host/gyrocal/gravity/calibrate.py", "misalignment"): "a key of the result",
    ("host/gyrocal/gravity/budget.py", "bias"): "a source of error in the budget",
    ("host/gyrocal/calibration/budget.py", "drift"): "a source of error in the budget",
    ("host/gyrocal/simulation/hands.py", "misalignment"): "a key of the truth file",
    ("host/gyrocal/simulation/hands.py", "clock_error"): "a key of the truth file",
    ("model_export/gyrocal_export/gyrocal_header.py", "bias"): "an array of a layer",
    ("host/gyrocal/present/notebook.py", "scale"): "a label of an axis of a picture",
    **{
        (f"host/gyrocal/calibration/targets/{target}.py", name): "what another program's file holds"
        for target, names in {
            "base": ("scale", "bias", "misalignment", "bias_temperature"), "kalibr": ("colored_noise",),
            "px4": ("bias", "bias_temperature"), "ardupilot": ("bias", "bias_temperature"), "c": ("misalignment",),
            "ros2": ("scale", "bias", "misalignment", "colored_noise"), "slam": ("colored_noise",),
            "imu_tk": ("scale", "bias", "misalignment"),
            "vqf": ("scale", "bias", "misalignment", "turn_on_bias", "colored_noise"),
        }.items() for name in names
    },
    ("host/gyrocal/device/monitor.py", "scale"): "a field of the sentence $CAL",
    **{
        (f"host/gyrocal/web/{name}.py", field): "a field of an answer"
        for name, field in (("device/coach", "scale"), ("pictures/scatter", "scale"), ("pictures/scatter", "bias"))
    },
}


def written_in(source: str) -> Iterator[str]:
    """Ids among the string literals of Python source, as a whole or before ``:name=value``; keys that are fields left out."""
    tree = ast.parse(source)
    keys = {id(key) for node in ast.walk(tree) if isinstance(node, ast.Dict) for key in node.keys}
    keys |= {id(node.slice) for node in ast.walk(tree) if isinstance(node, ast.Subscript)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            name = node.value.partition(":")[0]
            if name in KINDS and not (name in FIELDS and id(node) in keys):
                yield name


def test_ids_stand_in_their_own_files() -> None:
    own = {(ROOT / "host" / f"{type(kind).__module__.replace('.', '/')}.py", kind.id) for kind in KINDS.values()}
    found = {(path, name) for path in FILES for name in written_in(path.read_text(encoding="utf-8"))} - own
    assert {(str(path.relative_to(ROOT)), name) for path, name in found} == set(ALLOWED)


def test_an_id_is_seen() -> None:
    assert list(written_in('if kind.id == "scale": pass')) == ["scale"]
    assert list(written_in('x = {"table_ripple": 1}["scale"]')) == ["table_ripple"]
    assert list(written_in('simulate("warmup:A_dps=0.1")')) == ["warmup"]
