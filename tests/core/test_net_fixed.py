"""The network's layers in integers, under sanitizers."""

import re
import subprocess
from pathlib import Path

import pytest

from gyrocal_firmware import CORE, INCLUDE

from .conftest import COVERAGE, FLAGS, HERE

NAMES = ("cnn", "convnet", "convnet_fixed", "convnet_float", "math")
SOURCES = [HERE / "net_fixed.c", *(CORE / f"gc_{name}.c" for name in NAMES)]


def answered(cc: str, folder: Path, header: str) -> subprocess.CompletedProcess[str]:
    (folder / "weights.h").write_text(header)
    command = [cc, *FLAGS, "-DGC_NET_FIXED=1", f"-I{folder}", f"-I{CORE}", *map(str, SOURCES), "-lm", "-o", "net_fixed"]
    subprocess.run(command, cwd=folder, check=True)
    return subprocess.run([folder / "net_fixed"], capture_output=True, text=True, timeout=300)


def test_columns_at_the_ends_of_the_range_overflow_nothing(cc: str, tmp_path: Path) -> None:
    assert answered(cc, tmp_path, (INCLUDE / "weights.h").read_text()).stdout == "2000\n"


@pytest.mark.skipif(COVERAGE is not None, reason="counted without sanitizers")
@pytest.mark.parametrize(
    ("layer", "times", "says"),
    [("first", 2, "does not fit 16 bits"), ("second", 2, "does not fit 16 bits"), ("third", 8, "runtime error")],
)
def test_gains_that_are_too_large_are_noticed(cc: str, layer: str, times: int, says: str, tmp_path: Path) -> None:
    """Sums of 32 bits overflow under the sanitizers; numbers of 16 bits are cut, which the program itself looks for."""
    array = re.compile(rf"(?<=gc_gyrocal_{layer}_gain)(\[\d+\] = {{)(.*?)}}", re.S)
    larger = array.sub(
        lambda found: found[1] + ", ".join(str(times * int(v)) for v in re.findall(r"\d+", found[2])) + "}",
        (INCLUDE / "weights.h").read_text(),
    )
    done = answered(cc, tmp_path, larger)
    assert done.returncode != 0
    assert says in done.stderr
