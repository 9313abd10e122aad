"""What an answer was calculated from is told as it was: the first seconds, or whole recordings, and how many."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from gyrocal.api import Model, Session
from gyrocal.calibration.calibrate import POOLED, Estimate, calibrate
from gyrocal.calibration.calibration import Calibration
from gyrocal.calibration.taken import Taken
from gyrocal.present import notebook  # noqa: F401  (registers how a calibration is shown)
from gyrocal.present.budget import print_budget
from gyrocal.present.taken import cell, each, words
from gyrocal.web.pictures.charts import LIGHT
from gyrocal.web.pictures.scatter import options, sentences
from gyrocal.web.values.budget import of_answers
from make_runs import make_run, make_session

RATE_HZ = 100.0


def session(lengths_s: Sequence[float], rates_dps: Sequence[float], *, one_cycle: bool = False) -> Session:
    """Runs at these rates, all face up, each in a power cycle of its own unless there is only ``one_cycle``."""
    rng = np.random.default_rng(7)
    runs = []
    for i, (length_s, rate_dps) in enumerate(zip(lengths_s, rates_dps, strict=True)):
        t_s = np.arange(round(length_s * RATE_HZ)) / RATE_HZ
        gyro = rng.normal(0, 0.05, (t_s.size, 3)) + np.array([0, 0, 1.01 * rate_dps + 0.2])
        runs.append(make_run(t_s, gyro, table_rate_dps=rate_dps, scenario="s000" if one_cycle else f"s{i:03d}"))
    return make_session(*runs)


def told(found: list[Estimate], capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Every text that the page, the notebook and the command line give of the answers about z."""
    shown: list[dict[str, Any]] = [{**e.to_json(), "taken": e.taken} for e in found]
    budget = of_answers(found)
    print_budget(found)
    printed = capsys.readouterr().out.splitlines()[0]
    drawn = options(LIGHT, shown, "z")
    title = [drawn["title"]["text"]] if drawn else []
    return [sentences(shown, "z")[0], Calibration(found).summary(), printed, *([budget.of] if budget else []), *title]


def test_an_answer_from_all_recordings_is_not_said_to_be_from_the_first_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    """Each rate in a power cycle of its own: none shows scale and bias by itself, and all together do."""
    found = calibrate(session([8.0] * 6, [-60.0, -30.0, 0.0, 30.0, 60.0, 0.0]))
    (one,) = found
    assert one.scenario == POOLED
    assert (words(one.taken), cell(one.taken)) == ("all 6 recordings, 8 s each", "6, 8 s each")
    texts = told(found, capsys)
    assert len(texts) == 4
    for text in texts:
        assert "first" not in text
        assert "from all 6 recordings, 8 s each" in text


def test_recordings_of_several_lengths_are_told_with_both_ends() -> None:
    (one,) = calibrate(session([6.0, 8.0, 12.5], [0.0, 30.0, -30.0]))
    assert words(one.taken) == "all 3 recordings, 6 to 12.5 s"
    assert cell(one.taken) == "3, 6 to 12.5 s"


def test_a_power_cycle_whose_whole_runs_answer_is_told_by_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    """Rest and one turn: the model answers, and no run is cut."""
    found = calibrate(session([8.0, 6.0], [0.0, 30.0], one_cycle=True))
    assert [e.scenario for e in found if e.axis == "z"] == ["s000"]
    for text in told([e for e in found if e.axis == "z"], capsys):
        assert "first" not in text
        assert "2 recordings, 6 to 8 s" in text


def test_the_first_seconds_are_told_where_they_are_what_was_taken(capsys: pytest.CaptureFixture[str]) -> None:
    found = calibrate(session([8.0, 8.0], [30.0, -30.0], one_cycle=True), [2.0, 4.0], ["baseline"])
    assert [cell(e.taken) for e in found] == ["2, first 2 s", "2, first 4 s"]
    for text in told(found[1:], capsys):
        assert "the first 4 s of 2 recordings" in text


def test_a_turn_by_hand_is_taken_whole_beside_the_first_seconds_of_a_rest() -> None:
    t_s = np.arange(800) / RATE_HZ
    rest, turned = make_run(t_s, 0.2, table_rate_dps=0.0), make_run(t_s, [0.2, 0.2, 45.2], turn_deg=360.0)
    (one,) = (e for e in calibrate(make_session(rest, turned), [2.0], ["model"], Model.open("default")) if e.axis == "z")
    assert words(one.taken) == "the first 2 s of one recording and the whole of one, 8 s"
    assert cell(one.taken) == "1, first 2 s; 1, 8 s"


def test_answers_of_power_cycles_with_other_counts_are_told_without_one() -> None:
    two, four, whole = Taken(first=2, seconds=6.0), Taken(first=4, seconds=6.0), Taken(whole=2, longest_s=5.0)
    assert each([two, two]) == "the first 6 s of 2 recordings"
    assert each([two, four]) == "the first 6 s of the recordings"
    assert each([whole, Taken(whole=3, longest_s=7.0)]) == "the recordings"


def test_whole_recordings_of_other_lengths_stand_together() -> None:
    """Power cycles whose recordings are not equally long: the sentence and the picture hold all of them."""
    answers = [
        {"scenario": f"s{i}", "method": "model", "seconds": 8.0 + i, "axis": "z", "scale": 0.01, "scale_se": 1e-4,
         "bias_dps": 0.1, "bias_se_dps": 1e-3, "flags": [], "trusted": True, "taken": Taken(whole=2, longest_s=8.0 + i)}
        for i in range(4)
    ]  # fmt: skip
    assert "in each of 4 power cycles" in sentences(answers, "z")[0]
    assert len(options(LIGHT, answers, "z")["series"][0]["data"]) == 4


def test_the_answer_in_json_has_the_keys_of_before() -> None:
    (one,) = calibrate(session([8.0] * 3, [0.0, 30.0, -30.0]))
    keys = "scenario method seconds axis scale scale_se bias_dps bias_se_dps misfit flags trusted"
    assert set(one.to_json()) == set(keys.split())
