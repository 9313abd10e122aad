"""Sentences of the page that need no browser, and the picture of a finding in proportion to the rate."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.effects.bias_jumps import BiasJumps
from gyrocal.effects.lag import Lag
from gyrocal.effects.saturation import Saturation
from gyrocal.effects.vibration_tone import VibrationTone
from gyrocal.present.report import sizes
from gyrocal.units import PERCENT, rate_text
from gyrocal.variables.direction import CHANGING
from gyrocal.variables.shapes import Columns, Steps, TableWave, Transient
from gyrocal.web.device.live import Live
from gyrocal.web.pictures import charts
from gyrocal.web.pictures.words import above_excess, evidence, held_by_hand, no_picture
from gyrocal.web.values.models import Recipe, added
from gyrocal.web.values.residual_plots import panels
from gyrocal.web.values.views import Holdable
from gyrocal.web.widgets import plots
from gyrocal.web.worker import prepare

SCALE = 1e-4
"""The planted error of the rate's scale."""


@pytest.mark.parametrize(
    ("effect", "name", "value", "words"),
    [(Lag(), "order", 0.0, "a pure delay"), (Lag(), "order", 1.0, "a first-order low-pass")],
)  # fmt: skip
def test_whole_numbers_are_told_in_words(effect: Any, name: str, value: float, words: str) -> None:
    """They read "order 0 poles"."""
    found: Any = SimpleNamespace(effect=effect, values={name: value}, se={})
    assert sizes(found) == words


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"n": 1.0, "size_dps": 0.05}, "1 jump a run, each up or down by 0.0500 ± 0.0004"),
        ({"n": 2.5, "size_dps": -0.05}, "2.5 jumps a run, each up or down by 0.0500 ± 0.0004"),
        ({"n": 2.5, "size_dps": 0.05, "outliers": 5e-4}, "0.05 % of the samples are single readings that are off, by 0.0500"),
    ],
)  # fmt: skip
def test_the_size_of_jumps_says_what_it_means(values: dict[str, float], words: str) -> None:
    """It was "n 2.5 jumps a run, size_dps 0.05", of single readings that are no jumps too."""
    found: Any = SimpleNamespace(effect=BiasJumps(), values=values, se={"size_dps": 4.04e-4})
    told = sizes(found)
    assert told.startswith(words.replace("0.0004", "0.00040").replace("0.0500", "0.05000"))
    assert told.endswith("(root mean square)")
    assert sizes(SimpleNamespace(effect=BiasJumps(), values={}, se={})) == ""  # type: ignore[arg-type]


@pytest.mark.parametrize(("gain", "told"), [(3.1, "better by 3.1 ± 1.0"), (-0.7, "worse by 0.7 ± 1.0")])
def test_a_loss_on_unseen_data_is_not_told_as_a_negative_gain(gain: float, told: str) -> None:
    """It was "predicts it better by -0.7"."""
    judged = {"heldout_gain": gain, "heldout_gain_se": 1.0, "explained": None, "q_value": None, "decision": "reject"}
    card: Any = SimpleNamespace(judged=judged, size="", doubts=[], looks_like=[], within=False)
    assert dict(evidence(card))["on unseen data"] == f"predicts it {told} in log-likelihood"


def test_a_finding_above_the_excess_says_why_it_can_be() -> None:
    where = [{"axis": "y", "note": f"rms {rate_text(0.142)}, in the shape of: hysteresis"}]
    assert "the floor contains" in above_excess(where, {"y": {"excess_dps": 0.062}})
    assert above_excess(where, {"y": {"excess_dps": 0.2}}) == above_excess([], {}) == ""
    wave = [{"axis": "y", "note": "142 mdps once per turn, of the same phase in each run"}]  # an amplitude
    assert above_excess(wave, {"y": {"excess_dps": 0.1}}) == ""
    assert above_excess(where, {"y": {"excess_dps": None}}) == ""


def test_a_card_without_a_picture_says_why() -> None:
    assert "spectrum of Compare" in no_picture(VibrationTone.equation)
    assert "single readings" in no_picture(Saturation.equation)


def test_a_finding_in_proportion_to_the_rate_is_drawn_as_a_part_of_it() -> None:
    """Both directions cancelled in the mean of all, so that "+60.9 ppm of the rate" opened a line at zero."""
    t_s = np.tile(np.linspace(0.05, 9.95, 100), 4)
    run = np.repeat(np.arange(4), 100)
    rate = np.array([78.0, -78.0, 78.0, -78.0])[run]
    points = {"run": run, "time": t_s, "z": SCALE * rate}
    points |= {panel.key("z"): rate for panel in panels() if panel.name == "rate"}
    panel = next(panel for panel in panels() if panel.name == "time")
    points[panel.key("z")] = t_s
    finding = Finding("z", "time", 9.0, 1e-9, SCALE * 78, "", Steps(lambda _: None, np.array([0.0, 5.0, 10.0]), True))
    place = prepare.place(finding, points)
    assert place.part is not None
    drawn = plots.folded(charts.LIGHT, points, panel, range(4), ["z"], plots.By(place.about_means, place.part))
    mean = next(s for s in drawn["series"] if s["name"] == "mean of all")
    assert [y for _, y, *_ in mean["data"] if y is not None] == pytest.approx([1e6 * SCALE] * 48, abs=1e-3)
    assert drawn["title"][0]["text"].endswith("ppm of the rate")  # as the words say
    large = replace(finding, note="rms 780 mdps; mostly +1.23% of the rate, from 5 s up")
    assert prepare.place(large, points).part is PERCENT


def test_an_effect_that_was_removed_is_not_listed_as_added() -> None:
    """The table of models named the effect of a branch whose cross had been pressed."""
    add, held = Recipe("a", "lag", "Delay"), Recipe("b", "lag", "Delay", held="tau_s of delay on z held at 0.1 s")
    mine = Recipe("c", "mine: k*rate**2", "mine", formula="mine: k*rate**2")
    assert added([Recipe("default"), add, held, mine]) == ["Delay", "mine"]
    assert added([add, mine, Recipe("d", "lag", "Delay", removed=True)]) == ["mine"]
    assert added([add, mine, Recipe("d", "mine", "mine", removed=True)]) == ["Delay"]


def test_a_misfit_beside_a_held_parameter_names_it() -> None:
    """The page said that no effect of the library explained what a wrong value, typed by hand, left over."""
    one = Holdable("scale_nonlinearity", "Nonlinearity of the scale", "z", "k3", 2e-8, None, "1/dps^2", held=True)
    assert "k3 of nonlinearity of the scale on z at 2e-08 1/dps^2" in held_by_hand([one])
    assert held_by_hand([replace(one, held=False, se=1e-9)]) == ""


def test_one_run_has_no_phase_or_size_of_its_own() -> None:
    """Of a session of one run it was said that the wave had "another phase in each run"."""
    one = np.array([[0.1, 0.2]])
    assert TableWave(1.0).words(one) == "once per turn"
    assert TableWave(1.0).words(np.repeat(one, 2, axis=0)).endswith("of the same phase in each run")
    assert TableWave(1.0).words(np.concatenate([one, -one])).endswith("of another phase in each run")
    assert Transient(4.0).words(one).endswith("time constant of about 4 s")
    assert Transient(4.0).words(np.array([[0.1], [-0.3]])).endswith("of another size in each run")


@pytest.mark.parametrize(
    ("sensors", "connected", "left", "ended"),
    [({}, False, None, False), ({0: {}}, True, None, False), ({0: {}}, False, None, True), ({0: {}}, True, 0, True)],
)  # fmt: skip
def test_a_simulated_device_that_hung_up_has_ended(
    sensors: dict[int, Any], connected: bool, left: int | None, ended: bool
) -> None:
    """Until its process ended, the page waited for it to be plugged in again."""
    live = Live(lambda: None)
    assert not live.ended
    live._simulated = SimpleNamespace(poll=lambda: left)  # type: ignore[assignment]
    live.status = {"connected": connected, "sensors": sensors}
    assert live.ended is ended


def test_a_rate_that_rises_or_falls_is_shown_against_its_change() -> None:
    """It opened the sign of the rate, which shows nothing of it."""
    shape = Columns(lambda _: None, 1, CHANGING)
    points = {panel.key(axis): np.zeros(4) for panel in panels() for axis in "xyz"} | {"z": np.zeros(4)}
    assert prepare.place(Finding("z", "direction", 9.0, 1e-9, 0.3, "", shape), points).view == "rate_change"


def test_single_readings_are_sent_to_no_picture() -> None:
    """Repeated samples opened two means against the size of the reading."""
    assert prepare.place(Finding("z", "reading", 9.0, 1e-9, 0.3, "repeated or lost samples"), {}).view == ""


def test_what_a_screen_reader_reads_holds_no_escapes() -> None:
    """A label read "Ripple of the table&#x27;s speed"."""
    from nicegui.props import Props

    said = 'Ripple of the table\'s speed on z, "a" \\ b'
    assert Props.parse(f"aria-label={charts.words([said])} role=img") == {"aria-label": said, "role": "img"}
