"""A row of buttons that is one stop of the Tab key; the arrow keys, Home and End move within it."""

from __future__ import annotations

from nicegui import ui

MOVE = """event => {
    const items = [...event.currentTarget.querySelectorAll("button:not([disabled])")];
    const at = items.indexOf(document.activeElement);
    const to = items[{ArrowLeft: at - 1, ArrowRight: at + 1, Home: 0, End: items.length - 1}[event.key]];
    if (at < 0 || to === undefined) return;
    event.preventDefault();
    for (const item of items) item.tabIndex = item === to ? 0 : -1;
    to.focus();
}"""


def toolbar(row: ui.element, label: str) -> None:
    """Make a row of buttons a toolbar; call it when the buttons are in it. Its first button is the stop at first."""
    row.props(f'role="toolbar" aria-label="{label}"').on("keydown", js_handler=MOVE)
    buttons = [element for element in row.descendants() if element.tag in ("button", "q-btn")]
    for k, button in enumerate(buttons):
        button.props(f"tabindex={0 if k == 0 else -1}")
