"""The network on emulated CPUs: the bits of this machine, and what a window costs, saturated and denormal ones too."""

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gyrocal.core import cpus
from gyrocal.core.networks import CoreNetwork
from gyrocal_firmware import CORE

pytestmark = pytest.mark.usefixtures("compiled_for_cpus")
WINDOWS = """/* The windows of the test. */
#include "weights.h"
static const float windows[][2][290] = {%s};
#define WINDOWS (sizeof windows / sizeof windows[0])
static float scratch[GC_NET_SCRATCH_FLOATS], out[2];
static int infer(unsigned i) { return gc_cnn_run(&gc_net, windows[i][0], windows[i][1], 78.0f, -78.0f, scratch, out); }
"""
PRINT = """
#include <stdio.h>
#include <string.h>
int main(int argc, char **argv) {
    (void)argc, (void)argv;
    for (unsigned i = 0; i < WINDOWS; i++) {
        unsigned bits[2];
        const int error = infer(i);
        memcpy(bits, out, sizeof bits);
        printf("%d %08x %08x\\n", error, bits[0], bits[1]);
    }
    return 0;
}
"""
COUNT = """
#include "cost.h"
const unsigned cost_times = WINDOWS;
void cost_prepare(void) {}
void cost_act(void) { static unsigned i; (void)infer(i++ % WINDOWS); }
"""
SOURCES = [CORE / "gc_cnn.c", CORE / "gc_math.c"]


def windows() -> NDArray[np.float32]:
    """[8, 2, 290]: usual ones, a saturated and a denormal one."""
    rng = np.random.default_rng(4)
    x = rng.normal([[[0.26], [-0.36]]], 0.2, (8, 2, 290)).astype(np.float32)
    x[6], x[7] = 1e30, rng.integers(-5, 6, (2, 290)) * np.float32(1e-45)
    return x


def write(path: Path, rest: str) -> Path:
    rows = [["{" + ",".join(map(float.hex, row)) + "}" for row in pair] for pair in windows().tolist()]
    path.write_text(WINDOWS % ",".join("{" + ",".join(pair) + "}" for pair in rows) + rest)
    return path


@pytest.fixture(params=cpus.CPUS, ids=lambda cpu: cpu.name)
def cpu(request: pytest.FixtureRequest, require_tool: Callable[[str], str]) -> cpus.Cpu:
    for tool in ("cc", *request.param.tools):
        require_tool(tool)
    found: cpus.Cpu = request.param
    return found


def test_same_bits(cpu: cpus.Cpu, tmp_path: Path) -> None:
    expected = CoreNetwork().run(windows()[:, 0], windows()[:, 1], 78.0, -78.0)
    bits = [["0", *(struct.pack(">f", value).hex() for value in row)] for row in expected]
    program = cpus.build(cpu, [write(tmp_path / "print.c", PRINT), *SOURCES], tmp_path / "print.elf")
    assert [line.split() for line in cpus.run(cpu, program).decode().splitlines()] == bits


def test_a_window_stays_cheap(cpu: cpus.Cpu, tmp_path: Path) -> None:
    """Measured 27 thousand instructions with an FPU; without one, float arithmetic is libgcc's."""
    most = cpus.cost(cpu, write(tmp_path / "count.c", COUNT), SOURCES).largest
    assert 0 < most < (650_000 if cpu.name == "rv32imc" else 35_000)


def test_a_part_of_the_evidence_fits_between_two_samples(cpu: cpus.Cpu) -> None:
    """Half of a sample's 6.9 ms at 145 Hz, at 160 MHz and an instruction a cycle."""
    assert 0 < cpus.cost(cpu, "evidence").largest < 0.5 * 160e6 / 145
