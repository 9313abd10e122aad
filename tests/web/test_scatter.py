"""What the answers of several power cycles say together: their scatter beside their own errors."""

from __future__ import annotations

import csv
from typing import Any

import numpy as np
import pytest

from gyrocal.calibration.taken import Taken
from gyrocal.web.pictures.charts import LIGHT
from gyrocal.web.pictures.scatter import Scatter, meanings, options, sentences
from gyrocal.web.pictures.words import method
from gyrocal.web.widgets.export import as_csv


def estimates(bias_mdps: list[float], error_mdps: float, flags: tuple[str, ...] = ()) -> list[dict[str, Any]]:
    return [
        {
            "scenario": f"s{i:03d}", "method": "model", "seconds": 6.0, "axis": "z", "scale": 0.01, "scale_se": 1e-4,
            "bias_dps": 1e-3 * value, "bias_se_dps": 1e-3 * error_mdps, "misfit": 1.0, "flags": list(flags),
            "trusted": not flags, "taken": Taken(first=2, seconds=6.0),
        }
        for i, value in enumerate(bias_mdps)
    ]  # fmt: skip


def test_biases_that_scatter_are_not_each_said_to_be_known() -> None:
    """Five biases from -45 to -190 mdps, each with an error of 2: the scatter is said, and that no one foretells the next."""
    values = [-45.0, -80.0, -120.0, -150.0, -190.0]
    told = sentences(estimates(values, 2.0), "z")
    assert f"scatters by {np.std(values, ddof=1):.3g} mdps about {np.mean(values):.1f}" in told[0]
    assert "own error is 2 mdps" in told[0]
    assert told[1].startswith("The bias of one power cycle cannot be taken for the next one's")


def test_biases_within_their_errors_are_not_said_to_scatter() -> None:
    rng = np.random.default_rng(2)
    told = sentences(estimates((-100 + rng.normal(0, 2.0, 9)).tolist(), 2.0), "z")
    assert len(told) == 1
    assert "the scale scatters by 0 % about 1.000 %, own error 0.010 %." in told[0]


def test_an_answer_that_is_not_trusted_does_not_enter_what_they_say_together() -> None:
    """One power cycle whose faces were exchanged: its scale of -202 % moves neither the mean nor the scatter."""
    sound = estimates([-4.0, 0.0, 1.0, 3.0], 2.0)
    wrong = [{**e, "scale": -2.02, "scenario": "s009"} for e in estimates([5000.0], 2.0, ("direction",))]
    alone, both = (sentences(found, "z") for found in (sound, [*sound[:2], *wrong, *sound[2:]]))
    assert alone[0].replace("4 power cycles", "4 trusted power cycles") == both[0]
    assert "1 of 5 answers is not trusted" in both[-1]
    assert "No answer is trusted" in sentences(wrong, "z")[-1]


def test_what_is_not_trusted_is_counted_explained_and_hollow() -> None:
    found = [*estimates([-1.0, 0.0, 1.0], 2.0), *estimates([5.0], 2.0, ("misfit", "missed"))]
    assert "1 of 4 answers is not trusted" in sentences(found, "z")[-1]
    assert [line.split(":")[0] for line in meanings(found)] == ["misfit", "missed"]
    drawn = options(LIGHT, found, "z")
    answers, points = (series["data"] for series in drawn["series"])
    assert [bias for _, bias, _ in answers] == pytest.approx([-1.0, 0.0, 1.0, 5.0])
    assert [error for _, _, error in answers] == pytest.approx([2.0] * 4)
    assert [filled for *_, filled in points] == [1, 1, 1, 0]
    for words in [drawn["title"]["text"], *(of["option"]["title"]["text"] for of in drawn["media"])]:
        assert "first 6 s" in words
        assert "bars: ± 2 standard errors" in words
    ends = [(low, high) for _, _, low, high, _ in points]
    assert ends == [pytest.approx((bias - 4.0, bias + 4.0)) for _, bias, _ in answers]
    rows = list(csv.DictReader(as_csv(drawn).splitlines()))
    assert [(row["x"], row["unit"]) for row in rows] == [("s000", "mdps"), ("s001", "mdps"), ("s002", "mdps"), ("s000", "mdps")]


def test_the_table_names_the_methods_as_the_chart_and_the_command_line_do() -> None:
    assert [method(name) for name in ("model", "cnn", "baseline")] == ["model", "network (cnn)", "plain average (baseline)"]


def test_too_few_answers_have_no_scatter() -> None:
    assert Scatter.of(estimates([1.0, 2.0], 1.0), "bias_dps", "bias_se_dps", 1e3) is None
    assert options(LIGHT, estimates([1.0], 1.0), "z") == {}
