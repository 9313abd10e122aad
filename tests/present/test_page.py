"""The pages share one style, their text is escaped, and they load nothing from elsewhere."""

import re
from pathlib import Path

import pytest

from gyrocal.errors import InputError
from gyrocal.present import page
from gyrocal.warning import Warning

PACKAGE = Path(page.__file__).parents[1]
TEMPLATES = [p for p in sorted(PACKAGE.rglob("*.html")) if p.name != "page.html"]


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_a_page_takes_its_style_and_verdict_from_the_shared_one(template: Path) -> None:
    text = template.read_text(encoding="utf-8")
    assert text.startswith('{% extends "present/page.html" %}')
    assert not set(re.findall(r"^(\S+) \{ ", text, re.M)) & {":root", "body", "table", ".verdict", ".blocking"}


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_every_table_has_a_header_and_no_name_changes_its_case(template: Path) -> None:
    """Parameters are k3 and not K3: a name is as the model file has it."""
    text = template.read_text(encoding="utf-8")
    assert "<table" not in text, "`table(columns, rows)` makes a header that is repeated on each printed page"
    assert not re.search(r"\|\s*(upper|capitalize|title)\b", text)


def test_text_is_escaped_and_blocking_warnings_come_first() -> None:
    warnings = [Warning("clipped", "z", None, "at the end"), Warning("rate_wrong", "z", "<b>.csv", "off", True)]
    text = page.render("present/page.html", "a<b", "It does not fit.", False, warnings)
    assert "<h1>a&lt;b</h1>" in text
    assert "<b>.csv" not in text
    assert text.index('class="blocking"') < text.index('class="warning"')
    assert not re.search(r"""(?:src|href)=["'](?!data:|#)""", text)


def test_a_page_that_cannot_be_written_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"missing/page\.html"):
        page.write(tmp_path / "missing" / "page.html", "text")
