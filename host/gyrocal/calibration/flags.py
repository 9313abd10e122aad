"""Names and meanings of the flags that are raised against an answer, read from the core's ``gc_flags.h``."""

from __future__ import annotations

import re

from gyrocal_firmware import CORE

LINE = re.compile(r'X\(GC_FLAG_\w+, (\d+), "(\w+)", "([^"]+)"\)')
FLAGS: dict[str, str] = {
    name: meaning for _, name, meaning in sorted(
        LINE.findall((CORE / "gc_flags.h").read_text(encoding="utf-8")), key=lambda found: int(found[0])
    )
}  # fmt: skip
"""Every flag with its meaning, in the order of its bit."""


def ordered(flags: set[str]) -> tuple[str, ...]:
    """Flags in the order of their bits. Unknown names are left out."""
    return tuple(name for name in FLAGS if name in flags)
