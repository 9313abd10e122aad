"""A fleet as text on the terminal, and as a self-contained page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gyrocal.digits import percentage
from gyrocal.fleet.fit import Fleet
from gyrocal.fleet.missing import Missing
from gyrocal.fleet.trend import Board, Trend
from gyrocal.present import page
from gyrocal.present.output import plus_minus, stdout, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 20
"""Odd boards and failed sessions that are listed; the JSON has all of them."""
COLUMNS = ["parameter:", "mean", "spread over boards", "spread over rigs"]


def headline(fleet: Fleet) -> str:
    """The outcome in one sentence."""
    boards = len({b.board for b in fleet.boards})
    lacking = ", ".join(dict.fromkeys(f"{m.effect} on {m.axis}" for m in fleet.missing))
    odd = len({o.session for o in fleet.outliers})
    what = f"the model lacks {lacking}" if lacking else "the model lacks nothing that these boards could show"
    return f"{boards} boards: {what}; {odd} odd session{'' if odd == 1 else 's'}, {len(fleet.failed)} failed."


def population_rows(fleet: Fleet) -> list[list[str]]:
    """Parameter, mean, spread over boards and spread over rigs, each with its standard error."""
    return [
        [name, plus_minus(p.mean, p.se), plus_minus(p.sd, p.sd_se),
         "-" if p.rig_sd is None else plus_minus(p.rig_sd, p.rig_sd_se)]
        for name, p in fleet.population.items()
    ]  # fmt: skip


def missing_words(m: Missing) -> str:
    """One missing effect in words."""
    at = "".join(f", {name} = {value:.3g}" for name, value in m.nonlinear.items())
    alone = f"{m.named_alone_by} boards show it by themselves" if m.named_alone_by else "no board shows it by itself"
    rivals = f" The boards cannot distinguish it from {', '.join(i for i in m.group if i != m.effect)}." if m.group else ""
    return (
        f"{m.effect} on {m.axis}: {m.parameter} = {plus_minus(m.mean, m.mean_se)} on average{at}; {percentage(m.share)} of the "
        f"boards have it, with a spread of {m.sd:.2g}. Held-out gain {m.heldout_gain:.1f}; {alone}. "
        f"It belongs to {m.belongs_to}.{rivals}"
    )


def trend_words(t: Trend) -> str:
    """One trend in words."""
    line = f" on line {t.line}" if t.line else ""
    how = f"steps at {t.change}" if t.shape == "step" else f"changes steadily from {t.change} on"
    return f"{t.parameter}{line} {how}, from {t.before:.4g} to {t.after:.4g} (probability of chance {t.p_value:.1g})."


def print_fleet(fleet: Fleet, out: Path) -> None:
    """Print the population, what it lacks, and the boards that it does not explain."""
    table("", COLUMNS, population_rows(fleet))
    stdout.print(fleet.attribution, markup=False)
    for told in [*map(missing_words, fleet.missing), *map(trend_words, fleet.trends)]:
        stdout.print(told, markup=False)
    for o in fleet.outliers[:SHOWN]:
        stdout.print(f"odd: {o.session}: {o.why}", markup=False)
    for d in fleet.failed[:SHOWN]:
        stdout.print(f"failed: {d.session}: {d.reason}", markup=False)
    stdout.print(headline(fleet), style="bold")
    stdout.print(f"{out / 'population.toml'} is a model for `calibrate` and `export`; {out / 'report.html'} shows the fleet")


def write_page(path: Path, fleet: Fleet, dashboard: str | None = None) -> None:
    """Write the fleet as one self-contained HTML page. Raises InputError if the file cannot be written."""
    from gyrocal.present.pictures import png_data

    name = f"A fleet of {len({b.board for b in fleet.boards})} boards"
    text = page.render(
        "present/fleet.html", name, headline(fleet), not fleet.missing, (),
        attribution=fleet.attribution, dashboard=dashboard, population_columns=COLUMNS,
        population=population_rows(fleet), missing=[missing_words(m) for m in fleet.missing],
        histograms=[(name, png_data(histogram(fleet, name))) for name in _shown(fleet)],
        outliers=[(o.session, o.why) for o in fleet.outliers[:SHOWN]], more_outliers=len(fleet.outliers[SHOWN:]),
        trends=[(trend_words(t), png_data(course(fleet, t))) for t in fleet.trends],
        failed=[(d.session, d.reason) for d in fleet.failed[:SHOWN]],
    )  # fmt: skip
    page.write(path, text)


def _shown(fleet: Fleet) -> list[str]:
    """The parameters, and the levels of the noise in which a board is odd."""
    return [*fleet.population, *sorted({o.parameter for o in fleet.outliers} & fleet.noise.keys())]


def histogram(fleet: Fleet, name: str) -> Figure:
    """A parameter's estimates and the fitted population; odd boards are marked where they lie, or at the edge."""
    from gyrocal.present.pictures import BLUE, ORANGE, framed

    found, of = (fleet.population | fleet.noise)[name], fleet.estimates[name]
    used = of.values[found.used]
    figure, axes = framed(7.0, 2.6)
    axes.hist(used, bins=min(60, max(8, int(np.sqrt(used.size)) * 2)), density=True, color=BLUE, alpha=0.5, label="boards")
    wide = float(np.sqrt(found.sd**2 + (found.rig_sd or 0.0) ** 2 + np.median(of.se) ** 2))
    reach = 5 * max(wide, 1e-300)
    x = np.linspace(found.mean - reach, found.mean + reach, 300)
    axes.plot(x, np.exp(-0.5 * ((x - found.mean) / wide) ** 2) / (wide * np.sqrt(2 * np.pi)), color=BLUE, label="population")
    odd = np.clip(of.values[~found.used], found.mean - 1.5 * reach, found.mean + 1.5 * reach)
    if odd.size:
        axes.plot(odd, np.zeros(odd.size), "v", color=ORANGE, clip_on=False, label="odd")
    axes.set_xlabel(name)
    axes.set_ylabel("density")
    axes.legend()
    return figure


def course(fleet: Fleet, t: Trend) -> Figure:
    """A parameter of a line's boards in the order in which they were made, with the trend."""
    from gyrocal.present.pictures import BLUE, ORANGE, framed

    found, of = (fleet.population | fleet.noise)[t.parameter], fleet.estimates[t.parameter]
    made = [
        (Board(b.line or "", b.made_on, b.board), value)
        for i, value, used in zip(of.sessions, of.values, found.used, strict=True)
        if used and ((b := fleet.boards[i]).line or "") == t.line
    ]
    made.sort(key=lambda pair: pair[0].order)
    figure, axes = framed(7.0, 2.6)
    axes.plot([value for _, value in made], ".", color=BLUE, label="boards")
    at = next((i for i, (b, _) in enumerate(made) if t.change in (b.made_on, b.serial)), 0)
    if t.shape == "step":
        axes.plot([0, at, at, len(made)], [t.before, t.before, t.after, t.after], color=ORANGE, label=f"step at {t.change}")
    else:
        axes.plot([0, len(made)], [t.before, t.after], color=ORANGE, label="steady change")
    axes.set_xlabel("number of the board, in the order of production")
    axes.set_ylabel(t.parameter)
    axes.legend()
    return figure
