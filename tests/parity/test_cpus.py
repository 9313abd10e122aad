"""The network on emulated CPUs: the bits of this machine, and what a window costs."""

import struct
import subprocess
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from gyrocal.core import CoreNetwork
from gyrocal_firmware import CORE, INCLUDE

COMMON = ["--specs=picolibc.specs", "--oslib=semihost", "--crt0=hosted", "-std=c99", "-O2", "-ffp-contract=off"]
MEMORY = ["__flash_size=0x200000", "__ram_size=0x200000"]
QEMU = ["-display", "none", "-monitor", "none", "-serial", "none", "-semihosting-config", "enable=on,target=native"]
CPUS = {
    "cortex-m4f": (
        ["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"],
        ["__flash=0", "__ram=0x20000000"],
        ["qemu-system-arm", "-M", "mps2-an386", "-icount", "shift=0"],  # an instruction a nanosecond
    ),
    "esp32-c3": (  # no FPU: libgcc's float
        ["riscv64-unknown-elf-gcc", "-march=rv32imc", "-mabi=ilp32", "-misa-spec=2.2"],
        ["__flash=0x80000000", "__ram=0x80200000"],
        ["qemu-system-riscv32", "-M", "virt", "-bios", "none", "-icount", "shift=0"],
    ),
}
PROGRAM = """
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include "weights.h"
static const float windows[][2][290] = {%s};
%s
int main(void) {
    float scratch[GC_NET_SCRATCH_FLOATS], out[2];
    for (unsigned i = 0; i < sizeof windows / sizeof windows[0]; i++) {
        START();
        int error = gc_cnn_run(&gc_net, windows[i][0], windows[i][1], 78.0f, -78.0f, scratch, out);
        unsigned long ticks = STOP(), bits[2] = {0, 0};
        memcpy(&bits[0], &out[0], 4);
        memcpy(&bits[1], &out[1], 4);
        printf("%%d %%08lx %%08lx %%lu\\n", error, bits[0], bits[1], ticks);
    }
    return 0;
}
"""
CLOCK = {
    "cortex-m4f": """
#define SYSTICK ((volatile uint32_t *)0xE000E010) /* 25 MHz, counts down */
#define START() (SYSTICK[1] = 0xFFFFFF, SYSTICK[2] = 0, SYSTICK[0] = 5)
#define STOP() (0xFFFFFF - SYSTICK[2])
""",
    "esp32-c3": """
static uint32_t started;
static uint32_t instructions(void) { uint32_t n; __asm__ volatile("csrr %0, minstret" : "=r"(n)); return n; }
#define START() (started = instructions())
#define STOP() (instructions() - started)
""",
}
INSTRUCTIONS_A_TICK = {"cortex-m4f": 40, "esp32-c3": 1}


def windows() -> NDArray[np.float32]:
    """[8, 2, 290]: usual ones, a saturated and a denormal one."""
    rng = np.random.default_rng(4)
    x = rng.normal([[[0.26], [-0.36]]], 0.2, (8, 2, 290)).astype(np.float32)
    x[6], x[7] = 1e30, rng.integers(-5, 6, (2, 290)) * np.float32(1e-45)
    return x


@pytest.fixture(scope="module", params=CPUS)
def emulated(
    request: pytest.FixtureRequest, require_tool: Callable[[str], str], tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, list[list[str]]]:
    """The CPU, and for each window the error code, both answers' bits and the clock's ticks."""
    cpu: str = request.param
    gcc, addresses, qemu = CPUS[cpu]
    for tool in ("cc", gcc[0], qemu[0]):
        require_tool(tool)
    folder = tmp_path_factory.mktemp(cpu)
    rows = [["{" + ",".join(map(float.hex, row)) + "}" for row in pair] for pair in windows().tolist()]
    (folder / "main.c").write_text(PROGRAM % (",".join("{" + ",".join(pair) + "}" for pair in rows), CLOCK[cpu]))
    symbols = [f"-Wl,--defsym={symbol}" for symbol in (*addresses, *MEMORY)]
    units = [folder / "main.c", CORE / "gc_cnn.c", CORE / "gc_math.c"]
    command = [*gcc, *COMMON, *symbols, f"-I{CORE}", f"-I{INCLUDE}", *units, "-o", folder / "main.elf"]
    subprocess.run(command, check=True)
    run = [*qemu, *QEMU, "-kernel", folder / "main.elf"]
    done = subprocess.run(run, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60)
    return cpu, [line.split() for line in done.stdout.splitlines()]


def test_same_bits(emulated: tuple[str, list[list[str]]]) -> None:
    expected = CoreNetwork().run(windows()[:, 0], windows()[:, 1], 78.0, -78.0)
    bits = [["0", *(struct.pack(">f", value).hex() for value in row)] for row in expected]
    assert [line[:3] for line in emulated[1]] == bits


def test_a_window_stays_cheap(emulated: tuple[str, list[list[str]]]) -> None:
    """Measured 27 thousand instructions with an FPU; without one, float arithmetic is libgcc's."""
    cpu, lines = emulated
    most = max(int(line[3]) for line in lines) * INSTRUCTIONS_A_TICK[cpu]
    print(f"{cpu}: {most} instructions a window")
    assert 0 < most < {"cortex-m4f": 35_000, "esp32-c3": 650_000}[cpu]
