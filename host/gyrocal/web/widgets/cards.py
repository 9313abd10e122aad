"""The cards of effects: what is missing, what was added and how, and what was looked for and not found."""

from __future__ import annotations

import html
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from nicegui import ui

from gyrocal.web.pictures.small_picture import checks_svg, signature_svg
from gyrocal.web.pictures.words import evidence, no_picture, symbols
from gyrocal.web.state.on_page import on_page
from gyrocal.web.state.workbench import Workbench
from gyrocal.web.values.models import Step
from gyrocal.web.values.views import Card, DiagnosisView, Picture

Rows = Iterable[tuple[str, str]]


def grouped(cards: Iterable[Card]) -> list[list[Card]]:
    """The cards of one effect that are judged alike stand together, one for each axis: Add takes them all at once."""
    alike: dict[tuple[str, str, bool, tuple[str, ...]], list[Card]] = {}
    for card in cards:
        judged = card.judged
        alike.setdefault((judged["effect"], judged["decision"], bool(card.doubts), tuple(card.looks_like)), []).append(card)
    return list(alike.values())


def evidence_of(cards: Sequence[Card]) -> list[tuple[str, str]]:
    """The evidence of cards of one effect as rows of a name and a text; what is the same on all axes stands once."""
    of_axis = {card.judged["axis"]: dict(evidence(card)) for card in cards}
    out = []
    for name in dict.fromkeys(name for rows in of_axis.values() for name in rows):
        texts = {axis: rows[name] for axis, rows in sorted(of_axis.items()) if name in rows}
        if len(texts) == len(cards) and len(set(texts.values())) == 1:
            out.append((name, texts.popitem()[1]))
        else:
            told = [text if f"on {axis}" in text else f"on {axis}: {text}" for axis, text in texts.items()]
            out += zip([name, *[""] * (len(told) - 1)], told, strict=True)
    return out


def effect_card(
    bench: Workbench, cards: Sequence[Card], choose: Callable[[Card], None], *, added: bool = False
) -> list[ui.button]:  # fmt: skip
    """One card for an effect on one axis or on several. Returns its buttons, each of which starts a fit.

    ``choose`` shows the picture of a card in full. With ``added`` the model has the effect.
    """
    first, buttons = cards[0], []
    passed, proven = first.judged["decision"] == "add", not first.doubts
    word = "a hint, not enough to be sure" if not passed else "one of several" if first.looks_like else "proven"
    with ui.element("article").classes(f"card {'add' if passed and not added else ''}"):
        _head(first.title, [card.judged["axis"] for card in cards], word, "add" if passed else "", added=added, proven=proven)
        drawn = [(card, card.picture) for card in cards if card.picture is not None]
        with ui.element("div").classes("evidenced"):
            ui.label(first.cause).classes("small")
            if drawn:
                with ui.element("div").classes("thumbnails"):
                    for card, picture in drawn:
                        _thumbnail(card, picture, choose)
        if not drawn:
            ui.label(no_picture(first.equation)).classes("dim small")
        listed(evidence_of(cards))
        for card in cards:
            small = checks_svg((card.judged.get("checks") or {}).get("share"), card.halves)
            if small:
                where = f" on {card.judged['axis']}" * (len(cards) > 1)
                told = f"Its checks{where}: the line is its size in all recordings, whiskers are two standard errors."
                ui.label(told).classes("dim small")
                ui.html(small, sanitize=False)
        with ui.row().classes("tight"):
            if not added:
                act = partial(bench.add, first.judged["effect"], first.title)
                button = ui.button("Add to the model", icon="add", on_click=act, color=None)
                button.props("unelevated no-caps" if passed else "outline no-caps").classes("primary" if passed else "")
                buttons.append(button)
            ui.label(first.equation).classes("equation")
        if symbols(first.equation):
            ui.label(symbols(first.equation)).classes("dim small")
    return buttons


def _head(title: str, axes: Sequence[str], word: str, kind: str, *, added: bool, proven: bool) -> None:
    """The title of a card with its axes, and in a badge what is known of it; a model that has it says so instead."""
    with ui.element("div").classes("head"):
        ui.html(f"<h2>{html.escape(title)}</h2>", sanitize=False)
        with ui.element("span"):
            for k, axis in enumerate(sorted(axes)):
                ui.label(f", {axis}" if k else f"on {axis}").classes(f"axis-{axis}").style("display: inline")
        ui.space()
        if added:
            word, kind = ("in the model now", "good") if proven else ("in the model, not proven", "bad")
        ui.label(word).classes(f"badge {kind}")


def listed(rows: Rows) -> None:
    """Rows of a name and a text."""
    with ui.element("dl").classes("evidence").style("margin: 0"):
        for name, text in rows:
            ui.html(f"<dt>{html.escape(name)}</dt>", sanitize=False)
            ui.html(f"<dd>{html.escape(on_page(text))}</dd>", sanitize=False)


def _thumbnail(card: Card, shown: Picture, choose: Callable[[Card], None]) -> None:
    """The picture of the effect in small. A press shows it in full."""
    assert card.signature is not None
    words = f"picture of {card.title} on {shown.axis}"
    band = [(x, y - 2 * se, y + 2 * se) for x, y, se in zip(shown.centres, shown.curve, shown.se, strict=True)]
    with ui.element("div").style("flex: none"):
        button = ui.element("button").classes("thumbnail").props(f'type="button" aria-label="{words}, in full"')
        with button.on("click", lambda: choose(card)):
            small = signature_svg(card.signature.dots, card.signature.line, words, band, few=card.signature.few)
            ui.html(small, sanitize=False)
        ui.label(f"{shown.axis}: left over (dots) and effect (line) {card.signature.title}").classes("dim small").style(
            "max-width: 220px"
        )


def by_hand(bench: Workbench, step: Step) -> None:
    """An effect that was added without a card of the diagnosis: its size, and what the session excludes."""
    with ui.element("article").classes("card"):
        _head(step.title, sorted(step.axes), "", "", added=True, proven=not step.recipe.doubts)
        rows = [(f"size on {axis}", size) for axis, size in sorted(step.sizes.items()) if size]
        listed([*rows, *(("not found" if k == 0 else "", told) for k, told in enumerate(step.recipe.limits))])
        for doubt in step.recipe.doubts:
            ui.label(f"In doubt: {doubt}.").classes("small")
        fall = bench.fall()
        if fall is not None:
            bar = fall.bars[bench.steps.index(step)]
            before, after = fall.told(bar.before), fall.told(bar.after)
            ui.label(f"With it, the excess error went from {before} to {after} {fall.unit.name}.")
        if step.formula:
            ui.label(step.formula.removeprefix(f"{step.title}: ")).classes("equation")


def not_found(found: DiagnosisView) -> None:
    """Folded lists of what was looked for and not found, with the sizes that are excluded, and of what cannot be shown."""
    looked: dict[str, list[str]] = {}
    blind: dict[str, tuple[Card, list[str]]] = {}
    for c in found.cards:
        if c.judged["decision"] == "reject":
            looked.setdefault(c.title, []).extend([f"on {c.judged['axis']}, {c.limit}"] if c.limit else [])
        elif c.judged["decision"] == "not_measurable":
            blind.setdefault(c.judged["effect"], (c, []))[1].append(c.judged["axis"])
    if looked:
        with _folded(f"Looked for and not found ({len(looked)})"):
            for title, limits in looked.items():
                ui.label(f"{title}{': ' * bool(limits)}{'; '.join(sorted(limits))}").classes("small dim")
    if blind:
        nowhere = len(blind.keys() - {c.judged["effect"] for c in found.cards if c.judged["decision"] != "not_measurable"})
        some = f", and {len(blind) - nowhere} on some axes only" * (len(blind) > nowhere)
        with _folded(f"This recording cannot show ({nowhere}{some})"):
            for card, axes in blind.values():
                ui.label(on_page(f"{card.title} on {', '.join(axes)}: {card.judged['next_measurement']}")).classes("small dim")


def together(found: DiagnosisView) -> None:
    """What no effect describes, and a folded list of the sets of effects that explain each axis."""
    if found.left_over:
        ui.label(found.left_over).classes("small")
    if found.sets:
        with _folded("What explains each axis together"):
            listed((f"{of_100} of 100, on {axis}", explained) for axis, explained, of_100 in found.sets)


def _folded(words: str) -> ui.expansion:
    return ui.expansion(words).classes("face").style("flex: none; padding: 0")
