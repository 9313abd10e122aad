"""docs/board.md says what the firmware says: error codes, pins, light."""

import re
from pathlib import Path

from gyrocal_firmware import CORE, ROOT, SRC

PAGE = (Path(__file__).parents[2] / "docs" / "board.md").read_text()


def rows(heading: str) -> list[list[str]]:
    """The table that begins with this header line."""
    lines = PAGE.partition(heading)[2].splitlines()[2:]
    table = lines[: next(i for i, line in enumerate(lines) if not line.startswith("|"))]
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in table]


def test_every_error_code_with_its_advice() -> None:
    errors = re.findall(r'X\(\w+, (-\d+), "(\w+)",\s*"([^"]+)"\)', (CORE / "gc_error.h").read_text())
    assert len(errors) == (CORE / "gc_error.h").read_text().count("    X(")
    want = [[code, f"`{name}`", advice] for code, name, advice in errors]
    assert rows("| code | name | what to do |") == want, "\n".join(f"| {' | '.join(row)} |" for row in want)


def test_pins_are_those_of_the_environments() -> None:
    ini = (ROOT / "platformio.ini").read_text()
    table = rows("| board | environment | SDA | SCL | light |")
    assert len(table) == ini.count("board = ")
    for _board, environment, sda, scl, light in table:
        section = ini.partition(f"[env:{environment.strip('`')}]")[2].partition("\n\n")[0]
        assert f"-DGYROCAL_SDA={sda} -DGYROCAL_SCL={scl} " in section
        assert re.search(rf"LED={light.split(', ')[1].split()[0]}\b", section)


def test_every_state_of_the_light() -> None:
    states = re.search(r"typedef enum \{ (.*) \} gc_led_t;", (CORE / "gc_port.h").read_text())
    looks = re.findall(r"\{0x[0-9A-F]{4}, .*\* (.*) \*/", (SRC / "status_led.cpp").read_text())
    assert states is not None
    assert len(looks) == states[1].count(",") + 1
    for look, row in zip(looks, rows("| light | colour, where there is one | means | do |"), strict=True):
        state, _, shown = look.partition(": ")
        pattern, _, colour = shown.rpartition(", ")
        assert (row[0], row[1]) == (pattern, colour)
        assert state in row[2]
