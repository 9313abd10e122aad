"""A verdict contradicts no figure beside it: a misfit without excess says what it stands on, an adequate one what is left."""

import re
from typing import Any

import pytest

from gyrocal.api import compare, diagnose
from gyrocal.diagnosis.naming.candidate import Candidate, Decision
from gyrocal.effects.base import effects
from gyrocal.present import report
from gyrocal.present.output import stdout
from gyrocal.present.verdict import adequate, first_sentence, high_floor, nothing_found, stands_on
from gyrocal.simulation.simulate import simulate

FOUND = {"axis": "z", "against": "table_angle", "strength": 9.27, "note": "0.2 deg rms"}


def told(verdict: str, excess: float | None, se: float | None, unit: str = "dps") -> dict[str, Any]:
    residual = "angle" if unit == "deg" else "rate"
    where = [FOUND] if verdict == "misfit" else []
    return {"residual": residual, f"excess_{unit}": excess, f"excess_se_{unit}": se, "verdict": verdict, "where": where}


@pytest.mark.parametrize("unit", ["dps", "deg"])
@pytest.mark.parametrize(("excess", "se"), [(0.0, 0.74), (0.9, 0.5)])
def test_a_misfit_beside_no_certain_excess_names_its_finding(unit: str, excess: float, se: float) -> None:
    words = stands_on(told("misfit", excess, se, unit))
    assert "on z, against table angle (9.3 σ)" in words
    assert "does not contradict" in words


@pytest.mark.parametrize(
    ("verdict", "excess", "se"),
    [("misfit", 1.5, 0.5), ("misfit", None, None), ("adequate", 0.0, 0.5), ("implausible", 0.0, 0.5)],
)
def test_where_both_agree_nothing_is_added(verdict: str, excess: float | None, se: float | None) -> None:
    assert stands_on(told(verdict, excess, se)) == ""


def test_a_weak_tone_is_proven_by_its_line_and_not_by_the_excess() -> None:
    """A tone far below the noise of one reading: the spectrum shows it, and the error as a whole hardly grows."""
    session, _ = simulate(None, "full", ["vibration_tone:f_hz=31,A_dps=0.004"], 5, scenarios=1, seconds=20.0)
    found = compare(session)
    assert found.verdict == "misfit"
    level = found.pooled
    assert level.excess_dps is not None
    assert level.excess_se_dps is not None
    with stdout.capture() as capture:
        report.print_comparison(found)
    words = " ".join(capture.get().split())
    assert ("The verdict rests on" in words) == (level.excess_dps < 2 * level.excess_se_dps)
    assert "The verdict rests on" in words


Pair = tuple[float, float]


def levels(y: Pair, together: Pair = (0.0, 1.0), unit: str = "dps", **keys: Any) -> dict[str, Any]:
    """What compare says of a model that is adequate, with the excess of y and of all axes, each with its standard error."""
    def level(excess: float, se: float) -> dict[str, float]:
        return {f"excess_{unit}": excess, f"excess_se_{unit}": se}

    per_axis = {"x": level(1e-3, 1e-3), "y": level(*y)}
    return {**told("adequate", *together, unit), "per_axis": per_axis, "warnings": [], **keys}


NOISE = "The model is adequate: what is left over is noise."
MORE = "No test finds what the model lacks, but more than noise is left over: an excess of "
MOVED = "No parameter has moved, and no test finds what the model lacks, but more than noise is left over: an excess of "


@pytest.mark.parametrize(
    ("compared", "words"),
    [
        (levels((1.37, 0.05)), f"{MORE}1.370 ± 0.050 dps on y."),
        (levels((0.137, 0.05)), NOISE),
        (levels((0.137, 0.03), unit="deg"), f"{MORE}0.137 ± 0.030 deg on y."),
        (levels((0.0, 0.1), (0.03, 0.004)), f"{MORE}30.0 ± 4.0 mdps on all axes together."),
        (levels((1.37, 0.05), as_is=True), f"{MOVED}1.370 ± 0.050 dps on y."),
        (levels((0.0, 0.1), as_is=True), "The model still holds, and no parameter has moved: what is left over is noise."),
    ],
)
def test_what_is_left_over_is_noise_only_beside_no_certain_excess(compared: dict[str, Any], words: str) -> None:
    """Beside an excess of 1.37 +- 0.05 dps stood that what is left over is noise."""
    assert adequate(compared) == words


ON_X = "The model is adequate on x: what is left over there is noise. The warning against y stands."


@pytest.mark.parametrize(("code", "blocking", "words"), [("sign_flipped", True, ON_X), ("axis_absent", False, NOISE)])
def test_the_excess_of_an_axis_that_is_not_judged_is_not_told(code: str, blocking: bool, words: str) -> None:
    compared = levels((1.37, 0.05), (1.0, 0.05), warnings=[{"code": code, "axis": "y", "blocking": blocking}])
    assert adequate(compared) == words


def test_nothing_found_says_of_how_many_effects() -> None:
    """At constant rates with a delay, which they do not show, it said that nothing is missing."""
    def judged(effect: str, axis: str, decision: Decision) -> Candidate:
        return Candidate(effects()[effect], axis, decision)

    seen = [judged("drift", "x", "reject"), judged("centripetal", "x", "not_measurable"), judged("centripetal", "z", "reject")]
    unseen = [judged("lag", "x", "not_measurable"), judged("lag", "z", "not_measurable")]
    quiet = levels((0.0, 1.0))
    assert nothing_found([*seen, *unseen], quiet) == (
        "Nothing found of 2 effects; 1 this recording cannot show."
    )  # an effect that it cannot show may act: that noise alone is left over would deny it
    assert nothing_found(seen[:1], quiet) == "Nothing found of 1 effect."
    assert nothing_found(seen, levels((1.37, 0.05))) == (
        "Nothing found of 2 effects. More than noise is left over: an excess of 1.370 ± 0.050 dps on y."
    )
    assert nothing_found([judged("vibration_tone", "z", "suggest"), *seen, *unseen], quiet) == (
        "Nothing certain of 3 effects; suggested: vibration_tone on z; 1 this recording cannot show."
    )


def test_where_nothing_is_held_out_nobody_knows_that_noise_alone_is_left() -> None:
    """Of 0.8 s with a tone of 16 standard errors, it said that what is left over is noise."""
    unknown = levels((0.0, 1.0)) | {"held_out": "none"}
    assert adequate(unknown).startswith("No test finds what the model lacks. No part of the recording can be held out")


def test_a_delay_that_constant_rates_cannot_show_is_not_said_to_be_absent() -> None:
    session, _ = simulate(None, "paper", ["lag:tau_s=0.005"], 3, scenarios=3, seconds=10.0)
    found = diagnose(session)
    assert found.verdict == "adequate"
    assert "lag" in {c.effect.id for c in found.candidates if c.decision == "not_measurable"}
    assert re.search(r"Nothing found of \d+ effects; \d+ this recording cannot show\.", found.summary())
    assert "left over is noise" not in found.summary()
    assert "Nothing is missing" not in found.summary()


@pytest.mark.parametrize("text", ["Given by the user as a formula.", "It is so. It is not so.", "It is so"])
def test_a_first_sentence_ends_with_one_full_stop(text: str) -> None:
    """A cause of one sentence was told with two."""
    told = first_sentence(text)
    assert text.startswith(told.removesuffix("."))
    assert told.count(".") == 1


@pytest.mark.parametrize(("rms", "floor", "axes"), [(71.0, 92.5, "x and y"), (92.4, 92.5, ""), (95.0, 92.5, "")])
def test_a_floor_above_the_rms_is_told(rms: float, floor: float, axes: str) -> None:
    """A floor of 92.5 stood beside an rms of 71.0 and an excess of 0.0 without a word."""
    level = {"rms_dps": rms, "floor_dps": floor, "excess_dps": 0.0, "excess_se_dps": 5.0}
    words = high_floor({"residual": "rate", "per_axis": {"x": level, "y": level, "z": {**level, "excess_se_dps": None}}})
    assert words.startswith(f"On {axes} the noise floor is above the rms") == bool(axes)
    assert bool(words) == bool(axes)
