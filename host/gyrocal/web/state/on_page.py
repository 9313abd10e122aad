"""What the page says where the command line names its options: its own fields and buttons, or the whole command."""

from __future__ import annotations

import re

FIELDS = (
    (
        r"give --rate \(0: it lay still\), --turn-deg, or --gravity \(turned by hand\), or map",
        "give the table rate (0 at rest), a known turn or a second file, say that it was turned by hand, or map a column to",
    ),
    (r"--turn-deg", "the known turn"),
    (r"--ref-clock own", "the tick that it has a clock of its own"),
    (r"--reference", "the second file"),
    (r"; --rate 0 is a sensor that lay still", ""),
    (r"--rate 0", "table rate 0"),
    (r"--rate(?![\w-])", "the table rate"),
    (r"--rate-hz", "the field samples a second"),
    (r"--lsb-dps( [\d.e+-]+)?", r"the field one count\1"),
    (r"--gravity", "choose by hand"),
    (r"--axis", "the field axis"),
    (r"--face", "the field face"),
    (r"the unit of --map", "the unit of its columns"),
    (r"(?<!ref)--map '([^']+)'", r"the line \1"),
    (r"--map ([^\s),;]*=[^\s),;]*)", r"the line \1"),
    (r"--map", "lines of columns and units"),
    (r"\(gyrocal add \w+\)", "(under Diagnose, Try any effect)"),
    (r"overrule them with accept in session\.toml", "overrule them by Accept it"),
)
"""What stands for an option that has a field or a button of the page, as pattern and replacement, in this order."""
OF_CALIBRATE = ("method", "model", "seconds")
"""Options of `gyrocal calibrate` without a field; those of no other verb come to the page, except of `gyrocal import`."""


def on_page(text: str) -> str:
    """A warning, a problem or an advice with the page's fields and buttons in place of the command line's options.

    An option without a field stands behind its command.
    """
    for option, field in FIELDS:
        text = re.sub(option, field, text)
    return re.sub(r"(?:(?:gyrocal )?\b(import|calibrate) )?(?<![\w-])--([a-z][a-z-]*)", _whole, text)


def _whole(option: re.Match[str]) -> str:
    verb = option[1] or ("calibrate" if option[2] in OF_CALIBRATE else "import")
    return f"gyrocal {verb} --{option[2]}"
