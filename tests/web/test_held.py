"""A parameter held at a value by hand, in the browser: the value stays, the step is told, undone, and restored."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gyrocal.simulation.simulate import simulate


@pytest.fixture(scope="module")
def served(workbench: Any, chromium: Any) -> Any:
    """A warm-up, and a tone that stays unnamed: where a test fails, the worker names nothing, which costs more than the fit."""
    effects = ["warmup:A_dps=0.3,tau_s=20", "vibration_tone:f_hz=11.83,A_dps=0.05"]
    simulate(workbench.folder / "warm", "paper", effects, 3, scenarios=2, seconds=15.0)
    return workbench


@pytest.mark.wide
def test_a_parameter_is_held_freed_and_undone(served: Any, look: Callable[..., Any]) -> None:
    page = look(f"{served.url}diagnose?session=warm")
    page.get_by_role("combobox", name="effect").click()
    page.get_by_role("option", name="Warm", exact=False).first.click()
    page.get_by_role("button", name="Try it").click()
    folded = page.locator("summary", has_text="Parameters, all 1 fitted")
    folded.click()
    value = page.get_by_label(re.compile("^value of tau_s of .* on z"))
    value.fill("20")
    page.get_by_role("button", name=re.compile("^hold tau_s")).click()
    page.locator("summary", has_text="Parameters, 1 of 1 held").click()
    page.get_by_text(re.compile(r"tau_s of .* on z: 20 s, held")).wait_for()
    page.get_by_text("not proven", exact=False).first.wait_for()  # holding a parameter proves nothing
    label = page.locator('[aria-label^="excess error, mdps:"]')
    assert len(str(label.get_attribute("aria-label")).split(": ")[1].split()) == 3
    page.get_by_role("button", name="Undo").click()
    page.locator("summary", has_text="Parameters, all 1 fitted").wait_for()
    page.get_by_role("button", name="Redo").click()
    page.locator("summary", has_text="Parameters, 1 of 1 held").click()
    page.get_by_role("button", name=re.compile("^free tau_s")).click()
    page.locator("summary", has_text="Parameters, all 1 fitted").wait_for()
    page.get_by_text("in the model, not proven").wait_for()  # its card stays
    assert '"held"' in (Path(served.folder) / "warm" / "workbench.json").read_text()


@pytest.mark.wide
def test_a_refusal_stands_beside_the_field_and_typing_filters(served: Any, look: Callable[..., Any]) -> None:
    """It named the effect by its id in a toast that lay over the field, and the list had to be scrolled."""
    page = look(f"{served.url}diagnose?session=warm")
    field = page.get_by_role("combobox", name="effect")
    field.click()
    page.get_by_role("option").nth(5).wait_for()
    field.press_sequentially("clip")
    page.wait_for_function("() => document.querySelectorAll('[role=option]').length === 1")
    page.get_by_role("option", name="Clipping at full scale").click()
    page.get_by_role("button", name="Try it").click()
    told = page.locator(".face", has=page.get_by_role("button", name="Try it")).get_by_role("status")
    told.get_by_text("Clipping at full scale was not added: this session does not show it").wait_for()
    assert not page.locator(".q-notification").is_visible()
    field.fill("sensitivity to gravity")
    page.get_by_role("option", name="Sensitivity to gravity").click()
    page.get_by_role("button", name="Try it").click()
    card = page.locator("article.card", has_text="in the model, not proven")
    card.get_by_text(re.compile(r"gz_dps_per_g -?[\d.e-]+ ± [\d.e-]+ dps/g")).wait_for()
    card.get_by_text(re.compile(r"on [xyz], \|gz_dps_per_g\| is below [\d.e-]+ dps/g at 95 %")).first.wait_for()


def test_every_effect_of_the_library_is_offered(served: Any, look: Callable[..., Any]) -> None:
    from gyrocal.effects.base import effects

    page = look(f"{served.url}diagnose?session=warm")
    page.get_by_role("combobox", name="effect").click()
    listed = page.locator(".q-menu [role=option]")
    listed.first.wait_for()
    titles: set[str] = set()
    down = "e => { const was = e.scrollTop; e.scrollTop += 150; return e.scrollTop > was; }"
    while True:  # the list draws only what is on the screen
        page.wait_for_timeout(60)
        titles |= set(listed.all_inner_texts())
        if not page.locator(".q-menu").evaluate(down):
            break
    assert titles == {kind.title for kind in effects().values() if kind.parameters and kind.role is None}
