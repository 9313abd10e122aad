"""Everything on the screen as one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from typing import Any

from gyrocal import __version__, pictures
from gyrocal.api import Comparison
from gyrocal.output import plus_minus
from gyrocal.report import headline, level_rows
from gyrocal.web import charts
from gyrocal.web.views import Bar, CalibrationView, Card, DiagnosisView


def page(
    name: str, found: Comparison, remark: str, bars: Sequence[Bar], floor_mdps: float,
    diagnosis: DiagnosisView | None, calibration: CalibrationView | None,
) -> str:  # fmt: skip
    """The page's text."""
    import jinja2

    drawn = [
        ("Residual against time", pictures.png_data(pictures.residual_against_time(found))),
        ("Spectrum", pictures.png_data(pictures.spectra(found))),
        ("Allan deviation", pictures.png_data(pictures.allan(found))),
    ]
    compared = found.to_json()
    blocks = charts.blocks(charts.LIGHT, bars)
    template = (files("gyrocal") / "web" / "report.html").read_text(encoding="utf-8")
    text: str = jinja2.Environment(autoescape=True).from_string(template).render(
        name=name, adequate=found.verdict == "adequate", headline=headline(found), model=", ".join(compared["model"]),
        held_out=found.held_out, remark=remark, levels=level_rows(found), where=found.where, pictures=drawn,
        bars=blocks, top=max((b.high for b in blocks), default=1.0) or 1.0, floor_mdps=floor_mdps, diagnosis=diagnosis,
        calibration=calibration, parameters=compared["parameters"], evidence=evidence, drawn=_drawn, version=__version__,
    )  # fmt: skip
    return text


def evidence(card: Card) -> list[tuple[str, str]]:
    """What speaks for an effect, in words: (what, how much)."""
    judged: dict[str, Any] = card.judged
    rows = [("size", card.size)]
    if judged["explained"] is not None:
        rows.append(("explains", f"{judged['explained']:.0%} of the excess error on {judged['axis']}"))
    if judged["heldout_gain"] is not None:
        gain = plus_minus(judged["heldout_gain"], judged["heldout_gain_se"])
        rows.append(("on unseen data", f"held-out gain {gain} in log-likelihood"))
    if judged["q_value"] is not None:
        rows.append(("by chance", "practically impossible" if judged["q_value"] < 1e-9 else f"q = {judged['q_value']:.2g}"))
    if card.looks_like:
        rows.append(("cannot be told from", ", ".join(card.looks_like)))
        rows.append(("to part them", judged["next_measurement"]))
    elif judged["decision"] == "suggest" and judged["next_measurement"]:
        rows.append(("to be sure", judged["next_measurement"]))
    return rows


def _drawn(card: Card) -> str:
    assert card.signature is not None
    return charts.signature_svg(card.signature.dots, card.signature.line, "signature")
