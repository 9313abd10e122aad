"""Rates are told in mdps, and from one degree per second on in dps; numbers have the digits that their errors allow."""

from __future__ import annotations

import pytest

from gyrocal.digits import negligible, percent, rounded, shares
from gyrocal.units import DPS, MDPS, part_text, rate_text, unit_of


@pytest.mark.parametrize(
    ("value_dps", "told"),
    [(0.0, "0 mdps"), (0.0125, "12.5 mdps"), (-0.2, "-200 mdps"), (0.9994, "999 mdps"), (0.9996, "1 dps"), (12.34, "12.3 dps")],
)
def test_a_rate_has_three_digits_and_never_thousands_of_mdps(value_dps: float, told: str) -> None:
    assert rate_text(value_dps) == told


def test_figures_that_stand_together_have_one_unit() -> None:
    assert unit_of([0.1, None, -0.9]) is MDPS
    assert unit_of([0.1, None, -9.1254]) is DPS
    for unit, told in ((MDPS, "-9125.4"), (DPS, "-9.13")):
        assert unit.text(-9.1254, 1) == told
        assert unit.text(None) == "-"


@pytest.mark.parametrize(
    ("value_dps", "se_dps", "told"),
    [
        (23.22671, 0.0040, ("23.2267", "0.0040")), (2.6271234, 0.0016, ("2.6271", "0.0016")), (-1.5, 0.25, ("-1.50", "0.25")),
        (1234.5, 56.7, ("1234", "57")), (-0.0001, 0.02, ("0.000", "0.020")), (1.5, None, ("1.50", "-")),
    ],
)  # fmt: skip
def test_a_value_ends_at_the_second_digit_of_its_error(
    value_dps: float, se_dps: float | None, told: tuple[str, str]
) -> None:
    assert DPS.pair(value_dps, se_dps) == told


def test_the_same_holds_for_percents_and_for_small_parameters() -> None:
    assert percent(0.0245678, 0.000123) == ("2.457", "0.012")
    assert rounded(1.234e-9, 2.3e-11, 4) == "1.234e-09"
    assert rounded(0.0015983, 0.0000035, 4) == "0.0015983"


def test_the_sign_of_a_positive_value_is_shown_if_asked_for() -> None:
    assert rate_text(1.763, "+") == "+1.76 dps"


@pytest.mark.parametrize(
    ("part", "told"), [(0.00042, "+420 ppm"), (-0.00999, "-9990 ppm"), (0.0123, "+1.23%"), (-0.554098, "-55.4%")]
)
def test_a_part_of_the_rate_has_no_hundred_thousands_of_ppm(part: float, told: str) -> None:
    assert part_text(part, "+") == told


def test_a_share_far_below_the_error_is_not_told_with_more_digits_than_the_error() -> None:
    told = shares([(2.5e-5, True), (4.4e-4, False), (3.1e-7, True), (5.3e-8, False), (0.0, False), (None, False)], 100.0)
    assert told == ["0.0025", "0.044", "0.00003", "< 0.00001", "0", "-"]
    assert [negligible(of) for of in told] == [False, False, False, True, True, False]
    assert not any("e-" in of for of in shares([(1e-3, True), (1.3e-8, False), (6e-20, False)], 1.0))


@pytest.mark.parametrize("whole", [3e-6, 0.0025, 0.7, 45.0, 1234.0])
def test_shares_are_told_within_a_hundredth_of_the_whole(whole: float) -> None:
    parts = [whole * part for part in (0.9999, 0.3, 0.042, 0.0099, 0.002, 1e-9)]
    for part, text in zip(parts, shares([(part, True) for part in parts], 1.0), strict=True):
        shown = float(text.removeprefix("< "))
        assert part < shown if text.startswith("<") else abs(part - shown) <= 0.06 * part + 0.005 * whole
