"""The page that flashes a board from a browser: images, manifests, and the workflow that builds them."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from gyrocal_firmware import ROOT as FIRMWARE
from test_release import ROOT, loaded

flash_page = loaded("packaging/flash_page.py")
BOOT_APP0 = b"\x01\0\0\0".ljust(0x2000, b"\xff")
CHIPS = {"esp32thing_plus": ("ESP32", 0x1000), "esp32-c3-devkitm-1": ("ESP32-C3", 0), "esp32-s3-devkitc-1": ("ESP32-S3", 0)}
"""By PlatformIO's name of the board: its family, and where its ROM looks for the bootloader."""


@pytest.fixture
def build(tmp_path: Path) -> Path:
    """What PlatformIO leaves, by its names and first bytes."""
    for board in flash_page.BOARDS:
        folder = tmp_path / "build" / board.environment
        folder.mkdir(parents=True)
        (folder / "bootloader.bin").write_bytes(b"\xe9boot" * 100)
        (folder / "partitions.bin").write_bytes(b"\xaa\x50table".ljust(0xC00, b"\xff"))
        (folder / "firmware.bin").write_bytes(b"\xe9" + board.environment.encode() * 1000)
    (tmp_path / "boot_app0.bin").write_bytes(BOOT_APP0)
    return tmp_path / "build"


def test_the_boards_are_those_of_the_firmware() -> None:
    ini = (FIRMWARE / "platformio.ini").read_text(encoding="utf-8")
    found = re.findall(r"\[env:(\w+)\]\nextends = esp32\nboard = (\S+)", ini)
    assert [(b.environment, (b.chip, b.bootloader)) for b in flash_page.BOARDS] == [(env, CHIPS[board]) for env, board in found]


def test_each_board_has_an_image_a_manifest_and_a_button(build: Path, tmp_path: Path) -> None:
    command = [sys.executable, ROOT / "packaging" / "flash_page.py", tmp_path / "out", "--build", build]
    subprocess.run([*command, "--boot-app0", tmp_path / "boot_app0.bin"], check=True, capture_output=True)
    text = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert re.findall(r'manifest="([^"]+)"', text) == [f"{board.environment}.json" for board in flash_page.BOARDS]
    assert re.findall(r'(?:src|href)="([^"]+)"', text) == ["esp-web-tools/install-button.js"]
    for board in flash_page.BOARDS:
        made = json.loads((tmp_path / "out" / f"{board.environment}.json").read_text(encoding="utf-8"))
        assert made["version"] == flash_page.version()
        assert made["new_install_prompt_erase"] is True, "else the results would be erased unasked"
        ((only,),) = [made["builds"]]
        assert only["chipFamily"] == board.chip
        ((part,),) = [only["parts"]]
        assert part["offset"] == 0
        image = (tmp_path / "out" / part["path"]).read_bytes()
        folder = build / board.environment
        for offset, data in (
            (board.bootloader, (folder / "bootloader.bin").read_bytes()),
            (0x8000, (folder / "partitions.bin").read_bytes()),
            (0xE000, BOOT_APP0),
            (0x10000, (folder / "firmware.bin").read_bytes()),
        ):
            assert image[offset : offset + len(data)] == data
        assert image[0x9000:0xE000] == b"\xff" * 0x5000, "the radio's own numbers are made again"
        assert len(image) < 0x200000, "results are kept behind it"


def test_a_build_that_is_not_whole_is_refused(build: Path) -> None:
    board = flash_page.BOARDS[0]
    folder = build / board.environment
    for name, data, says in (
        ("bootloader.bin", b"\xe9" * 0x7001, "reaches beyond 0x8000"),
        ("firmware.bin", b"\xe9" * 0x1F0001, "reaches into the partition of results"),
        ("firmware.bin", b"\x7fELF", "not the firmware.bin of an ESP32"),
        ("partitions.bin", b"", "not the partitions.bin of an ESP32"),
    ):
        kept = (folder / name).read_bytes()
        (folder / name).write_bytes(data)
        with pytest.raises(flash_page.Refused, match=says):
            flash_page.merged(board, folder, BOOT_APP0)
        (folder / name).write_bytes(kept)
    (folder / "firmware.bin").unlink()
    with pytest.raises(flash_page.Refused, match=f"pio run -e {board.environment}"):
        flash_page.merged(board, folder, BOOT_APP0)


def test_the_workflow_of_a_release_builds_every_board() -> None:
    read = yaml.safe_load((ROOT / ".github" / "workflows" / "release.yml").read_text(encoding="utf-8"))
    steps = " ".join(step.get("run", "") for step in read["jobs"]["pages"]["steps"])
    assert re.findall(r" -e (\w+)", steps) == [board.environment for board in flash_page.BOARDS]
    assert flash_page.TOOLS.split("/")[0] in steps
