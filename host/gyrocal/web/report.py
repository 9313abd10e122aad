"""Everything on the screen as one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Sequence

from gyrocal.api import Comparison
from gyrocal.present import pictures
from gyrocal.present.page import render
from gyrocal.present.report import headline, level_rows
from gyrocal.web import charts
from gyrocal.web.views import Bar, CalibrationView, Card, DiagnosisView
from gyrocal.web.words import evidence


def page(
    name: str, found: Comparison, bars: Sequence[Bar], floor_mdps: float,
    diagnosis: DiagnosisView | None, calibration: CalibrationView | None,
) -> str:  # fmt: skip
    """The report as HTML text."""
    drawn = [
        ("Residual against time", pictures.png_data(pictures.residual_against_time(found))),
        ("Spectrum", pictures.png_data(pictures.spectra(found))),
        ("Allan deviation", pictures.png_data(pictures.allan(found))),
    ]
    compared = found.to_json()
    blocks = charts.blocks(charts.LIGHT, bars)
    return render(
        "web/report.html", name, headline(found), found.verdict == "adequate", found.warnings,
        model=", ".join(compared["model"]), held_out=found.held_out, levels=level_rows(found), where=found.where,
        pictures=drawn, bars=blocks, top=max((b.high for b in blocks), default=1.0) or 1.0, floor_mdps=floor_mdps,
        diagnosis=diagnosis, calibration=calibration, parameters=compared["parameters"], evidence=evidence, drawn=_drawn,
    )  # fmt: skip


def _drawn(card: Card) -> str:
    assert card.signature is not None
    return charts.signature_svg(card.signature.dots, card.signature.line, "signature")
