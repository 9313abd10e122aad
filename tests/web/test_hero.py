"""The large picture of an effect: its curve lies through the residual, and it stands for the effect that is named."""

from __future__ import annotations

import re

import numpy as np
import pytest

from gyrocal.api import Model, Session, compare
from gyrocal.diagnosis.residual.finding import Finding
from gyrocal.effects.bias_jumps import BiasJumps
from gyrocal.effects.g_sensitivity import GSensitivity
from gyrocal.inference.heldout import fitted
from gyrocal.simulation.simulate import simulate
from gyrocal.variables.shapes import Transient
from gyrocal.web.pictures import charts
from gyrocal.web.pictures.small_picture import signature_svg
from gyrocal.web.values.residual_plots import ChangeOfRate, panels
from gyrocal.web.widgets import plots
from gyrocal.web.widgets.run_strip import share
from gyrocal.web.worker import prepare
from gyrocal.web.worker.effect_picture import picture


def points(n: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    there = {panel.key(axis): np.full(n, np.nan) for panel in panels() for axis in "xyz"}
    temp_c = np.linspace(-20.0, 70.0, n)
    residual = 0.02 * (temp_c - 25) + rng.normal(0, 0.01, n)
    return {**there, "temperature": temp_c, "run": np.zeros(n, int), "x": residual, "y": residual, "z": residual}


@pytest.mark.parametrize("offset_dps", [0.0, 0.4, -3.0])
def test_the_curve_lies_through_the_means_whatever_the_bias_does(offset_dps: float) -> None:
    """The effect is stated at 25 degC and the bias moves when it is added: the two differ by a constant that is nobody's."""
    of = points(4000)
    shown = picture("z", of["z"] + offset_dps, of, {0: "000_up.csv"})
    assert shown is not None
    assert shown.view == "temperature"
    assert np.abs(np.array(shown.left) - np.array(shown.curve)).max() < 1e-6


def test_blocks_that_an_effect_does_not_see_are_not_drawn() -> None:
    """A signal that was unknown in a run ended in no curve at all, or in an error."""
    of = points(4000)
    signal = of["z"].copy()
    signal[-20:] = np.nan
    shown = picture("z", signal, of, {0: "000_up.csv"})
    assert shown is not None
    assert np.isfinite(shown.curve).all()


def test_jumps_are_shown_against_time_though_a_run_knows_better_variables() -> None:
    """Within a run the temperature rises steadily, so that the steps of the bias stood against the temperature."""
    of = points(4000)
    of |= {"time": np.linspace(0.0, 40.0, 4000) + 0.01 * np.sin(np.arange(4000))}
    steps = 0.1 * (of["temperature"] > 25)
    free, shown = (picture("z", steps, of, {0: "000_up.csv"}, against) for against in ("", BiasJumps.shown_against))
    assert free is not None
    assert free.view == "temperature"
    assert shown is not None
    assert shown.view == "time"


def test_the_curve_lies_through_the_means_whatever_the_scale_does() -> None:
    """A transient in proportion to the rate, on both faces: part of it is in the scale until the effect is added."""
    of = points(4000)
    rate_dps = np.where(np.arange(4000) < 2000, 78.0, -78.0)
    of["rate_z"] = rate_dps
    signal = -0.002 * rate_dps * np.exp(-(np.arange(4000) % 2000) / 400)
    of["z"] = signal + 0.0007 * rate_dps + 0.3
    shown = picture("z", signal, of, {0: "000_up.csv"})
    assert shown is not None
    assert shown.run is None
    assert np.abs(np.array(shown.left) - np.array(shown.curve)).max() < 1e-6


def test_no_tick_stands_at_the_odd_ends_of_the_data() -> None:
    of = points(4000)
    shown = picture("z", of["z"], of, {0: "000_up.csv"})
    assert shown is not None
    across = charts.hero(charts.LIGHT, shown, shown.left, shown.curve, ["words"])["xAxis"]
    assert across["max"] == shown.edges[-1]
    assert not across["axisLabel"]["showMinLabel"]
    assert not across["axisLabel"]["showMaxLabel"]


def test_an_excess_that_is_small_beside_the_noise_stays_pale() -> None:
    assert share(5.1, worst=5.1, floor=45.0) == pytest.approx(11, abs=1)
    assert share(51.0, worst=51.0, floor=45.0) == 100
    assert share(0.0, worst=0.0, floor=0.0) == 0


def test_a_recording_far_from_the_mean_lies_within_the_picture() -> None:
    """On a bench of six poses, the recordings of one pose lay at 50 mdps and the picture ended at 40."""
    run = np.repeat(np.arange(6), 50)
    of = {panel.key(axis): np.full(300, np.nan) for panel in panels() for axis in "xyz"}
    face = np.where(run < 3, 1.0, -1.0)
    residual = 1e-3 * np.array([50.0, 20.0, 20.0, -50.0, -20.0, -20.0])[run]
    of |= {"face": face, "run": run, "x": residual, "y": residual, "z": residual}
    shown = picture("z", residual, of, {})
    assert shown is not None
    assert shown.reach == pytest.approx((-50.0, 50.0))
    for each in ([(1.0, 50.0)], []):  # the scale stays when the effect is added
        down = charts.hero(charts.LIGHT, shown, shown.left, shown.curve, ["words"], each)["yAxis"]
        assert down["min"] <= -50.0
        assert down["max"] >= 50.0
        assert all(end % down["interval"] == 0 for end in (down["min"], down["max"]))  # no tick beside the last one


def test_the_dots_of_a_small_picture_are_not_under_its_line() -> None:
    svg = signature_svg([(-1.0, -30.0), (1.0, 30.0)], [(-1.0, -30.0), (1.0, 30.0)], "face", few=True)
    assert svg.index("<circle") > svg.index("<polyline")
    for x, y, r in re.findall(r'cx="([\d.]+)" cy="([\d.]+)" r="([\d.]+)"', svg):
        assert float(r) <= float(x) <= 220 - float(r)
        assert float(r) <= float(y) <= 76 - float(r)
        assert float(r) > 2


@pytest.mark.wide
def test_what_follows_the_change_of_the_rate_is_drawn_against_it() -> None:
    """The residual of a delay is drawn against the slope of the rate, and its finding opens that picture."""
    session = simulate(None, "swing", ["lag"], 15, scenarios=1)[0]
    assert isinstance(session, Session)
    found = compare(session, Model.builtin("default"))
    means = {}
    for p in fitted(found.fit):
        block = next(b for b in found.fit.blocks if b.run.index == p.run.index)
        means[p.run.index, p.axis] = block.mean(p.residual_dps[:, None])[:, 0]
    of = prepare.points(found.fit.blocks, means)
    delay = next(f for f in found.where if f.note.endswith("in proportion to the change of the rate"))
    opened = prepare.place(delay, of).view
    assert opened == ChangeOfRate().name
    x, y = of[f"{opened}_{delay.axis}"], of[delay.axis]
    assert abs(np.corrcoef(x, y)[0, 1]) > 0.9


def test_a_finding_of_another_size_in_each_run_is_drawn_about_the_means_of_the_runs() -> None:
    run = np.repeat([0, 1], 48)
    t_s = np.tile(np.arange(48.0), 2)
    y = np.where(run == 0, 0.3, -0.3) + 0.01 * np.exp(-t_s / 4)
    of = {"time": t_s, "run": run, "z": y}
    time = next(p for p in panels() if p.name == "time")
    drawn = plots.folded(charts.LIGHT, of, time, [0, 1], ["z"], plots.By(about_means=True))
    means = [v for series in drawn["series"] if series["name"] == "each recording" for _, v in series["data"] if v is not None]
    assert np.ptp(means) == pytest.approx(10.0, rel=0.01)  # mdps
    assert "about its own mean" in drawn["title"][0]["text"]
    finding = Finding("z", "time", 5.0, 1e-6, 0.01, "", Transient(4.0))
    assert prepare.place(finding, of).about_means


def of_seven_rates() -> dict[str, np.ndarray]:
    """Forty-two recordings at seven rates, in both directions by turns, with an offset each."""
    rng = np.random.default_rng(3)
    run = np.repeat(np.arange(42), 30)
    rate_dps = np.array([-150.0, 150.0, -78.0, 78.0, -30.0, 30.0, 0.0])[run % 7]
    residual = 3e-8 * rate_dps**3 + 5e-3 * rng.standard_normal(42)[run] + 1e-3 * rng.standard_normal(run.size)
    there = {panel.key(axis): np.full(run.size, np.nan) for panel in panels() for axis in "xyz"}
    return {**there, "rate_z": rate_dps, "run": run, "x": residual, "y": residual, "z": residual}


def test_between_rates_that_were_not_measured_no_curve_is_drawn() -> None:
    """A cubic was drawn as straight lines from one rate to the next, with corners that it does not have."""
    of = of_seven_rates()
    shown = picture("z", 3e-8 * of["rate_z"] ** 3, of, {})
    assert shown is not None
    assert shown.few
    curve = charts.hero(charts.LIGHT, shown, shown.left, shown.curve, ["words"])["series"][0]
    assert (curve["lineStyle"]["width"], curve["symbol"], len(curve["data"])) == (0, "rect", 7)
    small = signature_svg([(0.0, 1.0)] * 3, [(0.0, 1.0), (1.0, 2.0), (2.0, 0.0)], "rate", few=True)
    assert small.count("<polyline") == 3


def test_the_band_of_a_picture_holds_what_differs_between_recordings() -> None:
    """It was that of the samples, and means of what is noise lay eight standard errors outside."""
    of = of_seven_rates()
    shown = picture("z", 3e-8 * of["rate_z"] ** 3, of, {})
    assert shown is not None
    assert np.sqrt(np.mean(np.square(shown.se))) == pytest.approx(5 / 6**0.5, rel=0.4)


def test_after_an_effect_was_added_the_line_is_not_called_the_effect() -> None:
    of = points(400)
    shown = picture("z", of["z"], of, {0: "000_up.csv"})
    assert shown is not None
    names = {s["name"] for s in charts.hero(charts.LIGHT, shown, shown.left, shown.curve, ["words"], added=True)["series"]}
    assert charts.AFTER in names
    assert not any("effect" in name for name in names)


def test_every_recording_is_drawn_or_the_legend_says_how_many() -> None:
    """Every second of 42 recordings was left out: all those in the positive direction."""
    of = of_seven_rates()
    panel = next(p for p in panels() if p.name == "rate")
    drawn = plots.folded(charts.LIGHT, of, panel, range(42), ["z"])
    lines = [s for s in drawn["series"] if s["name"] == "each recording" and s["data"]]
    assert len(lines) == 42
    many = {name: np.concatenate([v + 42 * k if name == "run" else v for k in range(6)]) for name, v in of.items()}
    drawn = plots.folded(charts.LIGHT, many, panel, range(252), ["z"])
    names = [entry["name"] for entry in drawn["legend"]["data"]]
    told = next(name for name in names if "recordings" in name)
    rates = [s["data"][0][0] for s in drawn["series"] if s["name"] == told and s["data"]]
    assert told == f"{len(rates)} of 252 recordings"
    counts = [sum(abs(r - rate) < 4 for r in rates) for rate in np.unique(of["rate_z"])]
    assert min(counts) >= len(rates) / 21  # no rate is missing


@pytest.mark.parametrize(("name", "words"), [("face", ["down", "up"]), ("direction", ["negative", "at rest", "positive"])])
def test_what_is_no_number_has_words(name: str, words: list[str]) -> None:
    """The crosshair said "1 ±1", as a value with its error."""
    of = of_seven_rates()
    of[name] = np.sign(of["rate_z"])
    panel = next(p for p in panels() if p.name == name)
    drawn = plots.folded(charts.LIGHT, of, panel, range(42), ["z"])
    for script in (drawn["xAxis"][0]["axisLabel"][":formatter"], drawn["tooltip"][":formatter"]):
        assert all(f'"{word}"' in script for word in words)
        assert "±1" not in script
    assert "±" not in drawn["xAxis"][0]["name"]


def test_an_effect_is_drawn_against_a_variable_of_its_equation() -> None:
    """Each power cycle had its face-up run first, so that the sensitivity to gravity was a step in the time since power-on."""
    of = points(4000)
    up = np.arange(4000) < 2000
    since_s = np.linspace(0.0, 60.0, 4000)
    of |= {"acceleration_z": np.where(up, 1.0, -1.0), "power_on_time": since_s, "temperature": np.ones(4000)}
    signal = 0.02 * of["acceleration_z"]
    of["z"] = signal
    free, named = (picture("z", signal, of, {}, equation=e) for e in ("", GSensitivity.equation))
    assert free is not None
    assert named is not None
    assert free.view != "acceleration_z"
    assert named.view == "acceleration_z"
    other = picture("z", 0.02 * np.sin(2 * np.pi * since_s / 15), of, {}, equation=GSensitivity.equation)
    assert other is not None
    assert other.view == "power_on_time"  # what is no function of its own variable here is drawn as before


def test_a_bin_without_neighbours_has_its_line() -> None:
    """Of means at +150 dps beside many others, the band was drawn and the line was not."""
    rng = np.random.default_rng(5)
    of = points(4000)
    rate_dps = np.where(np.arange(4000) < 3900, rng.uniform(-150.0, 40.0, 4000), 150.0)
    of |= {"rate_z": rate_dps, "run": np.arange(4000) // 100, "z": 3e-4 * rate_dps}
    panel = next(p for p in panels() if p.name == "rate")
    shown = picture("z", of["z"], of, {})
    assert shown is not None
    assert not shown.few
    for series in (
        plots.folded(charts.LIGHT, of, panel, range(40), ["z"])["series"],
        charts.hero(charts.LIGHT, shown, shown.left, shown.curve, ["words"])["series"],
    ):  # fmt: skip
        line = next(s["data"] for s in series if s["type"] == "line" and s["name"] in ("mean of all", charts.EFFECT))
        *_, gap, low, high = line
        assert gap[1] is None  # nothing was measured between
        assert low[0] < 150.0 < high[0]
        assert low[1] == high[1] == pytest.approx(45.0, rel=0.01)


def test_runs_that_lack_the_data_of_an_effect_leave_no_hole_in_its_curve() -> None:
    of = points(4000)
    signal = of["z"].copy()
    signal[2000:2200] = np.nan
    shown = picture("z", signal, of, {0: "000_up.csv"})
    assert shown is not None
    assert np.isfinite([*shown.curve, *shown.left, *shown.se]).all()


def test_an_effect_that_acts_only_where_there_is_no_residual_has_no_picture() -> None:
    """Turns of known angle have no residual within the run; the diagnosis of such a session ended in an error."""
    of = points(4000)
    assert picture("z", np.full(4000, -0.064), of, {}) is None
    turning = np.arange(4000) > 3000
    of["z"] = np.where(turning, np.nan, of["z"])
    assert picture("z", np.where(turning, 5.0, -0.064), of, {}) is None
