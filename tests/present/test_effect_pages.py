"""The pages under docs/effects are those that the effects' files make."""

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from gyrocal.effects.base import effects
from gyrocal.present import effect_pages

FOLDER = Path(__file__).resolve().parents[2] / "docs/effects"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
ADVICE = "make them again: python -m gyrocal.present.effect_pages docs/effects"


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    return effect_pages.pages()


def test_one_page_and_one_picture_an_effect_and_an_index(pages: dict[str, str]) -> None:
    expected = {"README.md", *(f"{i}.{suffix}" for i in effects() for suffix in ("md", "svg"))}
    assert set(pages) == expected
    assert {path.name for path in FOLDER.iterdir()} == expected, ADVICE


def test_pages_are_up_to_date(pages: dict[str, str]) -> None:
    """Texts to the letter; pictures to a quarter of a pixel, for the last bits of sines differ between machines."""
    for name, text in pages.items():
        kept = (FOLDER / name).read_text(encoding="utf-8")
        if name.endswith(".md"):
            assert kept == text, f"{name}: {ADVICE}"
        else:
            assert NUMBER.sub("#", kept) == NUMBER.sub("#", text), f"{name}: {ADVICE}"
            old, new = (np.array(NUMBER.findall(each), float) for each in (kept, text))
            np.testing.assert_allclose(new, old, atol=0.25, err_msg=f"{name}: {ADVICE}")


def test_links_lead_somewhere_and_pictures_are_pictures(pages: dict[str, str]) -> None:
    for name, text in pages.items():
        if name.endswith(".svg"):
            assert ElementTree.fromstring(text).tag.endswith("svg")
        for target in re.findall(r"\]\(([^)]+)\)", text):
            assert target in pages, f"{name} links to {target}"


def test_a_page_tells_what_its_effect_s_file_tells(pages: dict[str, str]) -> None:
    for kind in effects().values():
        page = pages[f"{kind.id}.md"]
        assert kind.cause in page
        assert kind.equation in page
        assert kind.measure_next in page
        for p in kind.parameters:
            assert f"| `{p.name}` | {p.unit} |" in page
            assert p.source in page


def test_wrong_use_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert effect_pages.main([]) == 2
    assert capsys.readouterr().err.count("\n") == 1
