"""docs/board.md says what the firmware says: error codes, pins, light."""

import re
from pathlib import Path

from gyrocal_firmware import CORE, ROOT, SIM, SRC

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


def test_sensors_are_those_of_the_drivers() -> None:
    """Name, id and usual address of every part, as the emulated ones have them, which are held against the drivers."""
    kinds = re.findall(r'\{"([^"]+)", &\w+, 0x(\w\w), 0x(\w\w)', (SIM / "emul.c").read_text())
    assert [(row[0], row[2][:2], row[1]) for row in rows("| sensor | id | addresses |")] == kinds


def test_pins_are_those_of_the_environments() -> None:
    ini = (ROOT / "platformio.ini").read_text()
    table = rows("| board | environment | SDA | SCL | light |")
    assert len(table) == ini.count("board = ")
    for _board, environment, sda, scl, light in table:
        section = ini.partition(f"[env:{environment.strip('`')}]")[2].partition("\n\n")[0]
        assert f"-DGYROCAL_SDA={sda} -DGYROCAL_SCL={scl} " in section
        assert re.search(rf"LED={light.split(', ')[1].split()[0]}\b", section)


def test_pins_that_are_tried_are_those_of_the_environments() -> None:
    """Of each chip, every environment, once for each place."""
    header = (SRC / "board.h").read_text()
    known = re.findall(r'\{"(\w+)", (\d+), (\d+)\}', header)
    ini = (ROOT / "platformio.ini").read_text()
    chips = {"esp32thing_plus": "ESP32", "esp32-c3-devkitm-1": "ESP32C3", "esp32-s3-devkitc-1": "ESP32S3"}
    places: dict[tuple[str, str, str], str] = {}
    for name, board, sda, scl in re.findall(
        r"\[env:(\w+)\]\nextends = esp32\nboard = (\S+)\n.*SDA=(\d+) -DGYROCAL_SCL=(\d+) ", ini
    ):
        places.setdefault((chips[board], sda, scl), name)
    assert known == [(name, sda, scl) for (_, sda, scl), name in places.items()]
    assert re.findall(r"CONFIG_IDF_TARGET_(\w+)\)", header) == list(dict.fromkeys(chip for chip, *_ in places))[:-1]


def test_every_reason_of_a_reset() -> None:
    source = (SRC / "reset_reason.cpp").read_text()
    names = re.findall(r'return "([^"]+)";', source)
    assert [row[0] for row in rows("| reset reason | what to do |")] == names


def test_what_is_kept_has_a_partition_of_its_own() -> None:
    """No two partitions overlap, all fit 4 MB, programs start where they must; ours is the one that flash_store.cpp opens."""
    lines = [line.split(",") for line in (ROOT / "partitions.csv").read_text().splitlines() if not line.startswith("#")]
    parts = {p[0].strip(): (p[2].strip(), int(p[3], 16), int(p[4], 16)) for p in lines}
    end = 0x9000
    for _, (_, offset, size) in sorted(parts.items(), key=lambda p: p[1][1]):
        assert offset >= end
        assert offset % 0x1000 == size % 0x1000 == 0
        end = offset + size
    assert end <= 4 << 20
    assert all(offset % 0x10000 == 0 for kind, offset, _ in parts.values() if kind.startswith("ota_"))
    opened = re.search(r'#define PARTITION "(\w+)"', (SRC / "flash_store.cpp").read_text())
    assert opened is not None
    assert parts[opened[1]][0] == "nvs"
    assert parts[opened[1]][2] >= 16 * 0x1000  # four sensors' results and windows, each twice, and NVS's own pages


def test_every_state_of_the_light() -> None:
    states = re.search(r"typedef enum \{ (.*) \} gc_led_t;", (CORE / "gc_port.h").read_text())
    looks = re.findall(r"\{0x[0-9A-F]{4}, .*\* (.*) \*/", (SRC / "status_led.cpp").read_text())
    assert states is not None
    assert len(looks) == states[1].count(",") + 1
    for look, row in zip(looks, rows("| light | colour of an RGB light | meaning | what to do |"), strict=True):
        state, _, shown = look.partition(": ")
        pattern, _, colour = shown.rpartition(", ")
        assert (row[0], row[1]) == (pattern, colour)
        assert state in row[2]
