"""Small round toggle buttons."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui import ui


def chip(text: str, act: Callable[[], Any]) -> ui.button:
    return ui.button(text, on_click=act, color=None).props("flat dense no-caps").classes("chip")


def press(button: ui.button, on: bool) -> None:
    """Show whether the button is pressed, visually and for screen readers."""
    button.classes(add="on" if on else "", remove="" if on else "on").props(f'aria-pressed="{str(on).lower()}"')
