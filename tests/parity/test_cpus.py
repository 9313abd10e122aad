"""The network's bits on emulated CPUs are those of this machine."""

import struct
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from gyrocal.core import CoreNetwork
from gyrocal_firmware import CORE, INCLUDE

COMMON = ["--specs=picolibc.specs", "--oslib=semihost", "--crt0=hosted", "-std=c99", "-O2", "-ffp-contract=off"]
MEMORY = ["__flash_size=0x200000", "__ram_size=0x200000"]
QEMU = ["-display", "none", "-monitor", "none", "-serial", "none", "-semihosting-config", "enable=on,target=native"]
CPUS = {
    "cortex-m4f": (
        ["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"],
        ["__flash=0", "__ram=0x20000000"],
        ["qemu-system-arm", "-M", "mps2-an386"],
    ),
    "esp32-c3": (  # no FPU: libgcc's float
        ["riscv64-unknown-elf-gcc", "-march=rv32imc", "-mabi=ilp32", "-misa-spec=2.2"],
        ["__flash=0x80000000", "__ram=0x80200000"],
        ["qemu-system-riscv32", "-M", "virt", "-bios", "none"],
    ),
}
PROGRAM = """
#include <stdio.h>
#include <string.h>
#include "weights.h"
static const float windows[][2][290] = {%s};
int main(void) {
    float scratch[GC_NET_SCRATCH_FLOATS], out[2];
    for (unsigned i = 0; i < sizeof windows / sizeof windows[0]; i++) {
        int error = gc_cnn_run(&gc_net, windows[i][0], windows[i][1], 78.0f, -78.0f, scratch, out);
        unsigned long bits[2] = {0, 0};
        memcpy(&bits[0], &out[0], 4);
        memcpy(&bits[1], &out[1], 4);
        printf("%%d %%08lx %%08lx\\n", error, bits[0], bits[1]);
    }
    return 0;
}
"""


@pytest.mark.parametrize("cpu", CPUS)
def test_same_bits(cpu: str, require_tool: Callable[[str], str], tmp_path: Path) -> None:
    gcc, addresses, qemu = CPUS[cpu]
    for tool in ("cc", gcc[0], qemu[0]):
        require_tool(tool)
    rng = np.random.default_rng(4)
    x = rng.normal([[[0.26], [-0.36]]], 0.2, (8, 2, 290)).astype(np.float32)
    x[6], x[7] = 1e30, rng.integers(-5, 6, (2, 290)) * np.float32(1e-45)
    literal = ",".join(
        "{" + ",".join("{" + ",".join(map(float.hex, row)) + "}" for row in pair) + "}" for pair in x.tolist()
    )
    source = tmp_path / "main.c"
    source.write_text(PROGRAM % literal)
    elf = tmp_path / "main.elf"
    symbols = [f"-Wl,--defsym={s}" for s in (*addresses, *MEMORY)]
    units = [source, CORE / "gc_cnn.c", CORE / "gc_math.c"]
    subprocess.run([*gcc, *COMMON, *symbols, f"-I{CORE}", f"-I{INCLUDE}", *map(str, units), "-o", str(elf)], check=True)
    run = [*qemu, *QEMU, "-kernel", str(elf)]
    done = subprocess.run(run, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60)

    expected = CoreNetwork().run(x[:, 0], x[:, 1], 78.0, -78.0)
    lines = ["0 " + " ".join(f"{struct.unpack('<I', struct.pack('<f', v))[0]:08x}" for v in row) for row in expected]
    assert done.stdout.split("\n")[:-1] == lines
