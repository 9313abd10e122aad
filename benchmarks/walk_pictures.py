"""Pictures of docs/walkthrough.md: what held out, likelihood and probability mean.

    python benchmarks/walk_pictures.py docs/images

simulates the session of the walk-through, draws ``walk_heldout.png``, ``walk_gain.png`` and ``walk_probability.png``, and
prints the figures that the page states of them.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gyrocal.diagnosis.naming.gains import held_out_gain, total
from gyrocal.error_model.model import Model
from gyrocal.evidence.answer import weigh
from gyrocal.evidence.curve import KNOTS, of_set, stated
from gyrocal.inference import heldout
from gyrocal.inference.fit import fit
from gyrocal.inference.fitted import Fit
from gyrocal.present.figure import new_figure
from gyrocal.present.pictures import BLUE, GREY, ORANGE, framed
from gyrocal.recording.session import Array, Session
from gyrocal.simulation.simulate import simulate

AXIS, EFFECT, SEED = "z", "g_sensitivity", 7
"""The session of the page: ``gyrocal simulate mysession --campaign full --effect g_sensitivity --seed 7``."""


@dataclass(frozen=True)
class Judged:
    """One model on the axis: the error of each power cycle's prediction by the other days, and the expected spread, dps."""

    fit: Fit
    errors_dps: Array
    spread_dps: float

    @staticmethod
    def of(session: Session, model: Model) -> Judged:
        """The model, fitted and held against each day in turn."""
        fitted = fit(session, model)
        held = heldout.predictions(fitted.on(AXIS), heldout.folds(fitted))
        by_cycle = {p.run.scenario: float(np.mean(p.residual_dps)) for p in held}
        errors_dps = np.array([by_cycle[name] for name in session.scenarios])
        return Judged(fitted, errors_dps, float(fitted.axes[AXIS].spreads.scenario[0]))


def draw_heldout(path: Path, session: Session, before: Judged, after: Judged) -> None:
    """The error of each power cycle, predicted by the other days, without and with the effect."""
    figure, axes = framed(8, 3.4)
    days = [next(r.day for r in session.runs if r.scenario == name) for name in session.scenarios]
    at = np.arange(1, len(days) + 1)
    for one, colour, label in ((before, ORANGE, "without the effect"), (after, BLUE, "with the effect")):
        axes.axhspan(-1e3 * one.spread_dps, 1e3 * one.spread_dps, color=colour, alpha=0.15, linewidth=0)
        expected = f"{label} (band: ± {1e3 * one.spread_dps:.1f} mdps)"
        axes.plot(at, 1e3 * one.errors_dps, "o", color=colour, markersize=4, label=expected)
    for first in range(1, len(days)):
        if days[first] != days[first - 1]:
            axes.axvline(first + 0.5, color=GREY, linewidth=0.8)
    for day in dict.fromkeys(days):
        axes.text(float(np.mean(at[np.array(days) == day])), 66, f"day {day}", ha="center", color=GREY)
    axes.set(title="Each day predicted from the other two, z", xlabel="power cycle", ylim=(-75, 110))
    axes.set_ylabel("measured - predicted, mdps")
    axes.legend(loc="lower center", ncols=2, frameon=False, bbox_to_anchor=(0.5, 0.88), fontsize=9)
    figure.savefig(path)


def draw_gain(path: Path, before: Judged, after: Judged, gains: Array) -> None:
    """The density that each model gives to the offset of a new power cycle, and the gain of each power cycle."""
    figure = new_figure(8, 3.2, dpi=110)
    left, right = figure.subplots(1, 2)
    rate = np.linspace(-130, 130, 800)
    for one, colour, label in ((before, ORANGE, "without the effect"), (after, BLUE, "with the effect")):
        sd = 1e3 * one.spread_dps
        left.plot(rate, np.exp(-0.5 * (rate / sd) ** 2) / (sd * np.sqrt(2 * np.pi)), color=colour, label=label)
        level = 0.0022 if one is before else -0.0022
        left.plot(1e3 * one.errors_dps, np.full(one.errors_dps.size, level), "|", color=colour, markersize=7)
    left.set(title="How probable is an error of this size?", xlabel="error of the prediction, mdps", ylabel="density per mdps")
    left.legend(frameon=False, fontsize=8, loc="upper left")
    right.bar(np.arange(1, gains.size + 1), gains, color=BLUE, width=0.8)
    right.axhline(0, color=GREY, linewidth=0.8)
    right.set(title=f"Gain of each power cycle, {gains.sum():.0f} together", xlabel="power cycle", ylabel="log-likelihood")
    _bare(left, right)
    figure.savefig(path)


def draw_probability(path: Path, log_odds: float) -> None:
    """The share of true names among those with the same evidence, and what is stated of this effect."""
    figure, axes = framed(6.2, 3.4)
    known, shares = np.transpose(KNOTS)
    odds = np.linspace(-6, max(14.0, log_odds), 800)
    axes.plot(odds, 100 / (1 + np.exp(-odds)), "--", color=GREY, label="if the evidence alone were right")
    axes.plot(odds, [100 * of_set(x) for x in odds], color=ORANGE, label="share of true names in sessions with a known answer")
    axes.plot(known, 100 * shares, "o", color=ORANGE, markersize=5)
    told = 100 * stated(log_odds, None, named=True)
    axes.plot([log_odds], [told], "D", color=BLUE, markersize=8, label=f"{EFFECT}, which the tests name too: {told:.0f} %")
    axes.set(title="From evidence to a probability", xlabel="log odds by the evidence", ylim=(0, 105))
    axes.set_ylabel("true names, of 100")
    axes.legend(frameon=False, fontsize=9, loc="center right", bbox_to_anchor=(1.0, 0.4))
    figure.savefig(path)


def _bare(*plots: Any) -> None:
    for axes in plots:
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)


@dataclass(frozen=True)
class Figures:
    """The figures that the page states: spreads of power cycles in dps, gains of the power cycles, their sum with its error."""

    before_dps: float
    after_dps: float
    gains: Array
    gain: float
    error: float
    log_odds: float


def draw(out: Path) -> Figures:
    """Draw the three pictures into a folder."""
    session, _ = simulate(None, "full", [EFFECT], SEED)
    plain = Model.open("default")
    before, after = (Judged.of(session, model) for model in (plain, plain.add(EFFECT, AXIS)))
    gains = held_out_gain(before.fit.axes[AXIS], after.fit.axes[AXIS], heldout.folds(before.fit))
    gain, error = total(gains)
    assert gain is not None
    assert error is not None
    evidence = weigh(before.fit.axes[AXIS], [t.effect_id for t in before.fit.axes[AXIS].terms])
    assert evidence is not None
    log_odds = evidence.log_odds[EFFECT]
    draw_heldout(out / "walk_heldout.png", session, before, after)
    draw_gain(out / "walk_gain.png", before, after, gains)
    draw_probability(out / "walk_probability.png", log_odds)
    return Figures(before.spread_dps, after.spread_dps, gains, gain, error, log_odds)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    found = draw(parser.parse_args().out)
    print(f"spread of power cycles {1e3 * found.before_dps:.1f} mdps without the effect, {1e3 * found.after_dps:.1f} with it")
    print(f"gain {found.gain:.1f} ± {found.error:.1f} over {found.gains.size} power cycles, {np.sum(found.gains < 0)} negative")
    print(f"log odds {found.log_odds:.1f}, stated {stated(found.log_odds, None, named=True):.3f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
