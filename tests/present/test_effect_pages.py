"""The pages that the effects' files make."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from gyrocal.present import effect_pages
from gyrocal.units import to_read


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    return effect_pages.pages()


def test_one_page_and_one_picture_a_kind_and_an_index(pages: dict[str, str], tmp_path: Path) -> None:
    assert set(pages) == {"README.md", *(f"{k.id}.{suffix}" for k in effect_pages.kinds() for suffix in ("md", "svg"))}
    assert effect_pages.main([str(tmp_path / "made")]) == 0
    assert {path.name: path.read_text(encoding="utf-8") for path in (tmp_path / "made").iterdir()} == pages


def test_links_lead_somewhere_and_pictures_are_pictures(pages: dict[str, str]) -> None:
    for name, text in pages.items():
        if name.endswith(".svg"):
            assert ElementTree.fromstring(text).tag.endswith("svg")
        for target in re.findall(r"\]\(([^)]+)\)", text):
            assert target in pages, f"{name} links to {target}"


def test_a_page_tells_what_its_effect_s_file_tells(pages: dict[str, str]) -> None:
    for kind in effect_pages.kinds():
        page = pages[f"{kind.id}.md"]
        assert kind.cause in page
        assert kind.equation in page
        assert kind.measure_next in page
        for p in kind.parameters:
            assert f"| `{p.name}` | {to_read(p.unit)} |" in page
            assert p.source in page


def test_wrong_use_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert effect_pages.main([]) == 2
    assert capsys.readouterr().err.count("\n") == 1
