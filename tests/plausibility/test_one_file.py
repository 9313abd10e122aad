"""A slip in one file is told of this file, and what it does to the other axes is no effect."""

import re
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from gyrocal.diagnosis.answer.diagnose import diagnose
from gyrocal.plausibility import check
from gyrocal.recording.session import Run, Session
from make_runs import make_run, make_session

pytestmark = pytest.mark.usefixtures("known_answers", "tests_alone")
RATE_HZ = 50.0


def session(seed: int) -> Session:
    """Three power cycles of five runs; x and y read 1 % and 2 % of the rate, as both misaligned axes of any mount do."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(20 * round(RATE_HZ)) / RATE_HZ
    runs = []
    for cycle in range(3):
        bias_dps = np.array([0.4, -0.7, 0.2]) + rng.normal(0, 0.01, 3)
        for rate_dps in (-90.0, -45.0, 0.0, 45.0, 90.0):
            gyro = bias_dps + rate_dps * np.array([0.01, -0.02, 1.004]) + rng.normal(0, 0.08, (t_s.size, 3))
            runs.append(make_run(t_s, gyro, table_rate_dps=rate_dps, scenario=f"s{cycle}"))
    return make_session(*runs)


def with_run(session: Session, number: int, run: Run) -> Session:
    return session.with_runs(run if i == number else r for i, r in enumerate(session.runs))


@pytest.mark.parametrize(("order", "axis"), [((2, 0, 1), "x"), ((0, 2, 1), "y"), ((1, 2, 0), "y")])
@pytest.mark.parametrize("number", [6, pytest.param(13, marks=pytest.mark.wide)])
def test_columns_of_one_file_in_another_order_are_told_of_it(order: tuple[int, int, int], axis: str, number: int) -> None:
    """The advice was to set another axis for the whole session, with the other files' slope of that axis."""
    whole = session(9301)
    run = whole.runs[number]
    columns = {name: pl.Series(run.gyro_dps[:, k]) for name, k in zip(("gx_dps", "gy_dps", "gz_dps"), order, strict=True)}
    slip = with_run(whole, number, replace(run, frame=run.table.with_columns(**columns)))
    (told,) = check(slip)
    assert (told.code, told.file, told.blocking) == ("axes_swapped", run.file, True)
    follows = re.search(rf"and {axis} with (\S+) in this file only", told.text)
    assert follows is not None
    assert float(follows[1]) == pytest.approx(1.0, abs=0.05)  # by the bias of another column
    assert f"the readings of z are in g{axis}_dps" in told.text
    assert "session.toml" not in told.text
    assert [c.axis for c in diagnose(slip).candidates if c.decision == "add"] == []


@pytest.mark.wide
def test_a_wrong_face_of_one_run_names_nothing_on_the_other_axes() -> None:
    whole = session(9302)
    before = {(c.effect.id, c.axis) for c in diagnose(whole).candidates if c.decision == "add"}
    assert before == {("misalignment", "x"), ("misalignment", "y")}
    run = whole.runs[5]
    slip = with_run(whole, 5, replace(run, face="down"))
    assert {(w.code, w.file) for w in check(slip)} == {("face_wrong", run.file)}
    assert [c for c in diagnose(slip).candidates if c.decision == "add"] == []
