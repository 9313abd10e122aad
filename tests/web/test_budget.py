"""The error budget on the page is that of the command line."""

from __future__ import annotations

import re
from dataclasses import replace

from gyrocal.calibration.calibrate import calibrate
from gyrocal.digits import percent
from gyrocal.present.budget import shown
from gyrocal.simulation.simulate import simulate
from gyrocal.web.values.budget import Budget, Line, of_answers


def test_every_source_of_the_command_line_is_shown_with_its_size_and_advice() -> None:
    session, _ = simulate(scenarios=1, seconds=8, seed=1)
    found = calibrate(session, [4.0], ["baseline"])
    budget, best = of_answers(found), shown(found)
    assert budget is not None
    assert best is not None
    expected = {(row.source, row.scale, row.advice) for row in best.budget}
    assert {(line.source, line.scale, line.advice) for line in budget.lines} == expected
    told = budget.table()
    for row in best.budget:
        share = row.scale != 0 or row.bias_dps != 0
        assert (row.advice.replace("'", "&#x27;") in told) == share  # nothing has to be lowered below nothing
        shown_as = "0" if row.scale == 0 else percent(row.scale, row.scale)[0]
        assert f"<td>{shown_as}</td>" in told
    assert of_answers([replace(e, budget=()) for e in found]) is None


def test_the_largest_source_has_the_full_bar_and_bounds_are_marked() -> None:
    lines = (Line("a", 2e-4, 0.0, True, "x"), Line("b<", 4e-4, 1e-3, False, "y"), Line("c", None, None, False, "z"))
    told = Budget("axis z", lines).table()
    assert re.findall(r"width: ([\d.]+)%", told) == ["50.0", "100.0", "0.0"]
    assert told.count("(a bound, not in the standard error)") == 2
    assert "b&lt;" in told
    assert "pale bar" in told
    small = Budget("axis z", (*lines, Line("d", 1e-12, 0.0, False, "never"))).table()
    assert "&lt;&nbsp;0.0" in small
    assert "never" not in small, "what does not matter needs no advice"
    assert "pale bar" not in Budget("axis z", lines[:1]).table()
