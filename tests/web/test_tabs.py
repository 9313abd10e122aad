"""Two tabs of one workbench: the one whose session another tab has replaced says so, and returns to its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from gyrocal.simulation.simulate import simulate

OTHER = "[aria-label='another session']"


@pytest.fixture(scope="module")
def served(workbench: Any, chromium: Any) -> Any:
    for name in ("mine", "yours"):
        simulate(workbench.folder / name, "paper", ["table_ripple"], 3, scenarios=1, seconds=8.0)
    return workbench


@pytest.mark.wide
def test_a_tab_whose_session_was_replaced_says_so_and_returns(served: Any, look: Callable[..., Any]) -> None:
    """Its session changed without a word, and with it the address, so that a reload did not bring it back."""
    first = look(f"{served.url}compare?session=mine")
    first.locator(".figure b").first.wait_for()
    second = look(f"{served.url}compare?session=yours")
    first.get_by_text("Another tab has opened yours.").wait_for()
    assert first.url.endswith("compare?session=mine")
    second.locator(".figure b").first.wait_for()
    assert not second.locator(OTHER).is_visible()  # it was this tab that opened it
    first.get_by_role("button", name="Return to mine").click()
    second.get_by_text("Another tab has opened mine.").wait_for()
    first.locator(".figure b").first.wait_for()
    assert not first.locator(OTHER).is_visible()
    second.get_by_role("button", name="Stay with mine").click()
    second.wait_for_url("**/compare?session=mine")
    assert not second.locator(OTHER).is_visible()


@pytest.mark.wide
def test_a_session_that_is_opened_from_the_list_is_the_tabs_own(served: Any, look: Callable[..., Any]) -> None:
    """The button that opens it is gone before the session is read."""
    other = look(f"{served.url}compare?session=mine")
    other.locator(".figure b").first.wait_for()
    page = look(f"{served.url}start")
    page.get_by_role("button", name="yours", exact=False).first.click()
    page.wait_for_url("**/compare?session=yours")
    page.locator(".figure b").first.wait_for()
    assert not page.locator(OTHER).is_visible()
    other.get_by_text("Another tab has opened yours.").wait_for()


def test_an_unknown_session_in_the_address_is_no_other_tabs_doing(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}compare?session=nowhere")
    page.get_by_role("button", name="Open", exact=False).first.wait_for()
    page.wait_for_timeout(500)
    assert not page.locator(OTHER).is_visible()
