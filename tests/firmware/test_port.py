"""The ESP32 port type-checks with every board's flags, against declarations of what it uses of Arduino-ESP32.

PlatformIO's registry and its headers are not needed for this; a change of the core that breaks the port is seen here.
"""

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from gyrocal_firmware import CORE, INCLUDE, ROOT, SRC

from .conftest import BY_SPI

HERE = Path(__file__).parent
WARNINGS = ["-Wall", "-Wextra", "-Werror"]
BOARDS = dict(
    re.findall(r"\[env:(\w+)\]\nextends = esp32\n.*\nbuild_flags = \S+ (.*)\n", (ROOT / "platformio.ini").read_text())
)
OPTIONS = "-DGYROCAL_SDA2=17 -DGYROCAL_SCL2=16 -DGYROCAL_INT1=27"


def check(compiler: str, flags: str, source: Path) -> str:
    standard = "-std=gnu++11" if source.suffix == ".cpp" else "-std=gnu99"
    folders = [f"-I{folder}" for folder in (SRC, CORE, INCLUDE, HERE / "arduino")]
    command = [compiler, standard, *WARNINGS, *flags.split(), *folders, "-fsyntax-only", str(source)]
    return subprocess.run(command, capture_output=True, text=True).stderr


@pytest.mark.parametrize(
    "flags",
    [
        *BOARDS.values(), f"{BOARDS['thing_plus_usb_c']} {OPTIONS}", f"{BOARDS['esp32_c3']} -DESP_IDF_VERSION_MAJOR=5",
        f"{BOARDS['esp32_s3']} -DGYROCAL_BLE", f"{BOARDS['thing_plus_usb_c']} {' '.join(BY_SPI)}",
    ],
)
def test_port_type_checks(flags: str, require_tool: Callable[[str], str]) -> None:
    sources = sorted(p for p in SRC.iterdir() if p.suffix in (".c", ".cpp"))
    assert len(sources) > 5
    require_tool("g++")
    for source in sources:
        assert check(require_tool("gcc"), flags, source) == ""


def test_a_board_without_pins_is_refused_with_a_reason(require_tool: Callable[[str], str]) -> None:
    require_tool("g++")
    assert "say where the sensor is" in check(require_tool("gcc"), "", SRC / "main.cpp")
    assert "-DGYROCAL_SPI_SCK=" in check(require_tool("gcc"), "-DGYROCAL_SPI_CS=5", SRC / "main.cpp")


def test_a_callback_that_the_core_no_longer_has_is_seen(require_tool: Callable[[str], str], tmp_path: Path) -> None:
    require_tool("g++")
    spoilt = tmp_path / "sensor.cpp"
    spoilt.write_text((SRC / "sensor.cpp").read_text().replace("port_.send =", "port_.speak ="))
    assert "speak" in check(require_tool("gcc"), BOARDS["esp32_c3"], spoilt)
