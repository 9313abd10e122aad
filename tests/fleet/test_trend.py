"""Trends of a production line: planted ones are found with their place, and chance ones are not."""

import numpy as np
import pytest

from gyrocal.fleet.trend import Board, _on_line, find


def boards(n: int, line: str = "A", dated: bool = True) -> list[Board]:
    return [Board(line, f"2026-01-{1 + i // 10:02d}" if dated else None, f"B{i}") for i in range(n)]


def test_a_step_is_found_at_its_date() -> None:
    y = np.random.default_rng(1).normal(0, 1, 200) + np.where(np.arange(200) >= 120, 1.5, 0.0)
    (found,) = find({"scale.z.scale": (y, boards(200))})
    assert (found.shape, found.change) == ("step", "2026-01-13")
    assert found.after - found.before == pytest.approx(1.5, abs=0.5)


def test_serial_numbers_order_boards_without_dates() -> None:
    y = np.random.default_rng(2).normal(0, 1, 200) + np.where(np.arange(200) >= 120, 1.5, 0.0)
    made = boards(200, dated=False)
    mixed = np.random.default_rng(3).permutation(200)
    (found,) = find({"scale.z.scale": (y[mixed], [made[i] for i in mixed])})
    assert abs(int(found.change[1:]) - 120) <= 5


def test_a_steady_change_is_a_slope() -> None:
    y = np.random.default_rng(4).normal(0, 1, 300) + np.linspace(-1.5, 1.5, 300)
    (found,) = find({"scale.z.scale": (y, boards(300))})
    assert found.shape == "slope"
    assert found.after - found.before == pytest.approx(3.0, abs=0.7)


def test_chance_is_no_trend() -> None:
    rng = np.random.default_rng(5)
    alarms = [find({name: (rng.normal(0, 1, 100), boards(100)) for name in ("a", "b", "c")}) for _ in range(200)]
    assert sum(map(bool, alarms)) <= 9  # more has a probability of 2 % where the rate is 2 %


def test_a_line_is_judged_by_itself() -> None:
    rng = np.random.default_rng(6)
    step = rng.normal(0, 1, 100) + np.where(np.arange(100) >= 50, 3.0, 0.0)
    found = find({"a": (np.concatenate([step, rng.normal(9, 1, 100)]), [*boards(100, "A"), *boards(100, "B")])})
    assert [t.line for t in found] == ["A"]


def test_the_chance_of_a_trend_is_what_it_says() -> None:
    """Half of the lines without a trend have a chance below a half, and a few less, as a sum over boards goes in steps."""
    rng, made = np.random.default_rng(7), boards(100, dated=False)
    found = [_on_line("a", "A", [(b, float(v)) for b, v in zip(made, rng.normal(0, 1, 100), strict=True)]) for _ in range(200)]
    chances = np.array([one.p_value for one in found if one is not None])
    assert chances.size == 200
    assert 0.3 < np.mean(chances < 0.5) < 0.6
