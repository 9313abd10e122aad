"""What the workbench says and draws against what was planted, and against the command line's figures."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gyrocal.diagnosis.residual.levels import Floor, Level, MeanSquares
from gyrocal.effects.base import effects
from gyrocal.effects.order_tone import turned_turn
from gyrocal.simulation.simulate import simulate
from gyrocal.web.panels.compare import _counted
from gyrocal.web.pictures.words import evidence, explains, symbols
from gyrocal.web.state.traces import Traces
from gyrocal.web.values.excess_by_step import Counted, Fall, Levels, fall, realised
from gyrocal.web.values.models import BY_HAND, KEPT, Models, Recipe, read_models, write_models
from gyrocal.web.values.views import Card, DiagnosisView, ModelView, Picture, Recording
from gyrocal.web.worker.bench import Bench
from gyrocal.web.worker.doubt import _not_enough
from gyrocal.web.worker.effect_picture import left_now, of_each_run
from gyrocal.web.worker.opened import Opened

pytestmark = pytest.mark.usefixtures("known_answers", "tests_alone")
AMPLITUDE_DPS = 0.06
"""Of the planted wave, once per turn."""


def test_a_doubt_does_not_contradict_the_part_that_is_explained() -> None:
    """A candidate that explains all was doubted because "it explains less than 10%"."""
    for part, words in ((0.99, "not certain to explain 10%"), (0.02, "less than 10%"), (None, "not certain to explain 10%")):
        assert words in _not_enough(part, contradicted=False)
        assert "contradict such an effect" in _not_enough(part, contradicted=True)


def test_a_fall_by_nothing_is_told_as_nothing() -> None:
    level = Level(0.1, 0.05, 0.09, 0.001, 0.09)
    one = Counted(level, {"z": level})
    told = {part: Fall([], level, level, part, within=False, alone=one, now=one).part_told for part in (None, -1e-6, 0.5, -0.2)}
    assert told == {
        None: "", -1e-6: "nothing of its square explained", 0.5: "50.0% of its square explained",
        -0.2: "its square grew by 20.0%",
    }  # fmt: skip


@pytest.mark.parametrize("cycles", [1, 20])
def test_what_a_step_removed_is_counted_over_one_floor(cycles: int) -> None:
    """The poorer model took part of the error for noise: of squared excesses of 100 and 25 over the later floor, 75 % went."""
    white = 4e-4
    poorer, richer = (Floor(white + 64e-6 * taken, white + 64e-6 * taken, 1e-12, 1e-12, white) for taken in (1, 0))
    before, after = (
        Levels({"z": MeanSquares(white + excess, white + excess, 10_000)}, {"z": floor}, cycles, parameters)
        for excess, floor, parameters in ((100e-6, poorer, 3), (25e-6, richer, 4))
    )
    assert realised(before, after, "z") == pytest.approx(0.75)
    assert realised(before, after, "x") is None
    assert realised(None, after, "z") is None
    told = fall([("", before), ("a step", after)])
    assert told is not None
    assert [bar.after for bar in told.bars] == pytest.approx([10.0, 5.0])
    assert told.part == pytest.approx(0.75)


def test_a_picture_of_two_values_shows_each_recording() -> None:
    """Two dots on a line through two points show nothing; the scatter of the recordings about them does."""
    both, means = [-1.0, 1.0], [-5.0, 5.0]
    shown = Picture("face", "z", "face", None, "", [-1.0, 0.0, 1.0], both, means, [1.0, 1.0], means, few=True)
    run = np.repeat([0, 1, 2, 3], 3)
    points = {"run": run, "face": np.where(run < 2, -1.0, 1.0), "z": np.array([-6, -4, 1, 3])[run] * 1e-3}
    assert of_each_run(shown, points) == [pytest.approx(p) for p in ((-1.0, -6.0), (-1.0, -4.0), (1.0, 1.0), (1.0, 3.0))]
    assert of_each_run(replace(shown, run=2), points) == []


def silent(_: str) -> None:
    pass


def opened(tmp_path: Path, effects: list[str], **plan: Any) -> tuple[Bench, Recording, Path]:
    out = tmp_path / "session"
    simulate(out, plan.pop("campaign", "paper"), effects, plan.pop("seed", 3), **plan)
    return Bench(Opened(tmp_path / "scratch")), Recording(out), out


@pytest.fixture(scope="module")
def ripple(tmp_path_factory: pytest.TempPathFactory) -> tuple[Bench, Recording, ModelView, DiagnosisView]:
    """Two power cycles of a short recording with a ripple, as from a board that was recorded live."""
    effect = f"table_ripple:amplitude_1={AMPLITUDE_DPS / 78}"
    bench, recording, _ = opened(tmp_path_factory.mktemp("ripple"), [effect], scenarios=2, seconds=15.0)
    return bench, recording, bench.compare(recording, "default", silent), bench.diagnose(recording, "default", silent)


@pytest.mark.slow
def test_the_floor_does_not_swallow_a_wave_and_before_stays(
    ripple: tuple[Bench, Recording, ModelView, DiagnosisView]
) -> None:
    """The excess is that of the planted wave, before it is added as after; the bars are the figures of `gyrocal add --json`."""
    bench, recording, view, _ = ripple
    alone = fall([("model at first", view.levels)])
    tried = bench.add(recording, "default", "table_ripple", "Ripple", {}, silent)
    before, after = tried.before, tried.view
    assert after is not None
    both = fall([("model at first", view.levels), ("ripple", after.levels)])
    assert alone is not None
    assert both is not None
    planted_mdps = 1e3 * AMPLITUDE_DPS / np.sqrt(2) / np.sqrt(3)  # of three axes, one has it
    assert alone.bars[0].after == pytest.approx(planted_mdps, rel=0.15)
    assert both.bars[0].after == pytest.approx(alone.bars[0].after, rel=0.03)
    assert both.within
    old, new = before["excess_within_dps"], after.compared["excess_within_dps"]
    assert [both.bars[0].after, both.bars[1].after] == pytest.approx([1e3 * old, 1e3 * new])
    assert both.part == pytest.approx(1 - (new / old) ** 2)
    assert both.part > 0.9
    assert 1e3 * both.last.floor_dps == pytest.approx(1e3 * after.compared["floor_dps"])
    assert "within power cycles" in both.sentence
    assert f"{1e3 * before['excess_dps']:.2f} → {1e3 * after.compared['excess_dps']:.2f} mdps" in both.in_all
    # Compare counts as the bars do; it gave the excess with what differs between two power cycles, which is another figure
    for shown, shown_of in ((view, alone), (after, both)):
        unit, (*of_axes, (_, rms, floor, excess, _)) = _counted(shown, shown_of)
        assert (unit, float(excess)) == ("mdps", pytest.approx(shown_of.bars[-1].after, abs=0.06))
        assert float(rms) ** 2 - float(floor) ** 2 == pytest.approx(float(excess) ** 2, abs=15)
        power = sum(float(of[3]) ** 2 for of in of_axes) / 3
        assert power == pytest.approx(float(excess) ** 2, abs=3), "a mean of three axes"
    assert alone.now.of_axes["z"].excess_dps == pytest.approx(view.compared["per_axis"]["z"]["excess_within_dps"])
    assert "mdps rms over x, y and z, on unseen recordings" in both.counted
    assert "rms over x, y and z, went from" in both.sentence


def test_all_that_is_certain_is_added_at_once_with_its_evidence(
    ripple: tuple[Bench, Recording, ModelView, DiagnosisView]
) -> None:
    bench, recording, *_ = ripple
    found = bench.explain(recording, "default", {}, silent)
    (made,) = found.made
    assert (made.effects, made.title) == (("table_ripple",), "Ripple of the table's speed")
    (card,) = made.cards
    assert card.picture is not None
    assert card.doubts == []
    assert made.view.compared["verdict"] == "adequate"
    assert found.found.verdict == "adequate"
    assert card.halves, "the two halves of a run show a ripple"
    for of in card.halves:
        assert all(abs(size - 1) < max(4 * se, 0.05) for size, se in zip(of.sizes, of.se, strict=True))
    shown = KEPT.validate_python(json.loads(json.dumps(asdict(Recipe("x", "table_ripple", cards=(card,), proves=("drift",))))))
    assert shown.cards == (card,)  # it comes back with the session


@pytest.mark.wide
def test_the_picture_of_an_effect_holds_the_residual_and_flattens(
    ripple: tuple[Bench, Recording, ModelView, DiagnosisView]
) -> None:
    bench, recording, _, found = ripple
    card = next(c for c in found.cards if c.judged["effect"] == "table_ripple" and c.judged["axis"] == "z")
    shown = card.picture
    assert shown is not None
    assert shown.view == "table_angle"
    left, curve, se = (np.array(v) for v in (shown.left, shown.curve, shown.se))
    assert np.ptp(curve) / 2 == pytest.approx(1e3 * AMPLITUDE_DPS, rel=0.1)
    assert np.mean(np.abs(left - curve) < 2 * se) > 0.8  # the band is where the means lie
    after = bench.add(recording, "default", "table_ripple", "Ripple", {}, silent).view
    assert after is not None
    traces = Traces(bench.opened.open(recording.path, silent))
    traces.take(after)
    flat = np.array(left_now(shown, traces.points))
    assert np.std(flat) < 0.15 * np.std(left)
    assert np.mean(np.abs(flat) < 2 * se) > 0.8
    traces.take(bench.compare(recording, "default", silent))
    np.testing.assert_allclose(left_now(shown, traces.points), left, atol=1e-3)  # the same bins, the same means


def test_the_card_counts_in_squares_and_says_what_is_left_of_the_rms(
    ripple: tuple[Bench, Recording, ModelView, DiagnosisView]
) -> None:
    assert explains(1 - (29.22 / 66.25) ** 2, "z", within=False) == (
        "81% of the squared excess error on z, which makes the error itself 56% smaller"
    )
    assert explains(0.9996, "z", within=False) == (
        "99.96% of the squared excess error on z, which makes the error itself 98% smaller"
    )
    assert explains(1.0, "z", within=False) == (
        "100% of the squared excess error on z: what is left is within the noise floor"
    )
    assert "as means over 0.1 s show it (a faster one is left)" in explains(0.99, "z", within=False, means=True)
    assert "nothing" in explains(-0.3, "z", within=True)
    for card in ripple[3].cards:
        told = dict(evidence(card))
        assert "practically impossible" not in " ".join(told.values())
        if card.judged["decision"] == "suggest":
            assert told["in doubt"]
        if card.judged["decision"] == "add" and not card.looks_like:
            assert "in doubt" not in told


def test_what_is_not_proven_says_why(ripple: tuple[Bench, Recording, ModelView, DiagnosisView]) -> None:
    for card in ripple[3].cards:
        decision, others = card.judged["decision"], card.looks_like
        assert bool(card.doubts) == (decision == "suggest" or (decision == "add" and bool(others)))
    tone = next(c for c in ripple[3].cards if c.judged["effect"] == "order_tone" and c.judged["axis"] == "z")
    named = next(c for c in ripple[3].cards if c.judged["decision"] == "add")
    assert named.judged["effect"] == "table_ripple"
    assert (tone.judged["decision"], tone.doubts) == ("reject", [])  # beside the ripple nothing is left for it


def test_every_number_of_a_card_has_its_unit_and_every_symbol_its_meaning(
    ripple: tuple[Bench, Recording, ModelView, DiagnosisView]
) -> None:
    card = next(c for c in ripple[3].cards if c.judged["decision"] == "add")
    assert re.fullmatch(r"amplitude_1 0\.\d+ ± 0\.\d+ %", card.size)
    assert symbols(card.equation) == "w is the true rate, dps; th is the table's angle"
    assert symbols("A_dps·exp(-p/tau_s)") == "p is the time since power-on, s"
    assert symbols("k·w^2, where w is the table's rate about any axis") == ""
    for kind in effects().values():
        bare = set(re.findall(r"(?<!\w)(?:w|th|p|t|T|y)(?!\w)", kind.equation))
        told = symbols(kind.equation) + kind.equation
        assert all(f"{name} is " in told or f"where {name} " in told for name in bare), kind.id


def test_the_spectrum_begins_at_the_lowest_frequency_of_the_longest_run(
    ripple: tuple[Bench, Recording, ModelView, DiagnosisView]
) -> None:
    view = ripple[2]
    for curve in view.spectra.values():
        assert curve.x[0] == pytest.approx(1 / 15.0, rel=0.02)
    x, y, noise = (np.array(v) for v in (view.spectra["z"].x, view.spectra["z"].y, view.spectra["z"].expected))
    wave = np.argmin(np.abs(x - 78 / 360))
    assert y[wave] > 5 * noise[wave]  # noise alone does not hold the wave that is missing
    assert np.median((y / noise)[x > 1]) == pytest.approx(1.0, abs=0.15)


def test_a_finding_opens_the_component_that_shows_it(tmp_path: Path) -> None:
    bench, recording, _ = opened(tmp_path, ["g_sensitivity"], campaign="full", scenarios=1, seconds=8.0)
    view = bench.compare(recording, "default", silent)
    found = {f["against"]: p for f, p in zip(view.compared["where"], view.places, strict=True) if f["axis"] == "z"}
    assert found["acceleration"].view == "acceleration_z"  # gravity changes sides along z


def test_a_tone_is_marked_where_it_is(tmp_path: Path) -> None:
    bench, recording, _ = opened(tmp_path, ["vibration_tone:f_hz=11.83,A_dps=0.05"], scenarios=2, seconds=15.0)
    view = bench.compare(recording, "default", silent)
    place = next(p for f, p in zip(view.compared["where"], view.places, strict=True) if f["axis"] == "z")
    assert place.view == "frequency"
    assert place.low == pytest.approx(11.83, abs=0.1)
    x, high = np.array(view.spectra["z"].x), np.array(view.spectra["z"].high)
    assert x[np.argmax(high)] == pytest.approx(place.low, rel=0.02)  # the highest point of what is drawn


def test_five_per_turn_is_said_and_shown_over_the_turn(tmp_path: Path) -> None:
    bench, recording, _ = opened(tmp_path, ["order_tone:order=5,A_dps=0.05"], scenarios=2, seconds=20.0)
    view = bench.compare(recording, "default", silent)
    finding, place = next((f, p) for f, p in zip(view.compared["where"], view.places, strict=True) if f["axis"] == "z")
    assert "5 per turn" in finding["note"]
    assert place.view in ("order", "table_angle")
    lines = view.orders["z"]
    assert lines.x[int(np.argmax(lines.high))] == pytest.approx(5, abs=0.2)


@pytest.mark.parametrize("same", [True, False])
def test_the_words_on_phases_are_those_of_the_picture(tmp_path: Path, same: bool) -> None:
    """Waves of one phase, or of one for each run: the note says what the drawn residual shows."""
    session, _ = simulate(None, "paper", (), 5, scenarios=3, seconds=20.0)
    rng = np.random.default_rng(1)
    runs = []
    for run in session.runs:
        phase = 0.0 if same else rng.uniform(0, 2 * np.pi)
        wave = AMPLITUDE_DPS * np.cos(2 * np.pi * turned_turn(run) + phase)
        table = run.table.with_columns(gz_dps=run.table["gz_dps"] + wave)
        runs.append(replace(run, frame=table, path=None))
    session.with_runs(runs).save(tmp_path / "session")
    bench = Bench(Opened(tmp_path / "scratch"))
    view = bench.compare(Recording(tmp_path / "session"), "default", silent)
    finding = next(f for f in view.compared["where"] if f["axis"] == "z")
    traces = Traces(bench.opened.open(tmp_path / "session", silent))
    traces.take(view)
    points = traces.points
    phasors = []
    for run in np.unique(points["run"]):
        mine = points["run"] == run
        phasors.append(np.mean(points["z"][mine] * np.exp(-1j * np.deg2rad(points["table_angle"][mine]))))
    drawn_alike = abs(np.mean(phasors)) > 0.9 * np.mean(np.abs(phasors))
    assert drawn_alike == same
    assert f"of {'the same' if same else 'another'} phase in each run" in finding["note"]


def test_one_answer_from_all_says_which_pairs_are_absent(tmp_path: Path) -> None:
    """Many runs of both faces, none of them in one power cycle with another."""
    session, _ = simulate(None, "paper", (), 5, scenarios=2, seconds=8.0)
    apart = [replace(run, scenario=f"s{i}") for i, run in enumerate(session.runs)]
    session.with_runs(apart).save(tmp_path / "session")
    bench = Bench(Opened(tmp_path / "scratch"))
    found = bench.calibrate(Recording(tmp_path / "session"), {"model": "default"}, silent)
    assert found.note == "No power cycle has both a face-up and a face-down run, so one answer comes from all recordings."


def test_a_run_left_out_is_left_out_of_the_fit_alone(ripple: tuple[Bench, Recording, ModelView, DiagnosisView]) -> None:
    bench, recording, view, _ = ripple
    without = bench.compare(Recording(recording.path, frozenset({"000_up.csv"})), "default", silent)
    assert set(view.left) - set(without.left) == {"000_up.csv"}
    assert view.left["001_down.csv"] == pytest.approx(1e3 * AMPLITUDE_DPS / np.sqrt(6), rel=0.2)
    traces = Traces(bench.opened.open(recording.path, silent))
    traces.take(without)
    assert traces.residual is not None
    first = traces.session.runs[0]
    assert np.isnan(traces.residual.samples[2, first.first : first.first + first.rows]).all()
    assert np.isfinite(traces.residual.samples[2, first.rows :]).all()
    assert np.isfinite(traces.measured.samples).all()


def test_models_are_kept_with_the_session(tmp_path: Path) -> None:
    shown = Picture("face", "z", "face", None, "", [-1.0, 0.0, 1.0], [-1.0, 1.0], [-5.0, 5.0], [1.0, 1.0], [-5.0, 5.0],
                    few=True, marks={-1.0: "down", 1.0: "up"})  # fmt: skip
    judged = {"effect": "drift", "axis": "z", "decision": "add", "explained": None}
    card = Card(judged, "Drift", "Something.", "k·t", [], "k 1 ± 0.1", [], within=True, picture=shown)
    second = Recipe("[model]\n", "drift", "Drift", doubts=(BY_HAND,), cards=(card,), limits=("on x, |k| is below 1",))
    kept = Models({"first": (Recipe("default"),), "mine": (Recipe("default"), second)}, "mine", frozenset({"000_up.csv"}))
    assert write_models(tmp_path, kept) == ""
    assert read_models(tmp_path) == kept
    (tmp_path / "workbench.json").write_text('{"format": "gyrocal-workbench/1", "models": 7}')
    assert read_models(tmp_path) == Models()
    assert "cannot be kept" in write_models(tmp_path / "workbench.json", kept)


def test_models_of_an_earlier_version_are_read(tmp_path: Path) -> None:
    old = {"source": "default", "effect": "", "title": "model at first", "removed": False, "formula": "", "doubts": []}
    text = json.dumps({"format": "gyrocal-workbench/1", "current": "first", "excluded": [], "models": {"first": [old]}})
    (tmp_path / "workbench.json").write_text(text)
    assert read_models(tmp_path) == Models()


def test_what_is_tried_has_its_size_and_what_is_not_found_its_limit(
    ripple: tuple[Bench, Recording, ModelView, DiagnosisView]
) -> None:
    """A refusal named the effect by its id; of what was added no size was told, and of what was not found no limit."""
    bench, recording, _, found = ripple
    clipped = bench.add(recording, "default", "saturation", "Clipping at full scale", {}, silent)
    assert clipped.view is None
    assert clipped.refused.startswith("Clipping at full scale was not added: this session does not show it")
    tried = bench.add(recording, "default", "g_sensitivity", "Sensitivity to gravity and acceleration", {}, silent)
    assert tried.view is not None
    (axis,) = tried.view.sizes["g_sensitivity"]
    assert re.fullmatch(r"gz_dps_per_g -?[\d.e-]+ ± [\d.e-]+ dps/g", tried.view.sizes["g_sensitivity"][axis])
    assert {told.split(",")[0] for told in tried.limits} == {"on x", "on y"}  # it is not fitted on z
    told = re.fullmatch(r"on x, \|gz_dps_per_g\| is below ([\d.e-]+) dps/g at 95 %", min(tried.limits))
    assert told is not None
    card = next(c for c in found.cards if (c.judged["effect"], c.judged["axis"]) == ("g_sensitivity", "x"))
    fitted = card.judged["parameters"]["gz_dps_per_g"]
    assert float(told[1]) == pytest.approx(abs(fitted["value"]) + 1.96 * fitted["se"], rel=0.05)
    assert card.limit in tried.limits[0]


def test_a_thumbnail_is_the_picture_in_small(ripple: tuple[Bench, Recording, ModelView, DiagnosisView]) -> None:
    cards: list[Card] = [c for c in ripple[3].cards if c.picture is not None]
    assert cards
    for card in cards:
        assert card.signature is not None
        assert card.picture is not None
        assert [y for _, y in card.signature.dots] == card.picture.left
        assert [y for _, y in card.signature.line] == card.picture.curve
