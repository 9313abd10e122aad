"""A verdict of misfit beside an excess of zero says what it stands on; where both agree, nothing is added."""

from typing import Any

import pytest

from gyrocal.api import compare
from gyrocal.present import report
from gyrocal.present.output import stdout
from gyrocal.present.verdict import stands_on
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
    assert ("The verdict stands on" in words) == (level.excess_dps < 2 * level.excess_se_dps)
    assert "The verdict stands on" in words
