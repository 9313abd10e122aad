"""The report tells the whole story, contradicts nothing, repeats by its own commands, and needs no network."""

from __future__ import annotations

import contextlib
import html
import io
import json
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace as NS
from typing import Any, cast

import numpy as np
import pytest

from gyrocal.api import Model, Session, compare, fit
from gyrocal.cli import main
from gyrocal.diagnosis.residual.comparison import measure
from gyrocal.diagnosis.residual.levels import Floor, MeanSquares
from gyrocal.effects.base import effects
from gyrocal.present import pictures
from gyrocal.present.output import plus_minus
from gyrocal.simulation.simulate import simulate
from gyrocal.web.pictures import charts
from gyrocal.web.pictures.effect_figure import effect_figure
from gyrocal.web.state.workbench import Workbench
from gyrocal.web.values.excess_by_step import Levels
from gyrocal.web.values.models import BY_HAND, Recipe, Step
from gyrocal.web.values.story import Change, story
from gyrocal.web.values.views import Card, Picture
from gyrocal.web.worker.report import correlated, page
from make_runs import make_run, make_session

from .loop import finish


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    simulate(folder / "hidden", "paper", ["table_ripple"], 3, scenarios=3, seconds=10)
    return folder


@pytest.fixture(scope="module")
def reports(folder: Path) -> tuple[str, str]:
    """The report of the model at first, diagnosed, and that with the missing effect added."""
    texts = []

    async def story() -> None:
        bench = Workbench([folder], lambda topic: None)
        try:
            await bench.open("hidden")
            await bench.diagnose()
            texts.append(await bench.report())
            assert bench.diagnosis is not None
            best = bench.diagnosis.cards[0]
            await bench.add(best.judged["effect"], best.title)
            texts.append(await bench.report())
        finally:
            bench.close()

    finish(story())
    first, last = texts
    assert first is not None
    assert last is not None
    return first, last


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures are left out, for tests of what a report says."""
    monkeypatch.setattr(pictures, "png_data", lambda figure: "")


def test_the_evidence_is_kept_of_every_axis_that_an_effect_was_added_on() -> None:
    found = (("y", "add"), ("x", "add"), ("z", "suggest"))
    judged = [{"effect": "drift", "axis": axis, "decision": decision, "explained": 1.0} for axis, decision in found]
    cards = [Card(of, "Drift", "", "", [], "", [], within=False) for of in judged]

    def levels(excess: dict[str, float]) -> Levels:
        floor = Floor(4e-4, 4e-4, 1e-8, 1e-8, 4e-4)
        squares = {axis: MeanSquares(4e-4 + e**2, 4e-4 + e**2, 100_000) for axis, e in excess.items()}
        return Levels(squares, dict.fromkeys("xyz", floor), 9, 3)

    on = [{"effect": "bias", "axis": a} for a in "xyz"] + [{"effect": "drift", "axis": a} for a in "xy"]
    recipe = Recipe("[after]", effect="drift", title="Drift", cards=tuple(cards))
    view = NS(
        compared={"parameters": on}, effects=[("drift", "Drift", True)], levels=levels({"x": 0.03, "y": 0.01, "z": 0.0}),
        sizes={"drift": {"x": "k 1 ± 0.1", "y": "k 2 ± 0.1"}},
    )  # fmt: skip
    after = Step(recipe, cast(Any, view))
    before = Step(Recipe("[before]"), cast(Any, NS(levels=levels({"x": 0.05, "y": 0.05, "z": 0.0}))))
    changes = story([before, after])
    assert [c.judged["axis"] for c in changes[0].cards] == ["y", "x"]
    # what it did remove, and not what was expected of it alone
    assert [c.judged["explained"] for c in changes[0].cards] == pytest.approx([1 - 0.2**2, 1 - 0.6**2])


@pytest.mark.wide
def test_the_evidence_comes_back_with_the_session(folder: Path, reports: tuple[str, str]) -> None:
    """Picture, size and reasons were gone when the session was opened again, and the report said that they were not kept."""
    texts: list[str | None] = []

    async def again() -> None:
        bench = Workbench([folder], lambda topic: None)
        try:
            await bench.open("hidden")
            kept = bench.steps[-1].recipe
            assert [card.judged["axis"] for card in kept.cards] == ["z"]
            assert kept.picture is not None
            assert kept.picture.view in bench.steps[-1].view.against
            assert kept.cards[0].size
            texts.append(await bench.report())
        finally:
            bench.close()

    finish(again())
    assert texts[0] is not None
    story_of = [words(text).split("What was changed")[1].split("What is left")[0] for text in (reports[1], texts[0])]
    assert story_of[0] == story_of[1]
    pictures_of = [re.findall(r'alt="Ripple of[^"]+" src="([^"]+)"', text) for text in (reports[1], texts[0])]
    assert pictures_of[0] == pictures_of[1]
    assert len(pictures_of[0]) == 1


def test_an_effect_added_by_hand_has_its_axes_its_sizes_and_its_doubt(folder: Path, undrawn: None) -> None:
    """Nothing was said of its size."""
    sizes, limits = (("x", "k 1.0 ± 0.5 dps/s"), ("z", "k 2.0 ± 0.5 dps/s")), ("on y, |k| is below 0.3 dps/s at 95 %",)
    doubts = (BY_HAND,)
    added = Change("drift", "Drift", False, "", doubts, (), axes=("x", "z"), sizes=sizes, limits=limits)
    removed = Change("drift", "Drift", True, "", (), ())
    found = compare(Session.open(folder / "hidden"), Model.open("paper"))
    told = words(page("hidden", found, None, [added], None, None))
    assert "Not proven: Drift." in told
    assert "Added: Drift on x, z" in told
    assert "It was added by hand" in told
    assert "size on z k 2.0 ± 0.5 dps/s" in " ".join(told.split())
    assert limits[0] in told
    assert f"In doubt: {BY_HAND}." in told
    earlier = words(page("hidden", found, None, [replace(added, doubts=("not proven",))], None, None))
    assert "It was added in an earlier version, which did not keep the evidence." in earlier
    assert "Not proven" not in words(page("hidden", found, None, [added, removed], None, None))


@pytest.mark.wide
def test_the_commands_leave_out_the_runs_that_were_left_out(
    folder: Path, undrawn: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = Session.open(folder / "hidden")
    left_out = [session.runs[1].file]
    kept = compare(session.with_runs([run for run in session.runs if run.file not in left_out]), Model.open("paper"))
    text = page("hidden", kept, None, [], None, None, left_out)
    block = re.search(r'<pre class="commands">(.*?)</pre>', text, flags=re.DOTALL)
    assert block is not None
    copied, compared, *_ = (shlex.split(line) for line in html.unescape(block[1]).splitlines())
    shutil.copytree(folder / "hidden", tmp_path / "hidden")
    monkeypatch.chdir(tmp_path)
    subprocess.run([sys.executable, *copied[1:]], check=True)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert main([*compared[1:], "--model", "paper", "--json"]) == 0
    assert json.loads(out.getvalue())["rms_dps"] == pytest.approx(kept.to_json()["rms_dps"], rel=1e-9)


def test_a_session_judged_by_angle_has_its_levels_in_degrees(undrawn: None) -> None:
    t_s = np.arange(400) / 100
    noise = np.random.default_rng(4).normal(0, 0.05, (400, 3))
    turns = [(noise + np.array([0, 0, w]), {"turn_deg": 4.0 * w}) for w in (90.0, -90.0, 90.0)]
    rests = [(noise, {"table_rate_dps": 0.0})] * 3
    found = measure(make_session(*(make_run(t_s, y, **known) for y, known in (*turns, *rests))))
    assert found.angles is not None
    told = words(page("turned", found, None, [], None, None))
    assert "Net angles of the runs, by which this session is judged" in told
    assert "floor deg" in told
    assert "floor mdps" not in told


def words(text: str) -> str:
    """What a person reads of a page."""
    return html.unescape(re.sub(r"<style>.*?</style>|<[^>]+>", " ", text, flags=re.DOTALL))


def test_before_anything_is_added_it_says_what_is_missing(reports: tuple[str, str]) -> None:
    told = words(reports[0])
    assert "The model does not fit" in told
    assert "What is missing" in told
    assert "What was changed" not in told


def test_a_model_that_fits_lacks_nothing_and_keeps_the_evidence(reports: tuple[str, str]) -> None:
    told = words(reports[1])
    assert "The model is adequate" in told
    for contradiction in ("What is missing", "Missing:", "The model does not fit", "Where it fails"):
        assert contradiction not in told
    assert "Added: Ripple of the table's speed on z" in told
    assert "of the squared excess error on z" in told
    assert reports[1].count('<img alt="Ripple of the table&#39;s speed on z, ') == 1


@pytest.mark.slow
def test_it_has_both_spectra(reports: tuple[str, str]) -> None:
    for title in ("Spectrum", "Spectrum over the turn of the table", "Residual against time", "Allan deviation"):
        assert f'<img alt="{title}"' in reports[1]


def test_correlated_parameters_are_listed_by_name() -> None:
    """In y = scale·w + bias with white noise the correlation is -mean(w) / rms(w)."""
    rates = [30.0, 78.0, 120.0]
    noise = np.random.default_rng(5).normal(0, 0.05, (400, 3))
    runs = [make_run(np.arange(400) / 100, noise + np.array([0, 0, 1.01 * w]), table_rate_dps=w) for w in rates]
    found = fit(make_session(*runs), Model.open("paper"), axes="z")
    expected = -np.mean(rates) / np.sqrt(np.mean(np.square(rates)))
    ((axis, *names, correlation),) = correlated(found, "z")
    assert (axis, set(names)) == ("z", {"scale.scale", "bias.bias_dps"})
    assert float(correlation) == pytest.approx(expected, abs=0.005)


def test_the_picture_of_an_effect_has_the_pages_words_and_every_number_a_unit() -> None:
    edges, centres, left, curve = [-2.0, 0.0, 2.0], [-1.0, 1.0], [5.0, -4.0], [4.0, -4.0]
    shown = Picture("rate", "z", "true rate, dps", None, "", edges, centres, left, [1.0, 1.0], curve)
    for few in (False, True):
        (axes,) = effect_figure(replace(shown, few=few)).axes
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("true rate, dps", "mdps")
        drawn = charts.hero(charts.LIGHT, shown, shown.left, shown.curve, ["z"])
        on_page = {entry["name"] for entry in drawn["legend"]["data"]}
        assert {text.get_text() for text in axes.get_legend().get_texts()} == on_page
        (dots,) = (line for line in axes.lines if line.get_label() == charts.LEFT)
        assert dots.get_xydata().tolist() == [[-1.0, 5.0], [1.0, -4.0]]
    large = replace(shown, left=[5000.0, -4000.0], marks={-1.0: "down", 1.0: "up"})
    (axes,) = effect_figure(large).axes
    assert axes.get_ylabel() == "dps"
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["down", "up"]


def test_no_two_figures_have_one_title(reports: tuple[str, str]) -> None:
    for report in reports:
        titles = re.findall(r'<img alt="([^"]*)"', report)
        assert len(titles) == len(set(titles))
    session, _ = simulate(None, "paper", [], 3, scenarios=2, seconds=20)
    drawn = [figure.axes[0].get_title().split("\n")[0] for _, figure in pictures.of_spectra(measure(session)).values()]
    assert len(drawn) == len(set(drawn)) == 2


def test_it_lists_correlations_or_says_that_there_are_none(reports: tuple[str, str]) -> None:
    for report in reports:
        assert 'class="correlations"' in report or "have a correlation above 0.3" in words(report)


def test_it_says_what_was_measured(reports: tuple[str, str], folder: Path) -> None:
    told = words(reports[1])
    for fact in ("LSM6DSO (simulated)", "6 in 3 power cycles, 60 s", "made on", "145 samples a second", "°C"):
        assert fact in told
    files = re.findall(r'<td class="text">(\d+_\w+\.csv)</td><td class="text">s00', reports[1])
    assert files == sorted(f.name for f in (folder / "hidden").glob("*.csv"))


@pytest.mark.usefixtures("measured_adds")
def test_its_commands_repeat_it(reports: tuple[str, str], folder: Path) -> None:
    block = re.search(r'<pre class="commands">(.*?)</pre>', reports[1], flags=re.DOTALL)
    assert block is not None
    commands = [shlex.split(line) for line in html.unescape(block[1]).splitlines()]
    assert [command[1] for command in commands] == ["compare", "diagnose", "add", "compare", "calibrate"]
    out = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out):
        assert main([*commands[2][1:], "--json"]) == 0
    added = json.loads(out.getvalue())
    units = {p.name: p.unit for effect in effects().values() for p in effect.parameters}
    for parameter in added["after"]["parameters"]:
        if parameter["se"]:
            percent = units.get(parameter["name"].removesuffix("_sd"), "").startswith("fraction")
            factor = 100 if percent else 1
            value, error = plus_minus(factor * parameter["value"], factor * parameter["se"]).split(" ± ")
            assert f'<td>{value}</td><td>{error}</td><td class="text">{"%" if percent else ""}' in reports[1]
    assert (folder / "model.toml").read_text() in html.unescape(reports[1])


def test_it_opens_without_a_network_and_prints(
    reports: tuple[str, str], look: Callable[..., Any], tmp_path: Path, chromium: Any
) -> None:
    assert not re.search(r"""(?:src|href)=["'](?!data:|#)""", reports[1])
    (tmp_path / "report.html").write_text(reports[1])
    page = look((tmp_path / "report.html").as_uri(), offline=True)
    assert page.evaluate("[...document.images].every(i => i.complete && i.naturalWidth > 100)")
    for width in (390, 1280):
        page.set_viewport_size({"width": width, "height": 720})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.emulate_media(media="print")
    assert page.evaluate("getComputedStyle(document.body).color") == "rgb(0, 0, 0)"
