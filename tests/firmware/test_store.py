"""What is kept survives a loss of power after any byte of any write, and any damaged bit."""

import struct
import subprocess
import zlib
from collections.abc import Callable
from pathlib import Path

from gyrocal_firmware import CORE

HERE = Path(__file__).parent
FLAGS = ["-std=c99", "-g", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]


def run(cc: str, folder: Path, core: Path = CORE) -> str:
    sources = [HERE / "store.c", core / "gc_store.c"]
    subprocess.run([cc, *FLAGS, f"-I{CORE}", *map(str, sources), "-o", str(folder / "store")], check=True)
    return subprocess.run([folder / "store"], capture_output=True, text=True, timeout=60).stdout


def test_every_cut_leaves_the_old_or_the_new(require_tool: Callable[[str], str], tmp_path: Path) -> None:
    word, *record = run(require_tool("cc"), tmp_path).split()
    assert word == "ok"
    data = bytes.fromhex("".join(record))
    crc, sequence, version, n = struct.unpack("=4I", data[:16])
    assert (sequence, version, n) == (1, 7, len(data))
    assert crc == zlib.crc32(data[4:])


def test_a_store_of_one_slot_would_be_found_out(require_tool: Callable[[str], str], tmp_path: Path) -> None:
    text = (CORE / "gc_store.c").read_text()
    assert "sequence & 1u ? 'b' : 'a'" in text
    spoilt = tmp_path / "core"
    spoilt.mkdir()
    (spoilt / "gc_store.c").write_text(text.replace("sequence & 1u ? 'b' : 'a'", "sequence > 0u ? 'a' : 'b'"))
    assert "wanted" in run(require_tool("cc"), tmp_path, spoilt)
