"""Rates are told in mdps, and from one degree per second on in dps."""

from __future__ import annotations

import pytest

from gyrocal.diagnosis.rate_unit import DPS, MDPS, part_text, rate_text, unit_of


@pytest.mark.parametrize(
    ("value_dps", "told"),
    [(0.0, "0 mdps"), (0.0125, "12.5 mdps"), (-0.2, "-200 mdps"), (0.9994, "999 mdps"), (0.9996, "1 dps"), (12.34, "12.3 dps")],
)
def test_a_rate_has_three_digits_and_never_thousands_of_mdps(value_dps: float, told: str) -> None:
    assert rate_text(value_dps) == told


def test_figures_that_stand_together_have_one_unit_and_the_same_resolution() -> None:
    assert unit_of([0.1, None, -0.9]) is MDPS
    assert unit_of([0.1, None, -9.1254]) is DPS
    for unit, told in ((MDPS, "-9125.4"), (DPS, "-9.1254")):
        assert unit.text(-9.1254, 1) == told
        assert unit.text(None) == "-"


def test_the_sign_of_a_positive_value_is_shown_if_asked_for() -> None:
    assert rate_text(1.763, "+") == "+1.76 dps"


@pytest.mark.parametrize(
    ("part", "told"), [(0.00042, "+420 ppm"), (-0.00999, "-9990 ppm"), (0.0123, "+1.23%"), (-0.554098, "-55.4%")]
)
def test_a_part_of_the_rate_has_no_hundred_thousands_of_ppm(part: float, told: str) -> None:
    assert part_text(part, "+") == told
