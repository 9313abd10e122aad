"""The sentence of a verdict names only effects that can make what it describes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from gyrocal.diagnosis.answer.diagnose import Diagnosis
from gyrocal.diagnosis.naming.candidate import Candidate
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.effects.base import effects
from gyrocal.present.report import verdict_text


@pytest.mark.parametrize(
    ("band_hz", "named"),
    [
        (None, "misalignment or vibration_tone"),
        ((0.4, 0.9), "misalignment or vibration_tone"),
        ((30.7, 32.7), "vibration_tone"),
        ((31.6, 31.6), "vibration_tone"),
    ],
)
def test_a_slow_effect_is_not_offered_for_a_fast_disturbance(band_hz: tuple[float, float] | None, named: str) -> None:
    library = effects()
    suggested = [Candidate(library[name], "z", "suggest") for name in ("misalignment", "vibration_tone")]
    comparison: Any = SimpleNamespace(
        where=[Finding("z", "frequency", 17.5, 1e-9, 0.05, "a disturbance", band_hz=band_hz)], held_out="none"
    )
    unknown = {"axis": "z", "against": "frequency", "shape": "a disturbance", "amplitude_dps": 0.05}
    assert f"It may be {named}, but" in verdict_text(Diagnosis("unknown", suggested, unknown, comparison))


def test_every_named_effect_is_in_the_sentence() -> None:
    """Of a tone and an asymmetry that is larger, the headline named the tone alone."""
    library = effects()
    pair = ["scale_asymmetry", "centripetal"]
    found = [
        Candidate(library["vibration_tone"], "z", "add"),
        *(Candidate(library[name], "z", "add", group=pair) for name in pair),
        Candidate(library["lag"], "z", "suggest"),
    ]
    comparison: Any = SimpleNamespace(fit=SimpleNamespace(session=SimpleNamespace(runs=())), where=[])
    told = verdict_text(Diagnosis("add", found, None, comparison))
    assert told.startswith("Missing: a vibration's tone on z. ")
    assert told.endswith(" Also: centripetal acceleration or asymmetry of the scale on z.")
    assert "Also" not in verdict_text(Diagnosis("add", found[:1], None, comparison))


def test_what_is_sure_comes_before_a_question() -> None:
    """Beside a proven sensitivity to gravity, the headline asked for a measurement that the session has."""
    library = effects()
    pair = ["scale_asymmetry", "centripetal"]
    found = [Candidate(library[name], "z", "add", group=pair) for name in pair]
    found.append(Candidate(library["g_sensitivity"], "z", "add"))
    comparison: Any = SimpleNamespace(fit=SimpleNamespace(session=SimpleNamespace(runs=())), where=[])
    told = verdict_text(Diagnosis("ambiguous", found, None, comparison))
    assert told.startswith("Missing: sensitivity to gravity and acceleration on z. ")
    assert told.endswith(" Also: centripetal acceleration or asymmetry of the scale on z.")
    assert verdict_text(Diagnosis("ambiguous", found[:2], None, comparison)).startswith("One of ")
