"""The page that flashes a board from a browser: for each board an image, its manifest for ESP Web Tools, and a button.

    python packaging/flash_page.py OUT --build FOLDER --boot-app0 FILE

``FOLDER`` is PlatformIO's ``.pio/build`` after ``pio run -e BOARD`` for each of `BOARDS`; ``FILE`` is boot_app0.bin of
Arduino-ESP32, which says that the first program is started. Images and manifests lie beside the page, because a browser
takes none from a list of downloads on another site. ESP Web Tools lies there too (.github/workflows/release.yml).
"""

from __future__ import annotations

import argparse
import html
import json
import re
import sys
from pathlib import Path
from typing import NamedTuple

FIRMWARE = Path(__file__).resolve().parents[1] / "firmware" / "gyrocal_firmware"
PARTITION_TABLE = 0x8000
PROGRAM, TABLE = b"\xe9", b"\xaa\x50"
"""The first bytes of a bootloader or a program, and of a partition table."""
EMPTY = b"\xff"
TOOLS = "esp-web-tools/install-button.js"


class Refused(Exception):
    """What is wrong with what was built."""


class Board(NamedTuple):
    """A board by its environment in platformio.ini. ``chip`` is its family as ESP Web Tools names it."""

    environment: str
    title: str
    chip: str
    bootloader: int
    """Where the chip looks for its bootloader."""


BOARDS = (
    Board("thing_plus_micro_b", "SparkFun Thing Plus ESP32, micro-B", "ESP32", 0x1000),
    Board("thing_plus_usb_c", "SparkFun Thing Plus ESP32, USB-C", "ESP32", 0x1000),
    Board("esp32_c3", "ESP32-C3-DevKitM-1", "ESP32-C3", 0),
    Board("esp32_s3", "ESP32-S3-DevKitC-1, connector UART", "ESP32-S3", 0),
    Board("esp32_s3_usb", "ESP32-S3-DevKitC-1, connector USB", "ESP32-S3", 0),
)


def version() -> str:
    """The version that the firmware says of itself."""
    text = (FIRMWARE / "lib" / "gyrocal_core" / "gc_device.h").read_text(encoding="utf-8")
    return re.findall(r'GC_FIRMWARE_VERSION "([^"]+)"', text)[0]


def partitions() -> dict[str, int]:
    """The offset of each partition, by its name."""
    rows = [
        [word.strip() for word in line.split(",")]
        for line in (FIRMWARE / "partitions.csv").read_text(encoding="utf-8").splitlines()
        if line.strip() and not line.startswith("#")
    ]
    return {row[0]: int(row[3], 0) for row in rows}


def merged(board: Board, folder: Path, boot_app0: bytes) -> bytes:
    """The image of a board from the start of its flash.

    Raises:
        Refused: a file of the build is missing, is not what it should be, or reaches into the next; or the image reaches into
            the partition of results, which flashing leaves alone.
    """
    at = partitions()
    wanted = (
        (board.bootloader, "bootloader.bin", PROGRAM),
        (PARTITION_TABLE, "partitions.bin", TABLE),
        (at["otadata"], "", b""),
        (at["app0"], "firmware.bin", PROGRAM),
    )
    image = b""
    for offset, name, first in wanted:
        data = _read(folder / name) if name else boot_app0
        if not data.startswith(first):
            raise Refused(f"{folder / name}: not the {name} of an ESP32")
        if len(image) > offset:
            raise Refused(f"{folder.name}: what comes before {name or 'boot_app0.bin'} reaches beyond {offset:#x}")
        image = image.ljust(offset, EMPTY) + data
    if len(image) > at["gyrocal"]:
        raise Refused(f"{folder.name}: the firmware reaches into the partition of results; make it smaller")
    return image


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}; build it: pio run -e {path.parent.name}") from None


def manifest(board: Board) -> dict[str, object]:
    """What ESP Web Tools reads. It asks before it erases results, and does not wait for a Wi-Fi set-up that there is not."""
    return {
        "name": f"gyrocal, {board.title}",
        "version": version(),
        "new_install_prompt_erase": True,
        "new_install_improv_wait_time": 0,
        "builds": [{"chipFamily": board.chip, "parts": [{"path": f"{board.environment}.bin", "offset": 0}]}],
    }


def page() -> str:
    """The page: a button for each board."""
    tag = "esp-web-install-button"
    rows = "\n".join(
        f'<li>{html.escape(board.title)} <{tag} manifest="{board.environment}.json"></{tag}></li>' for board in BOARDS
    )
    return f"""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Flash gyrocal {version()}</title>
<script type="module" src="{TOOLS}"></script>
<h1>Flash gyrocal {version()}</h1>
<p>Connect the board by USB, open this page in Chrome or Edge on a computer, and press the button of your board.
Where you are asked whether to erase the device, do so on a new board; do not if it shall keep its settings and results.</p>
<ul>
{rows}
</ul>
<p>The two Thing Plus differ in their pins: choose by the connector.
Then close the page and type <code>gyrocal doctor</code>.</p>
</html>
"""


def write(out: Path, build: Path, boot_app0: Path) -> None:
    """Write image and manifest of each board, and the page. Raises Refused as :func:`merged`."""
    out.mkdir(parents=True, exist_ok=True)
    started = _read(boot_app0)
    for board in BOARDS:
        (out / f"{board.environment}.bin").write_bytes(merged(board, build / board.environment, started))
        (out / f"{board.environment}.json").write_text(json.dumps(manifest(board), indent=2) + "\n", encoding="utf-8")
    (out / "index.html").write_text(page(), encoding="utf-8")


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("out", type=Path)
    options.add_argument("--build", type=Path, default=FIRMWARE / ".pio" / "build")
    options.add_argument("--boot-app0", type=Path, required=True)
    given = options.parse_args()
    try:
        write(given.out, given.build, given.boot_app0)
    except Refused as reason:
        print(f"flash_page: {reason}", file=sys.stderr)
        return 2
    print(f"{given.out / 'index.html'}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
