"""The documentation as a site: ``make docs``, or ``python docs/_site/site.py``.

The pages of ``docs/``, the top level's README and its fellows, a page for each effect, the help of every command and the
Python interface are gathered in ``build/docs/pages``, with their links turned to the site's layout; mkdocs then writes
``build/docs/site``. A link to a page or a heading that is not there ends the build with exit code 1. ``--pages`` gathers the
pages alone, without mkdocs.
"""

from __future__ import annotations

import argparse
import os
import posixpath
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import reference

from gyrocal.present import effect_pages

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / "build" / "docs" / "pages"
ELSEWHERE = {
    "README.md": "index.md",
    "ARCHITECTURE.md": "architecture.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "firmware/gyrocal_firmware/lib/gyrocal_core/PROTOCOL.md": "protocol.md",
}
"""Pages outside ``docs/``, by their path in the repository, and where they stand in the site."""

COMMANDS = re.compile(
    r"(?<=\S)\n\n(?P<block>    (?:gyrocal|pip|make|python|docker|export|pytest|GYROCAL_\w+=)\b.*\n"
    r"(?:    .*\n|\n(?=    ))*)(?=\n)"
)
"""An indented block that begins with a command."""
ITEM = re.compile(r"\s*(?:[-*]|\d+\.)\s")
"""The begin of an item of a list, whose blocks are its own."""
WIDTH = 140
SENTENCE = re.compile(rf"^    [^│┃┏┗└┌|\s][^│┃|]{{{WIDTH},}}$", re.MULTILINE)
"""A line of a transcript that is too long, and no row of a table."""
LINK = re.compile(r"(?<=\]\()(?P<path>[^)\s#]*)(?P<anchor>#[^)\s]*)?(?=\))")


def gather(folder: Path) -> None:
    """Write every page of the site to ``folder``, which is emptied first.

    Raises:
        SystemExit: a page links to a file that is not a page of the site.
    """
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "docs" / "images", folder / "images")
    shutil.copy(Path(__file__).with_name("site.css"), folder)
    places = _places()
    for source, place in places.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        _write(folder / place, _with_commands_marked(_turned(text, source, place, places)))
    for name, text in effect_pages.pages().items():
        _write(folder / "effects" / name, text)
    _write(folder / "reference" / "commands.md", reference.commands())
    _write(folder / "reference" / "python.md", reference.python())


def _places() -> dict[str, str]:
    """Where each Markdown page of the repository stands in the site, by its path in the repository."""
    docs = {f"docs/{p.relative_to(ROOT / 'docs').as_posix()}": p for p in sorted((ROOT / "docs").rglob("*.md"))}
    return {**ELSEWHERE, **{source: path.relative_to(ROOT / "docs").as_posix() for source, path in docs.items()}}


def _turned(text: str, source: str, place: str, places: dict[str, str]) -> str:
    """The text of a page with its relative links turned from the repository's layout to the site's."""

    def turned(link: re.Match[str]) -> str:
        path, anchor = link["path"], link["anchor"] or ""
        if not path or ":" in path:
            return link[0]
        target = posixpath.normpath(posixpath.join(posixpath.dirname(source), path))
        images = "docs/images/"
        there = target.removeprefix("docs/") if target.startswith(images) else places.get(target)
        if there is None:
            sys.exit(f"{source}: the link {path} leads to no page of the site. Link to a page, or name the file in backquotes.")
        return posixpath.relpath(there, posixpath.dirname(place) or ".") + anchor

    return LINK.sub(turned, text)


def _with_commands_marked(text: str) -> str:
    """The text with its indented blocks of commands fenced as such, which the site colours and lets a reader copy.

    Long sentences in transcripts are wrapped, because a block has no room for more than :data:`WIDTH` characters.
    """

    def fenced(found: re.Match[str]) -> str:
        above = found.string[: found.start()].rpartition("\n\n")[2]
        return found[0] if ITEM.match(above) else f"\n\n```bash\n{textwrap.dedent(found['block'])}```\n"

    text = COMMANDS.sub(fenced, text)
    return SENTENCE.sub(lambda found: textwrap.fill(found[0], WIDTH, subsequent_indent="    ", break_long_words=False), text)


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--pages", action="store_true", help="gather the pages, and do not run mkdocs")
    pages_alone = options.parse_args().pages
    gather(PAGES)
    if pages_alone:
        return 0
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-f", str(ROOT / "mkdocs.yml")]
    site = subprocess.run(build, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"})
    if site.returncode == 0:
        print(f"{ROOT / 'build' / 'docs' / 'site' / 'index.html'}")
    return site.returncode


if __name__ == "__main__":
    sys.exit(main())
