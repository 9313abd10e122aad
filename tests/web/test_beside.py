"""A card says what the next screen shows: beside what is named, and over the noise that all that is named leaves."""

from __future__ import annotations

from pathlib import Path

import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.diagnosis.residual.levels import explained
from gyrocal.simulation.simulate import simulate
from gyrocal.web.worker.beside_named import as_shown
from known import ON_Z, add_measured

pytestmark = pytest.mark.usefixtures("known_answers", "tests_alone")


@pytest.mark.wide
def test_two_effects_on_one_axis_do_not_both_explain_all() -> None:
    """Each explained 100 %; after the first was added, it had explained half."""
    session, _ = simulate(None, "full", ["scale_asymmetry", "g_sensitivity"], 3, scenarios=3, seconds=8.0)
    found = diagnose(session, ON_Z)
    shown = [c for c in as_shown(found) if c.axis == "z" and c.decision == "add"]
    assert shown[0].named  # what is sure comes first
    assert [c.named for c in shown] == sorted((c.named for c in shown), reverse=True)
    by_id = {c.effect.id: c for c in shown}
    own = {c.effect.id: c.explained for c in found.candidates if c.axis == "z" and c.decision == "add"}
    assert {"g_sensitivity", "scale_asymmetry"} <= by_id.keys()
    assert own["g_sensitivity"] > 0.95
    made = add_measured(session, ON_Z, "g_sensitivity")
    part = explained(made.before.per_axis["z"], made.after.per_axis["z"], made.after.cycles)
    assert by_id["g_sensitivity"].explained < 0.9
    assert by_id["g_sensitivity"].explained + by_id["scale_asymmetry"].explained == pytest.approx(1.0, abs=0.15)
    assert by_id["g_sensitivity"].explained == pytest.approx(part, abs=0.1)


def test_another_course_of_what_is_named_is_no_hint(tmp_path: Path) -> None:
    """Beside a ripple of the table stood a tone of the same course, with the ripple's evidence."""
    session, _ = simulate(None, "paper", ["table_ripple"], 3, scenarios=3, seconds=15.0)
    found = diagnose(session, ON_Z)
    hinted = {c.effect.id for c in found.candidates if c.decision == "suggest" and c.axis == "z"}
    assert "order_tone" in hinted
    shown = {c.effect.id: c for c in as_shown(found) if c.axis == "z"}
    assert shown["order_tone"].decision == "reject"
    assert shown["table_ripple"] is next(c for c in found.candidates if c.named)
