"""docs/walkthrough.md: the figures by which it explains held-out data, likelihood and probability are those of its pictures."""

from pathlib import Path

import numpy as np
import pytest

from study import study

pytestmark = pytest.mark.slow
PAGE = (Path(__file__).parents[1] / "docs" / "walkthrough.md").read_text(encoding="utf-8")


def test_the_page_states_the_figures_of_its_pictures(tmp_path: Path) -> None:
    found = study("walk_pictures").draw(tmp_path)
    words = " ".join(PAGE.split())
    assert f"a new power cycle to be 0 ± {1e3 * found.before_dps:.0f} mdps" in words
    assert f"With the effect it expects 0 ± {1e3 * found.after_dps:.0f} mdps" in words
    assert f"What a gain of {found.gain:.0f} ± {found.error:.0f} means" in words
    assert f"{found.gain / found.gains.size:.1f} on average" in words
    assert f"One of the {found.gains.size} has a negative gain" in words
    assert np.sum(found.gains < 0) == 1
    assert f"the odds that the effect acts, {found.log_odds:.0f} here" in words
    for name in ("heldout", "gain", "probability"):
        assert f"images/walk_{name}.png" in PAGE
        assert (tmp_path / f"walk_{name}.png").stat().st_size > 10_000
