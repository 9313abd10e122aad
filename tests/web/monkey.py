"""Random use of every page: clicks, keys, words and wheels drawn from a seed."""

from __future__ import annotations

import contextlib
import random
import re
from typing import Any

PAGES = ("start", "import", "live", "compare", "diagnose", "calibrate")
KEYS = ("Tab", "Enter", "Escape", "ArrowDown", "ArrowLeft", "ArrowRight", "Space", "Backspace")
WORDS = ("", "0", "-1", "78", "1e9", "s", "../..", "a b", "<b>x</b>", "gz_dps=gz:rad/s", "ü")
SIZES = ((1280, 720), (1920, 1080), (390, 844))
THINGS = """() => [...document.querySelectorAll(
        'button, a, input, textarea, summary, canvas, [role=button], [role=option], [role=checkbox]')]
    .filter(e => e.checkVisibility({visibilityProperty: true}) && !e.disabled && e.type !== 'file')
    .map(e => { const r = e.getBoundingClientRect();
                const text = e.innerText || e.ariaLabel || '';
                return [r.x + r.width / 2, r.y + r.height / 2, e.tagName, r.width, r.height, text]; })
    .filter(([x, y]) => x > 0 && y > 0 && x < innerWidth && y < innerHeight)"""


def play(page: Any, url: str, seed: int, acts: int, avoid: str) -> None:
    """Do so many acts on the pages, away from buttons whose text fits the expression ``avoid``."""
    rng = random.Random(seed)
    page.goto(f"{url}{rng.choice(PAGES)}")
    for _ in range(acts):
        kind = rng.random()
        if kind < 0.06:
            _leave(page, f"{url}{rng.choice(PAGES)}")
        elif kind < 0.12:
            page.keyboard.press(rng.choice(KEYS))
        elif kind < 0.14:
            width, height = rng.choice(SIZES)
            page.set_viewport_size({"width": width, "height": height})
        else:
            _touch(page, rng, avoid)
        page.wait_for_timeout(rng.choice((5, 30, 120)))


def _leave(page: Any, address: str) -> None:
    """Go to another page, unless a link that was clicked just before leads away first."""
    from playwright.sync_api import Error

    try:
        page.goto(address)
    except Error as refused:
        if "interrupted by another navigation" not in str(refused):
            raise


def _touch(page: Any, rng: random.Random, avoid: str) -> None:
    """Click something, write into it or turn the wheel over it."""
    from playwright.sync_api import Error

    things = []
    with contextlib.suppress(Error):  # the page is being left
        things = [thing for thing in page.evaluate(THINGS) if not re.search(avoid, thing[5])]
    if not things:
        return
    x, y, tag, width, height, _ = rng.choice(things)
    if tag == "CANVAS":
        x += (rng.random() - 0.5) * width
        y += (rng.random() - 0.5) * height
        page.mouse.move(x, y)
        page.mouse.wheel(0, rng.choice((-300, 300)))
    page.mouse.click(x, y)
    if tag in ("INPUT", "TEXTAREA"):
        page.keyboard.type(rng.choice(WORDS))
